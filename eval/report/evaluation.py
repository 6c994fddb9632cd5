"""The section about one run: its numbers, figures, slices and examples."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.material import srgb_hex
from lime_keras.optics import shininess

from ..accuracy import labels, table
from ..accuracy.evaluate import Evaluation
from ..accuracy.measures import DECIBEL, MEASURES
from ..accuracy.slices import slices
from . import renders
from .examples import Example
from .page import data_uri, rendered


def evaluation(
    evaluated: Evaluation,
    summary: Mapping[str, Any],
    pictures: Mapping[str, bytes],
    examples: list[Example],
    worst: list[Example],
    *,
    command: str,
    corpus: Path,
    run: Path,
) -> str:
    """Return the section about one run as HTML.

    Args:
        evaluated: evaluation of the run.
        summary: result of `measures.summarise` for this evaluation.
        pictures: figures as PNG: `confusion`, and `reliability` where there are probabilities.
        examples: examples to show with their layers (see `examples.read`).
        worst: examples to show small, with their relighting error.
        command: command that made the report, as typed.
        corpus: folder of the corpus with the test split.
        run: folder of the weights.
    """
    parts = slices(evaluated.rows)
    shown = {name: MEASURES[name] for name in parts[0].value}
    return rendered(
        "evaluation.html",
        command=command,
        corpus=corpus.name or str(corpus),
        run=run.name or str(run),
        summary=summary,
        exponent=labels.exponent(evaluated.architecture),
        header=table.HEADER,
        rows=table.rows(summary),
        pictures={name: data_uri(png) for name, png in pictures.items()},
        slice_header=("Part", "images", *(measure.short for measure in shown.values())),
        slices=[
            (
                f"{part.by}: {part.label}",
                str(part.count),
                *(
                    measure.unit.with_interval(part.value[name], part.interval[name])
                    for name, measure in shown.items()
                ),
            )
            for part in parts
        ],
        examples=[_card(example) for example in examples],
        worst=[_small_card(example, evaluated) for example in worst],
    )


def _small_card(example: Example, evaluated: Evaluation) -> dict[str, Any]:
    """Return the template's values for one of the worst relit examples."""
    truth = example.truth
    return _material(example) | {
        "source": f"{truth['shape'].decode()} under {truth['light'].decode()}, "
        f"index {truth['index']}",
        "psnr": DECIBEL.number(evaluated.rows["relit"][example.choice.position]),
        "photo": data_uri(renders.png(truth["image"])),
        "true": data_uri(renders.png(renders.true_render(example))),
        "estimated": data_uri(renders.png(renders.estimated_render(example))),
    }


def _material(example: Example) -> dict[str, Any]:
    """Return the true and the estimated m_d, m_s and s as the template prints them."""
    truth, estimate = example.truth, example.estimate
    return {
        "diffuse": [_swatch(material["diffuse_albedo"]) for material in (truth, estimate)],
        "specular": [f"{float(m['specular_albedo'].item()):.2f}" for m in (truth, estimate)],
        "exponent": [f"{s:.1f}" for s in (float(truth["shininess"]), example.exponent)],
    }


def _card(example: Example) -> dict[str, Any]:
    """Return the template's values for one of the examples shown with their layers."""
    truth, estimate = example.truth, example.estimate
    probabilities = estimate.get("exponent_bin_probabilities", ())
    true_bin = int(shininess.bin_of(truth["shininess"]))
    return _material(example) | {
        "reason": example.choice.reason,
        "source": f"{truth['shape'].decode()} under {truth['light'].decode()}, "
        f"seed {truth['seed']}, index {truth['index']}",
        "photo": data_uri(renders.png(truth["image"])),
        "pairs": [
            {
                "title": pair.title,
                "truth": data_uri(renders.png(pair.truth)),
                "estimate": data_uri(renders.png(pair.estimate)),
            }
            for pair in renders.pairs(example)
        ],
        "bars": [
            {
                "height": round(100 * float(p), 1),
                "label": labels.bin_label(k),
                "is_true": k == true_bin,
            }
            for k, p in enumerate(probabilities)
        ],
    }


def _swatch(albedo_linear: np.ndarray) -> dict[str, str]:
    """Return a linear albedo `(3,)` as a CSS colour and as text."""
    return {
        "css": srgb_hex(albedo_linear),
        "text": " ".join(f"{value:.2f}" for value in albedo_linear),
    }
