"""The examples of a report: chosen from the evaluation, then read and estimated once more."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.data import pipeline, records
from lime_keras.data.camera import photograph, radiance
from lime_keras.data.corpus import Split
from lime_keras.optics import shininess
from lime_keras.runtime.keras_engine import KerasEngine

_WORST = 2  # number of examples shown of each kind of failure


@dataclass(frozen=True)
class Selection:
    """A test example to show: its position in the split, from 0, and the reason to show it."""

    position: int
    reason: str


@dataclass(frozen=True)
class Example:
    """One test example with its estimate.

    Attributes:
        choice: position of the example, and the reason to show it.
        truth: the record, resized to the model's size: arrays, and names as bytes.
        estimate: the system's outputs for this image, without the batch axis.
        photo_srgb: the input image at its stored size, sRGB in [0, 1].
        lobe: lobe of the corpus, one of `corpus.LOBES`.
    """

    choice: Selection
    truth: dict[str, Any]
    estimate: dict[str, np.ndarray]
    photo_srgb: np.ndarray
    lobe: str = "furnace"

    @property
    def exponent(self) -> float:
        """The estimated exponent: from the expected log10 s over the classes, or by regression."""
        return float(10.0 ** shininess.log_of_outputs(self.estimate))


def choose(rows: Mapping[str, np.ndarray]) -> list[Selection]:
    """Choose the first example of each exponent bin, then the worst by exponent and each albedo.

    No example is chosen twice. Examples with equal errors are taken in the order of the split. The
    rows are those of `Evaluation`.
    """
    chosen = [
        Selection(int(np.argmax(rows["bin"] == k)), f"first with {shininess.bin_label(k)}")
        for k in range(shininess.BIN_COUNT)
        if np.any(rows["bin"] == k)
    ]
    taken = {choice.position for choice in chosen}
    failures = (
        # A tenth of the log error breaks ties.
        ("worst exponent", rows["bin_distance"] + rows["log_error"] / 10),
        ("worst diffuse albedo", rows["diffuse_absolute"]),
        ("worst specular albedo", rows["specular_absolute"]),
    )
    for reason, error in failures:
        worst_first = np.argsort(-error, kind="stable").tolist()
        positions = [position for position in worst_first if position not in taken][:_WORST]
        chosen += [Selection(position, reason) for position in positions]
        taken.update(positions)
    return chosen


def worst(rows: Mapping[str, np.ndarray]) -> list[Selection]:
    """Choose the twenty examples with the lowest PSNR relit under their own light, worst first."""
    order = np.argsort(rows["relit"], kind="stable")[:20]
    return [Selection(position, "worst relit") for position in order.tolist()]


def read(
    model_dir: Path, corpus: Path, choices: list[Selection], *, camera: bool = False
) -> list[Example]:
    """Read the chosen test examples and estimate them, in the order of `choices`.

    Args:
        model_dir: folder of `weights.save`, or a run of `lime-train`.
        corpus: folder with a complete `test` split.
        choices: examples to read.
        camera: show the system photos of the scenes, the same as those that `evaluate` shows.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
    """
    engine = KerasEngine(model_dir)
    split = Split(corpus, "test")
    spans = pipeline.record_spans(pipeline.verified_shards(split))
    photos, truths = [], []
    for choice in choices:
        stored = records.parse(pipeline.read_record(spans[choice.position]))
        stored = photograph(stored, radiance(stored)) if camera else stored
        photos.append(stored["image"].numpy())
        example = pipeline.resize(stored, engine.size)
        truths.append({name: value.numpy() for name, value in example.items()})
    images = np.stack([truth["image"] for truth in truths])
    estimates = engine.run(engine.outputs, {"image": images})
    return [
        Example(
            choice,
            truth,
            {name: values[row] for name, values in estimates.items()},
            photos[row],
            split.lobe,
        )
        for row, (choice, truth) in enumerate(zip(choices, truths, strict=True))
    ]
