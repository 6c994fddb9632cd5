"""Images of a corpus, to calibrate a quantised model and to compare an export with its model.

The camera model (`lime_keras.data.camera`) photographs them, the same way each time. Those for
calibration come from shards that networks are trained on: the test split is only for reported
results.
"""

from pathlib import Path

import numpy as np

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split

_COUNT = 64


def for_calibration(corpus: Path, size: int) -> np.ndarray:
    """Return images that networks were trained on, for the calibration of a quantised model.

    Args:
        corpus: folder with a complete train split.
        size: height and width of the images; a divisor of the stored size.

    Returns:
        Images `(N, size, size, 3)` float32, sRGB in [0, 1]; N is at most 64.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if the images are of another size, there are fewer than two shards, or a shard
            is empty or damaged.
    """
    check_size(Split(corpus, "train"), size)
    shards, _ = pipeline.training_shards(corpus)
    return first(shards, size)


def for_comparison(corpus: Path, size: int) -> np.ndarray:
    """Return images of the test split; arguments, result and errors as of `for_calibration`."""
    split = Split(corpus, "test")
    check_size(split, size)
    return first(pipeline.verified_shards(split), size)


def check_size(split: Split, size: int) -> None:
    """Raise ValueError if the images of a split cannot be reduced to the size that networks see."""
    if split.size % size:
        raise ValueError(
            f"{split.corpus} has images of {split.size} pixels, and these weights see {size}: pass "
            f"a corpus of `lime-render --size {size}`, or of a multiple of it"
        )


def first(shards: list[Path], size: int, count: int = _COUNT) -> np.ndarray:
    """Return the first images of shards, at most `count`."""
    dataset = pipeline.evaluation(
        shards, size=size, batch_size=count, camera=True, features=("image",)
    )
    batches = pipeline.naming_damage(dataset.take(1).as_numpy_iterator(), shards)
    batch = next(batches, None)
    if batch is None:
        raise ValueError(f"{shards[0]} and what follows hold no examples: render them again")
    return batch["image"]
