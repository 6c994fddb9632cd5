"""The preview of a corpus: a contact sheet, and histograms of all random quantities.

`lime-render preview` writes both beside the shards.
"""

import collections
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib
import numpy as np
import tensorflow as tf
from matplotlib.figure import Figure

from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.io import atomic

from . import contact_sheet, histograms, quantities

_SHOWN = 24
_PICTURED = 2000
"""Largest number of examples whose images are decoded: enough for a histogram, quick to read."""


@dataclass
class Gathered:
    """The data gathered from one pass over a split.

    Attributes:
        columns: values of each quantity, one for each example that has the quantity.
        shapes: number of uses of each shape.
        lights: number of uses of each light.
        pictured: number of examples whose images were decoded.
        shown: records for the contact sheet, in NumPy.
    """

    columns: dict[str, list[float]] = field(default_factory=dict)
    shapes: collections.Counter[str] = field(default_factory=collections.Counter)
    lights: collections.Counter[str] = field(default_factory=collections.Counter)
    pictured: int = 0
    shown: list[dict] = field(default_factory=list)

    def add(self, row: dict[str, float]) -> None:
        """Append the quantities of an example."""
        for name, value in row.items():
            self.columns.setdefault(name, []).append(value)


def preview(corpus: Path, split: str, on_example: Callable[[int, int], None]) -> list[Path]:
    """Write `preview.png` and `histograms.png` into a split's folder.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        on_example: called with (done, total) as records are read.

    Returns:
        The paths of the two files.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if a record is damaged.
    """
    files = Split(corpus, split)
    gathered = _gather(files, on_example)
    title = f"{Path(corpus).resolve().name}/{split}"
    sheet, chart = files.folder / "preview.png", files.folder / "histograms.png"
    # Names of files may have dollar signs, which Matplotlib would take for formulas.
    with matplotlib.rc_context({"text.parse_math": False}):
        _save(contact_sheet.draw(gathered.shown, files.count, title), sheet)
        histogram = histograms.draw(
            {name: np.array(values) for name, values in gathered.columns.items()},
            {
                "shapes": _uses(gathered.shapes, files.shapes),
                "lights": _uses(gathered.lights, files.lights),
            },
            gathered.pictured,
            title,
        )
        _save(histogram, chart)
    return [sheet, chart]


def _save(figure: Figure, path: Path) -> None:
    with atomic.replacing(path) as partial:
        figure.savefig(partial)


def _gather(split: Split, on_example: Callable[[int, int], None]) -> Gathered:
    """Read a split once: the numbers of every record, and the images of some records."""
    paths, count = split.shard_paths(), split.count
    dataset = tf.data.TFRecordDataset([str(path) for path in paths])
    dataset = dataset.map(
        lambda serialized: (records.parse(serialized, quantities.RECORDED), serialized),
        num_parallel_calls=tf.data.AUTOTUNE,
    )
    shown, pictured = _spread(count, _SHOWN), _spread(count, _PICTURED)
    gathered = Gathered()
    examples = pipeline.naming_damage(dataset.prefetch(tf.data.AUTOTUNE), paths)
    for position, (example, serialized) in enumerate(examples):
        example = _in_numpy(example)
        gathered.shapes[example["shape"].decode()] += 1
        gathered.lights[example["light"].decode()] += 1
        row = quantities.of_record(example)
        if position in shown:
            gathered.shown.append(_in_numpy(records.parse(serialized)))
        if position in pictured:
            pictures = _in_numpy(records.parse(serialized, quantities.PICTURED))
            row |= quantities.of_pictures(pictures)
            gathered.pictured += 1
        gathered.add(row)
        on_example(position + 1, count)
    return gathered


def _uses(counts: collections.Counter[str], manifest_names: list[str]) -> dict[str, int]:
    """Return the number of uses of each name in the manifest, 0 for unused names."""
    return {name: counts[name] for name in manifest_names}


def _spread(count: int, most: int) -> set[int]:
    """Return at most `most` of `count` positions, evenly spaced."""
    return set(np.linspace(0, count - 1, min(count, most)).astype(int).tolist())


def _in_numpy(example: dict[str, tf.Tensor]) -> dict:
    return {name: value.numpy() for name, value in example.items()}
