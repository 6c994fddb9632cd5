"""Public networks of known size, as yardsticks for the times of a run.

No published network for this task is available: the paper's authors released neither code nor
weights. MobileNetV2 and ResNet50 are part of Keras. With random weights they take as long as with
trained ones.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras

from lime_keras.export import formats

from ..store import Store
from .costs import flop

NETWORKS: dict[str, Callable[..., keras.Model]] = {
    "MobileNetV2": keras.applications.MobileNetV2,
    "ResNet50": keras.applications.ResNet50,
}
"""Constructors by name of classifiers from images `(B, S, S, 3)` to 1,000 classes."""


class Yardstick:
    """A network of `NETWORKS` for images of one size, exported in the same way as a run.

    Args:
        name: name of the network.
        image_size: height and width of its images; 32 or more.
        store: store that keeps its files.
    """

    def __init__(self, name: str, image_size: int, store: Store):
        self.name, self.image_size = name, image_size
        self._store = store
        self.depends_on = {"network": name, "size": image_size}

    @property
    def costs(self) -> dict[str, Any]:
        """The number of `parameters`, and the `gflop` for one image."""

        def count() -> dict[str, Any]:
            network = self._build()
            return {"parameters": network.count_params(), "gflop": 1e-9 * flop(network)}

        return self._store.value(f"costs/{self._slug}", self.depends_on, count)

    @property
    def path(self) -> Path:
        """The ONNX file of the network in float32."""
        return self._store.file(
            f"models/{self._slug}.onnx",
            self.depends_on,
            lambda path: formats.write_onnx(self._build(), path),
        )

    @property
    def _slug(self) -> str:
        return f"yardstick-{self.name}-{self.image_size}"

    def _build(self) -> keras.Model:
        shape = (self.image_size, self.image_size, 3)
        return NETWORKS[self.name](weights=None, input_shape=shape)
