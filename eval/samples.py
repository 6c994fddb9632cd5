"""A few images of a corpus: to time with, to compare answers on, to calibrate with.

Those that decide something (calibration and validation) come from the train split, the latter from
the shards that training holds out; the test split is for what is only reported.
"""

from pathlib import Path

import numpy as np

from lime_keras import corpus as corpus_files
from lime_keras import pipeline

from .evaluate import test_shards
from .ledger import DependsOn, Ledger, sha256

LARGEST_BATCH = 32
"""Images of the test split: as many as are answered at once."""
_CALIBRATION, _VALIDATION = 64, 64


class Samples:
    """Images `(N, S, S, 3)` sRGB in [0, 1] of one corpus, float32.

    Args:
        corpus: folder with complete `train` and `test` splits.
        ledger: keeps the test images.
        camera: take photos of the scenes (`lime_keras.camera`), the same every time.
    """

    def __init__(self, corpus: Path, ledger: Ledger, *, camera: bool):
        self.corpus, self.camera = corpus, camera
        self._ledger = ledger

    def depends_on(self, split: str) -> DependsOn:
        """What images of a split follow from, their size apart."""
        manifest = sha256(corpus_files.manifest_path(self.corpus, split))
        return {"corpus": manifest, "camera": self.camera}

    def test(self, size: int) -> Path:
        """`.npy` file of the first images of the test split."""

        def write(path: Path) -> None:
            images = self._first(test_shards(self.corpus), size, LARGEST_BATCH)
            with path.open("wb") as file:
                np.save(file, images)

        key = {**self.depends_on("test"), "size": size, "count": LARGEST_BATCH}
        return self._ledger.file(f"images/{size}.npy", key, write)

    def calibration(self, size: int) -> np.ndarray:
        """Images that the networks were trained on."""
        return self._first(pipeline.training_shards(self.corpus)[0], size, _CALIBRATION)

    def validation(self, size: int) -> np.ndarray:
        """Images that training held out."""
        return self._first(pipeline.training_shards(self.corpus)[1], size, _VALIDATION)

    def _first(self, shards: list[Path], size: int, count: int) -> np.ndarray:
        """The first images of some shards: as many as asked for, or all there are."""
        dataset = pipeline.evaluation(
            shards, size=size, batch_size=count, camera=self.camera, features=("image",)
        )
        batches = pipeline.naming_damage(dataset.take(1).as_numpy_iterator(), shards)
        first = next(batches, None)
        if first is None:
            raise ValueError(f"{shards[0]} and what follows hold no examples: render them again")
        return first["image"]
