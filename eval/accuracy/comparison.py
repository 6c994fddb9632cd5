"""Table 1 of the paper: the full approach, its ablations, the baseline and others, side by side.

All runs predict the same test images, so the difference between two runs is known more precisely
than the value of either. The interval of a difference is a paired bootstrap over the images.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.model import folder as model_folder
from lime_keras.networks import PRESETS, Architecture
from lime_keras.runtime.engine import Arrays

from ..markdown_table import ABSENT, aligned
from . import claims, measures
from .claims import FULL
from .measures import MEASURES
from .table import UNITS

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
_PRINTED = COLUMNS[:5]
_OTHER_ROWS = {
    "without perceptual loss": (0.4515, 0.4096, 0.3038, 0.1406, 0.2368),
    "without MirrorNet": (0.3629, 0.4028, 0.3913, 0.0759, 0.2449),
    "exponent regression": (0.4409, 0.4128, 0.2974, 0.0683, 0.2723),
    "reflectance map": (0.1357, 0.2529, 0.7243, 0.0408, 0.1758),
}
PAPER: dict[str, dict[str, float]] = {
    FULL: {name: paper for name in COLUMNS if (paper := MEASURES[name].paper) is not None},
    **{row: dict(zip(_PRINTED, cells, strict=True)) for row, cells in _OTHER_ROWS.items()},
}
"""The 25 cells of the paper's Table 1 and the IoU of its masks, by row and measure."""


@dataclass(frozen=True)
class System:
    """What a run is.

    Attributes:
        name: its name in words.
        row: row of `PAPER` whose recipe it was trained by; None if it was by another one.
    """

    name: str
    row: str | None = None


def system(architecture: Architecture, run: Path) -> System:
    """Return what a run is, by its record: the paper's recipe, or another one, and its parts."""
    config = model_folder.training_config(run)
    baseline = architecture.system == "reflectance-map"
    ablations = _true(
        {
            "without perceptual loss": not config.get("compositing", True) and not baseline,
            "without MirrorNet": not architecture.mirror,
            "exponent regression": architecture.exponent == "regression",
            "reflectance map": baseline,
        }
    )
    if _is_the_papers(config, architecture) and len(ablations) < 2:
        row = ablations[0] if ablations else FULL
        return System(f"{row}{_scale(config, architecture)}", row)
    added = _true(
        {
            "with the split of colours": architecture.dichromatic,
            "with the hue of pixels": architecture.hue,
        }
    )
    recipe = "another recipe" if config else "of an unknown recipe"
    return System(", ".join([recipe, *added, *ablations]))


def _is_the_papers(config: Mapping[str, Any], architecture: Architecture) -> bool:
    """Return whether a run was trained as sections 4 to 5.4 say; its size and length may differ."""
    schedule = config.get("schedule", {})
    wanted = {
        **dict.fromkeys(("cosine", "camera", "flips", "repaints", "paints", "found_masks"), False),
        **{"optimizer": "adam", "losses": "printed", "batch_size": 32},
        **dict.fromkeys(("single_learning_rate", "joint_learning_rate"), 1e-4),
    }
    parts = ("pretrained", "dichromatic", "hue", "mask_contrast", "linear")
    return (
        schedule.items() >= wanted.items()
        and schedule.get("rate") is None
        and schedule.get("average") is None
        and all(getattr(architecture, name) == getattr(PRESETS["paper"], name) for name in parts)
        and (config.get("lobe"), config.get("precision")) == ("printed", "float32")
        and config.get("plain_scenes", True)
        and not any(config.get(name) for name in ("begun_from", "frozen", "materials", "cutouts"))
    )


def _scale(config: Mapping[str, Any], architecture: Architecture) -> str:
    """Return what is smaller than in the paper, in words; nothing for a run of its size."""
    whole, scale = PRESETS["paper"], config.get("steps_scale", 1.0)
    steps = config.get("schedule", {}).get("steps")
    said = _true(
        {
            f"{architecture.size} px": architecture.size != whole.size,
            f"{architecture.unet_width} wide": architecture.unet_width != whole.unet_width,
            f"{scale:g} of the batches": scale != 1,
            f"{steps} batches a stage": steps is not None,
        }
    )
    return f" at {', '.join(said)}" if said else ""


