"""The scenes of a corpus, one by one, as benchmarks estimate them."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from tqdm import tqdm

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split


def scenes(
    corpus: Path, split: str, *, count: int | None = None, size: int | None = None, **options: Any
) -> Iterator[dict[str, np.ndarray]]:
    """Yield the first records of a split behind a progress bar, each without a batch axis.

    Args:
        corpus: folder of the corpus.
        split: `train` or `test`; its shards are checked against its manifest.
        count: how many; by default all.
        size: height and width of the images; by default as they are stored.
        options: `camera` and `features` of `pipeline.evaluation`.
    """
    of = Split(corpus, split)
    shards = pipeline.verified_shards(of)
    records = pipeline.evaluation(shards, size=size or of.size, batch_size=1, **options)
    some = records if count is None else records.take(count)
    for record in tqdm(some.as_numpy_iterator(), total=count, unit="scene"):
        yield {name: values[0] for name, values in record.items()}


def levels(image_srgb: np.ndarray) -> np.ndarray:
    """Return sRGB in [0, 1] as an 8-bit file holds it."""
    return np.rint(255 * image_srgb).astype(np.uint8)


def jpeg(levels: np.ndarray, quality: int) -> np.ndarray:
    """Return 8-bit levels `(H, W, 3)` after JPEG of a quality."""
    file = io.BytesIO()
    Image.fromarray(levels).save(file, "JPEG", quality=quality)
    return np.asarray(Image.open(file))
