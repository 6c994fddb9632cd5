"""The preview of a corpus: a contact sheet of some of its examples.

`lime-render preview` writes it beside the shards.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import numpy as np
import tensorflow as tf

from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.io import atomic

from . import contact_sheet

_SHOWN = 24


def preview(corpus: Path, split: str, on_example: Callable[[int, int], None]) -> Path:
    """Write `preview.png` into a split's folder, and return its path.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        on_example: called with (done, total) as records are read.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if a record is damaged.
    """
    files = Split(corpus, split)
    shown = list(_shown(files, on_example))
    title, path = f"{Path(corpus).resolve().name}/{split}", files.folder / "preview.png"
    # Names of files may have dollar signs, which Matplotlib would take for formulas.
    with matplotlib.rc_context({"text.parse_math": False}), atomic.replacing(path) as partial:
        contact_sheet.draw(shown, files.count, title).savefig(partial)
    return path


def _shown(split: Split, on_example: Callable[[int, int], None]) -> Iterator[dict]:
    """Yield the records that the sheet shows, in NumPy, spread evenly over the split."""
    paths, count = split.shard_paths(), split.count
    wanted = _spread(count, _SHOWN)
    dataset = tf.data.TFRecordDataset([str(path) for path in paths])
    parsed = (
        (position, records.parse(serialized) if position in wanted else None)
        for position, serialized in enumerate(dataset)
    )
    for position, example in pipeline.naming_damage(parsed, paths):
        if example is not None:
            yield {name: value.numpy() for name, value in example.items()}
        on_example(position + 1, count)


def _spread(count: int, most: int) -> set[int]:
    """Return at most `most` of `count` positions, evenly spaced."""
    return set(np.linspace(0, count - 1, min(count, most)).astype(int).tolist())
