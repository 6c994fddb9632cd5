"""Table 1 of the paper: the full approach, its ablations, the baseline and others, side by side.

All runs predict the same test images, so the difference between two runs is known more precisely
than the value of either. The interval of a difference is a paired bootstrap over the images.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.networks import Architecture

from ..markdown_table import ABSENT, aligned
from . import measures, training_record
from .measures import MEASURES

COLUMNS = (
    "exponent_exact",
    "exponent_adjacent",
    "log_exponent_mae",
    "diffuse_albedo_mae",
    "specular_albedo_mae",
    "mask_iou",
    "ggx_alpha_mae",
    "specular_shading_relative",
    "mirror_relative",
    "relighting_psnr",
    "relighting_psnr_unseen",
)
"""Measures of the table, the paper's first."""

FULL = "full approach"
PAPER: dict[str, dict[str, float]] = {
    FULL: {name: m.paper for name, m in MEASURES.items() if m.paper is not None},
    "without perceptual loss": {},
    "without MirrorNet": {},
    "exponent regression": {},
    "reflectance map": {
        "exponent_exact": 0.1357,
        "exponent_adjacent": 0.2529,
        "log_exponent_mae": 0.7243,
    },
}
"""Measures of the paper's rows, in its order; empty for the rows whose numbers we do not have."""


def system(architecture: Architecture, run: Path) -> str:
    """Return the name of the paper's row that a run belongs to; join the names of what differs."""
    if architecture.system == "reflectance-map":
        return "reflectance map"
    changed = [
        name
        for name, is_so in (
            ("with the split of colours", architecture.dichromatic),
            ("with the hue of pixels", architecture.hue),
            ("without perceptual loss", not training_record.read(run).get("compositing", True)),
            ("without MirrorNet", not architecture.mirror),
            ("exponent regression", architecture.exponent == "regression"),
        )
        if is_so
    ]
    return ", ".join(changed) or FULL


def other_system(rows: Mapping[str, np.ndarray]) -> str:
    """Return the name of the row of answers by another system.

    Args:
        rows: result of `evaluate.evaluate_predictions`.
    """
    answered = rows["answered"]
    if answered.all():
        return "another system"
    return f"another system, {answered.sum()} of {answered.size} images answered"


def compare(
    evaluated: Mapping[str, Mapping[str, np.ndarray]],
    systems: Mapping[str, str],
    lobe: str = "furnace",
) -> dict[str, Any]:
    """Compare runs on the same test images; return the content of `comparison.json`.

    Args:
        evaluated: columns of `Evaluation.rows` on the same test images, by name of the run.
        systems: names of the paper's rows (see `system`) or of others, by name of the run.
        lobe: lobe of the corpus, one of `corpus.LOBES`.

    Returns:
        `count` of the images; the `lobe`; `reference`, the run that the others are compared with:
        the full approach, or else the first run; and `runs` by name, in the paper's order. Each run
        has its `system`, and by measure of `COLUMNS` its `value` and its 95 % `interval`
        `[low, high]`.
        Each run but the reference also has, by measure, the 95 % interval of its `difference` from
        the reference.

    Raises:
        ValueError: if the runs were not evaluated on the same images.
    """
    # The rows of the paper's table come first, in its order.
    ranks = {system: rank for rank, system in enumerate(PAPER)}
    order = sorted(evaluated, key=lambda name: ranks.get(systems[name], len(ranks)))
    counts = {name: len(evaluated[name]["seed"]) for name in order}
    images = {b"".join(evaluated[n][of].tobytes() for of in ("seed", "index")) for n in order}
    if len(set(counts.values())) > 1 or len(images) > 1:
        raise ValueError(f"the runs were not measured on the same images: {counts}")
    reference = next((name for name in order if systems[name] == FULL), order[0])
    drawn = {name: measures.resampled(evaluated[name]) for name in order}
    runs = {}
    for name in order:
        value = measures.values(evaluated[name])
        runs[name] = {
            "system": systems[name],
            "value": {key: value[key] for key in COLUMNS if key in value},
            "interval": _ends({key: drawn[name][key] for key in COLUMNS if key in value}),
        }
        if name != reference:
            runs[name]["difference"] = _ends(
                {
                    key: drawn[name][key] - drawn[reference][key]
                    for key in COLUMNS
                    if key in drawn[name] and key in drawn[reference]
                }
            )
    return {"count": counts[order[0]], "lobe": lobe, "reference": reference, "runs": runs}


def markdown(compared: Mapping[str, Any]) -> str:
    """Return the table in Markdown: a row for each run, and below it the paper's row if known.

    A value is marked where the interval of its difference from the reference excludes 0: `+` is
    better, `−` is worse.
    """
    runs, unit = compared["runs"], training_record.UNITS[compared["lobe"]]
    shown = [name for name in COLUMNS if any(name in run["value"] for run in runs.values())]
    lines = [("Run", *(MEASURES[name].short for name in shown))]
    for name, run in runs.items():
        cells = [_cell(run, key) for key in shown]
        lines.append((f"{name}: {run['system']}", *cells))
        known = PAPER.get(run["system"], {})
        if known:
            printed = [MEASURES[key].unit.number(known.get(key)) for key in shown]
            lines.append(("  the paper's", *printed))
    note = (
        f"{compared['count']} test images. ±: half the 95 % interval over them. + and − mark what "
        f"is better or worse than {compared['reference']} beyond the 95 % interval of the "
        "difference on the same images; another training of the same system would differ too. "
        f"Rows of the paper that are not shown are not known to us. {unit}."
    )
    return f"{aligned(lines)}\n\n{note}\n"


def verdict(run: Mapping[str, Any], name: str) -> str:
    """Return `+` if a run is better than the reference, `−` if worse, and "" if neither is sure."""
    low, high = run.get("difference", {}).get(name, (0.0, 0.0))
    better = MEASURES[name].more_is_better
    if better is None or low <= 0 <= high:
        return ""
    return "+" if (low > 0) == better else "−"


def _cell(run: Mapping[str, Any], name: str) -> str:
    if name not in run["value"]:
        return ABSENT
    value = MEASURES[name].unit.with_interval(run["value"][name], run["interval"][name])
    return f"{value} {verdict(run, name)}".rstrip()


def _ends(drawn: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    return {name: np.percentile(values, (2.5, 97.5)).tolist() for name, values in drawn.items()}
