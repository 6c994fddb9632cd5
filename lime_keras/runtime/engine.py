"""The interface of what runs a model's networks on images, and how a model's folder is loaded."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from lime_keras.model.folder import ENGINES, PRECISIONS

Arrays = Mapping[str, np.ndarray]  # images or numbers by name


class Answering(Protocol):
    """A model in one file or folder that computes the outputs that are asked for.

    Attributes:
        outputs: names of the outputs that the model has, out of `outputs.OUTPUTS`.
    """

    outputs: tuple[str, ...]

    def run(self, outputs: Collection[str], inputs: Arrays) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch.

        Args:
            outputs: names out of `self.outputs`.
            inputs: `image` `(B, S, S, 3)` float32, sRGB in [0, 1]; and `mask` `(B, S, S, 1)`
                float32 in [0, 1], unless SegmentationNet finds the object.

        Raises:
            ValueError: if the model's files are damaged.
            MemoryError: if memory is used up.
            RuntimeError: if TensorFlow is run in a forked child (`console.check_fork`).
        """


class Engine(Answering, Protocol):
    """A loaded model of subnetworks.

    Attributes:
        size: height and width of the images in pixels.
        system: name of the system in words, such as `LIME without MirrorNet`.
    """

    size: int
    system: str

    def subnetworks(self, outputs: Iterable[str], inputs: Collection[str]) -> tuple[str, ...]:
        """Return the names of the subnetworks that outputs need, each after those it reads.

        Args:
            outputs: names out of `self.outputs`.
            inputs: names of what `run` is to get: `image`, or `image` and `mask`.
        """


def load(
    run: Path, engine: str = ENGINES[0], *, precision: str = PRECISIONS[0], streaming: bool = False
) -> Engine:
    """Load a trained model.

    Args:
        run: run of `lime-train`, or folder of `lime_keras.model.weights.save`.
        engine: `onnx` for the model's graphs in ONNX Runtime, or `keras`.
        precision: precision of the graphs, out of `folder.PRECISIONS`.
        streaming: whether ONNX Runtime keeps the memory of a run for the next one, which makes
            small batches faster.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, its graphs are missing or of other weights, or
            there is no such engine or precision.
        console.MissingExtra: if the engine needs packages that are not installed.
    """
    for kind, name, known in (("engine", engine, ENGINES), ("precision", precision, PRECISIONS)):
        if name not in known:
            raise ValueError(f"no {kind} {name!r}: choose from {', '.join(known)}")
    # Each engine imports what it runs on, which is large.
    if engine == "keras":
        if precision != "float32":
            raise ValueError(f"Keras computes in float32, not in {precision}: leave one out")
        from lime_keras.runtime.keras_engine import KerasEngine

        return KerasEngine(run)
    from lime_keras.runtime import onnx_graphs

    return onnx_graphs.load(run, precision, streaming=streaming)
