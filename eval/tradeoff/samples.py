"""A few images of a corpus (see `data.samples`), with their inputs for the store."""

from pathlib import Path

import numpy as np

from lime_keras.data import pipeline, samples
from lime_keras.data.corpus import Split

from ..source_code import code_of
from ..store import DependsOn, Store, sha256

LARGEST_BATCH = 32
"""Number of images taken from the test split: those of the largest batch."""


class Samples:
    """A few images `(N, S, S, 3)` of one corpus, float32 sRGB in [0, 1].

    Args:
        corpus: folder with complete `train` and `test` splits.
        store: store that keeps the test images.
        camera: take photos of the scenes (`lime_keras.data.camera`), the same every time.
    """

    def __init__(self, corpus: Path, store: Store, *, camera: bool):
        self.corpus, self.camera = corpus, camera
        self._store = store

    def depends_on(self, split: str) -> DependsOn:
        """Return the inputs of a split's images, except their size, for the store."""
        manifest = sha256(Split(self.corpus, split).manifest_path)
        return {"corpus": manifest, "camera": self.camera}

    def test(self, size: int) -> Path:
        """Return the `.npy` file of the first images in the test split, `size` pixels wide."""

        def write(path: Path) -> None:
            shards = pipeline.whole_shards(Split(self.corpus, "test"))
            images = samples.first(shards, size, LARGEST_BATCH, camera=self.camera)
            with path.open("wb") as file:
                np.save(file, images)

        key = {**self.depends_on("test"), "size": size, "count": LARGEST_BATCH}
        return self._store.file(f"images/{size}.npy", key, write, code=code_of(__name__))

    def calibration(self, size: int) -> np.ndarray:
        """Read images that the networks were trained on, to calibrate quantisation."""
        return samples.calibration(self.corpus, size, camera=self.camera)
