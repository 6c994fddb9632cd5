"""A few images of a corpus: to calibrate with, to judge by, to compare answers on.

Those that decide something (calibration and validation) come from the train split, the latter from
the shards that training holds out; the test split is for what is only reported.
"""

from pathlib import Path

import numpy as np

from lime_keras.data import pipeline

_CALIBRATION, _VALIDATION = 64, 64


def calibration(corpus: Path, size: int, *, camera: bool) -> np.ndarray:
    """Images that networks were trained on, `(N, size, size, 3)` sRGB in [0, 1], float32.

    Args:
        corpus: folder with a complete train split.
        size: a divisor of the stored size.
        camera: take photos of the scenes (`lime_keras.data.camera`), the same every time.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if there is nothing to read, or it is damaged.
    """
    shards, _ = pipeline.training_shards(corpus)
    return first(shards, size, _CALIBRATION, camera=camera)


def validation(corpus: Path, size: int, *, camera: bool) -> np.ndarray:
    """As `calibration`, of those that training held out."""
    _, shards = pipeline.training_shards(corpus)
    return first(shards, size, _VALIDATION, camera=camera)


def first(shards: list[Path], size: int, count: int, *, camera: bool) -> np.ndarray:
    """As `calibration`, the first images of some shards: as many as asked for, or all there are."""
    dataset = pipeline.evaluation(
        shards, size=size, batch_size=count, camera=camera, features=("image",)
    )
    batches = pipeline.naming_damage(dataset.take(1).as_numpy_iterator(), shards)
    batch = next(batches, None)
    if batch is None:
        raise ValueError(f"{shards[0]} and what follows hold no examples: render them again")
    return batch["image"]
