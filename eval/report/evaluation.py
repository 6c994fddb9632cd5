"""The section about one run: its numbers, figures, slices and examples."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.material import srgb_hex
from lime_keras.optics import shininess

from ..accuracy import labels, slices, table
from ..accuracy.evaluate import Evaluation
from ..accuracy.measures import DECIBEL
from . import renders
from .examples import Example
from .page import rendered


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
    relit = evaluated.rows["relit"]
    return rendered(
        "evaluation.html",
        command=command,
        corpus=corpus.name or str(corpus),
        run=run.name or str(run),
        summary=summary,
        exponent=labels.exponent(evaluated.architecture),
        header=table.HEADER,
        rows=table.rows(summary),
        pictures=pictures,
        slices=slices.rows(evaluated.rows),
        examples=[_card(example, relit) for example in examples],
        worst=[_card(example, relit) for example in worst],
    )


def _card(example: Example, relit: np.ndarray) -> dict[str, Any]:
    """Return the template's values for one example, given the PSNR `(N,)` of all of them."""
    truth, estimate = example.truth, example.estimate
    probabilities = estimate.get("exponent_bin_probabilities", ())
    true_bin = int(shininess.bin_of(truth["shininess"]))
    albedos = truth["diffuse_albedo"], estimate["diffuse_albedo"]
    return {
        "reason": example.choice.reason,
        "source": f"{truth['shape'].decode()} under {truth['light'].decode()}, "
        f"seed {truth['seed']}, index {truth['index']}",
        "psnr": DECIBEL.number(relit[example.choice.position]),
        "photo": truth["image"],
        "pairs": renders.pairs(example),
        "diffuse": [(srgb_hex(m_d), " ".join(f"{value:.2f}" for value in m_d)) for m_d in albedos],
        "specular": [f"{float(m['specular_albedo'].item()):.2f}" for m in (truth, estimate)],
        "exponent": [f"{s:.1f}" for s in (float(truth["shininess"]), example.exponent)],
        "bars": [
            (round(100 * float(p), 1), labels.bin_label(k), k == true_bin)
            for k, p in enumerate(probabilities)
        ],
    }
