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


def pictures(corpus: Path, split_name: str, size: int) -> np.ndarray:
    """Return the first images of a split; of `train`, of those shards that are trained on.

    Args:
        corpus: folder with the complete split.
        split_name: `train` to calibrate a quantised model, `test` to compare.
        size: height and width of the images; a divisor of the stored size.

    Returns:
        Images `(N, size, size, 3)` float32, sRGB in [0, 1]; N is at most 64.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if the images are of another size, there are fewer than two shards to train on,
            or a shard is empty or damaged.
    """
    split = Split(corpus, split_name)
    split.check_size(size)
    is_train = split_name == "train"
    shards = pipeline.training_shards(corpus)[0] if is_train else pipeline.verified_shards(split)
    dataset = pipeline.evaluation(
        shards, size=size, batch_size=_COUNT, camera=True, features=("image",)
    )
    batches = pipeline.naming_damage(dataset.take(1).as_numpy_iterator(), shards)
    batch = next(batches, None)
    if batch is None:
        raise ValueError(f"{shards[0]} and what follows hold no examples: render them again")
    return batch["image"]