def _true(said: Mapping[str, bool]) -> list[str]:
    return [words for words, is_so in said.items() if is_so]


def other_system(rows: Arrays) -> System:
    """Return the answers by another system, given the rows of `evaluate.evaluate_predictions`."""
    answered = rows["answered"]
    if answered.all():
        return System("another system")
    return System(f"another system, {answered.sum()} of {answered.size} images answered")


def compare(
    evaluated: Mapping[str, Arrays], systems: Mapping[str, System], lobe: str = "furnace"
) -> dict[str, Any]:
    """Compare runs on the same test images; return the content of `comparison.json`.

    Args:
        evaluated: columns of `Evaluation.rows` on the same test images, by name of the run.
        systems: what the runs are, by name of the run.
        lobe: lobe of the corpus, one of `corpus.LOBES`.

    Returns:
        `count` of the images; the `lobe`; `reference`, the run that the others are compared with:
        the full approach, or else the first run; and `runs` by name, in the paper's order. Each run
        has its `system` and `row` (see `System`), and by measure of `COLUMNS` its `value` and its
        95 % `interval` `[low, high]`. Each run but the reference also has, by measure, the 95 %
        interval of its `difference` from the reference. `claims` are those of the paper that the
        runs can judge (`claims.judge`).

    Raises:
        ValueError: if the runs were not evaluated on the same images.
    """
    # The rows of the paper's table come first, in its order.
    ranks: dict[str | None, int] = {row: rank for rank, row in enumerate(PAPER)}
    order = sorted(evaluated, key=lambda name: ranks.get(systems[name].row, len(ranks)))
    counts = {name: len(evaluated[name]["seed"]) for name in order}
    images = {b"".join(evaluated[n][of].tobytes() for of in ("seed", "index")) for n in order}
    if len(set(counts.values())) > 1 or len(images) > 1:
        raise ValueError(f"the runs were not measured on the same images: {counts}")
    reference = next((name for name in order if systems[name].row == FULL), order[0])
    drawn = {name: measures.resampled(evaluated[name]) for name in order}
    runs = {}
    for name in order:
        value = measures.values(evaluated[name])
        shown = [key for key in COLUMNS if key in value]
        runs[name] = {
            "system": systems[name].name,
            "row": systems[name].row,
            "value": {key: value[key] for key in shown},
            "interval": measures.ends({key: drawn[name][key] for key in shown}),
        }
        if name != reference:
            both = [key for key in shown if key in drawn[reference]]
            runs[name]["difference"] = measures.ends(
                {key: drawn[name][key] - drawn[reference][key] for key in both}
            )
    by_row = {row: [drawn[n] for n in order if systems[n].row == row] for row in PAPER}
    return {
        "count": counts[order[0]],
        "lobe": lobe,
        "reference": reference,
        "runs": runs,
        "claims": claims.judge(by_row, PAPER),
    }


def markdown(compared: Mapping[str, Any]) -> str:
    """Return the tables in Markdown: of the runs, with the paper's row below each, and of claims.

    Rows of the paper that no run was trained by stand at the end. A value is marked where the
    interval of its difference from the reference excludes 0: `+` is better, `−` is worse.
    """
    runs, unit = compared["runs"], UNITS[compared["lobe"]]
    shown = [name for name in COLUMNS if any(name in run["value"] for run in runs.values())]
    lines = [("Run", *(MEASURES[name].short for name in shown))]
    left = dict(PAPER)
    for name, run in runs.items():
        lines.append((f"{name}: {run['system']}", *(_cell(run, key) for key in shown)))
        if run["row"] in left:
            lines.append(_printed("  the paper's", left.pop(run["row"]), shown))
    lines += [_printed(f"the paper's: {row}", cells, shown) for row, cells in left.items()]
    note = (
        f"{compared['count']} test images. ±: half the 95 % interval over them. + and − mark what "
        f"is better or worse than {compared['reference']} beyond the 95 % interval of the "
        "difference on the same images; another training of the same system would differ too. "
        f"{unit}."
    )
    judged = claims.markdown(compared["claims"])
    return "\n\n".join(filter(None, [aligned(lines), note, judged])) + "\n"


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


def _printed(title: str, cells: Mapping[str, float], shown: list[str]) -> tuple[str, ...]:
    return (title, *(MEASURES[key].unit.number(cells.get(key)) for key in shown))
