"""A trained run in every runtime and precision: which there are, and their files."""

import dataclasses
import functools
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
import onnx.utils

from lime_keras.arrays import Answer
from lime_keras.estimate import estimator
from lime_keras.export import formats, quantisation
from lime_keras.networks import answers, assemble, weights
from lime_keras.networks.precision import POLICIES, computing_in

from ..store import DependsOn, Store, sha256, size
from . import runtimes
from .costs import flop
from .runtimes import KERAS, ONNX, SAVED_MODEL
from .samples import Samples

INT8 = {"int8": False, "int8, float heads": True}
"""Eight-bit precisions, and whether the subnetworks' last layers are left out."""
PRECISIONS = {
    KERAS: tuple(POLICIES),
    SAVED_MODEL: tuple(POLICIES),
    # ONNX Runtime has no bfloat16 convolution on processors.
    ONNX: ("float32", "float16", *INT8),
}
"""What each runtime has."""
EVERYTHING = "everything"


class Run:
    """One trained run; each of its files is made when first asked for, and kept.

    Args:
        name: in file names and tables.
        folder: run of `lime-train`, or folder of `lime_keras.networks.weights.save`.
        samples: images of the corpus that it was trained on.
        store: keeps the files.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
    """

    def __init__(self, name: str, folder: Path, samples: Samples, store: Store):
        self.name, self.folder, self.samples = name, folder, samples
        self._store = store
        self._files = weights.files(folder)

    @functools.cached_property
    def depends_on(self) -> DependsOn:
        """What the float32 files follow from."""
        return {"weights": sha256(*self._files)}

    @functools.cached_property
    def costs(self) -> Mapping[str, Any]:
        """What it takes, as JSON.

        `architecture`, its `description`, and by name each of `subnetworks` and of `parts` (what
        `lime-estimate --only` asks for, with the `outputs` that it takes, and `everything`) with
        its `parameters` and `gflop` for one image.
        """
        return self._store.value(f"costs/{self.name}", self.depends_on, self._count_costs)

    @property
    def image_size(self) -> int:
        """Height and width of its images."""
        return self.costs["architecture"]["size"]

    def path(self, runtime: str, precision: str) -> Path:
        """The model's files for a runtime, in one of its `PRECISIONS`."""
        if runtime == KERAS:
            return self.folder
        if runtime == SAVED_MODEL:
            write = functools.partial(self._write_saved_model, precision)
            return self._file(f"{precision}-saved-model", write)
        if precision == "float32":
            return self._file("float32.onnx", self._write_onnx)
        prepared = self._file("prepared.onnx", self._write_prepared)
        if precision == "float16":
            write_float16 = functools.partial(quantisation.write_float16, prepared)
            return self._file("float16.onnx", write_float16)
        return self._int8(prepared, precision)

    def file_size(self, runtime: str, precision: str) -> int:
        """Bytes of the files that a runtime needs."""
        if runtime == KERAS:
            # Beside them may lie subnetworks as their own stages left them, for the oracle.
            shipped = [path for path in self._files if path.parent == self._files[0].parent]
            return sum(map(size, shipped))
        return size(self.path(runtime, precision))

    def part(self, name: str) -> Path:
        """ONNX of the subnetworks that one of `costs["parts"]` takes, cut out of the whole."""
        whole = self.path(ONNX, "float32")
        outputs = self.costs["parts"][name]["outputs"]

        def write(path: Path) -> None:
            onnx.utils.extract_model(str(whole), str(path), ["image"], outputs)

        return self._file(f"only-{name}.onnx", write)

    def subnetwork(self, name: str) -> Path:
        """ONNX of one subnetwork alone, fed by nobody."""
        return self._file(
            f"subnetwork-{name}.onnx",
            lambda path: formats.write_onnx(self._subnetworks[name], path),
        )

    def answer(self, runtime: str, precision: str) -> Answer:
        """The model, loaded into this process."""
        return runtimes.open_answer(runtime, self.path(runtime, precision), precision)

    @functools.cached_property
    def int8_harm(self) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
        """What eight bits do on validation images: `quantisation.harm` by precision and range."""
        prepared = self._file("prepared.onnx", self._write_prepared)
        key = self._calibrated()
        return self._store.value(f"int8/{self.name}", key, lambda: self._judge_int8(prepared))

    def best_ranges(self, precision: str) -> str:
        """The ranges, out of `quantisation.RANGES`, that do the least harm on average."""
        harm = self.int8_harm[precision]
        return min(harm, key=lambda ranges: _mean(harm[ranges]))

    @property
    def best_int8(self) -> str:
        """The eight-bit precision that does the least harm on validation images."""
        harm = self.int8_harm
        return min(harm, key=lambda name: _mean(harm[name][self.best_ranges(name)]))

    @functools.cached_property
    def _subnetworks(self) -> dict[str, keras.Model]:
        return weights.load(self.folder)[1]

    def _count_costs(self) -> dict[str, Any]:
        architecture, subnetworks = weights.load(self.folder)
        parts = estimator.available(subnetworks) | {EVERYTHING: answers(subnetworks)}
        joined = {name: assemble(subnetworks, outputs) for name, outputs in parts.items()}
        return {
            "architecture": dataclasses.asdict(architecture),
            "description": architecture.description,
            "subnetworks": {name: _costs(network) for name, network in subnetworks.items()},
            "parts": {
                name: _costs(network) | {"outputs": list(parts[name])}
                for name, network in joined.items()
            },
        }

    def _file(
        self, name: str, write: Callable[[Path], None], depends_on: DependsOn | None = None
    ) -> Path:
        return self._store.file(f"models/{self.name}-{name}", depends_on or self.depends_on, write)

    def _write_saved_model(self, precision: str, path: Path) -> None:
        with computing_in(precision):
            _, subnetworks = weights.load(self.folder)
        formats.write_saved_model(assemble(subnetworks), path)

    def _write_onnx(self, path: Path) -> None:
        formats.write_onnx(assemble(self._subnetworks), path)

    def _write_prepared(self, path: Path) -> None:
        quantisation.prepare(self.path(ONNX, "float32"), path)

    def _int8(self, prepared: Path, precision: str) -> Path:
        ranges = self.best_ranges(precision)

        def write(path: Path) -> None:
            images = self.samples.calibration(self.image_size)
            quantisation.write_int8(
                prepared, path, images, ranges=ranges, float_heads=INT8[precision]
            )

        slug = precision.replace(", ", "-").replace(" ", "-")
        return self._file(f"{slug}.onnx", write, self._calibrated(ranges=ranges))

    def _calibrated(self, **more: str) -> DependsOn:
        return {**self.depends_on, "calibration": self.samples.depends_on("train"), **more}

    def _judge_int8(self, prepared: Path) -> dict[str, dict[str, dict[str, float]]]:
        """Every eight-bit precision with every range against float32, on validation images."""
        calibration = self.samples.calibration(self.image_size)
        validation = self.samples.validation(self.image_size)
        expected = _answers(self.answer(ONNX, "float32"), validation)

        def judged(ranges: str, float_heads: bool) -> dict[str, float]:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "int8.onnx"
                quantisation.write_int8(
                    prepared, path, calibration, ranges=ranges, float_heads=float_heads
                )
                answer = runtimes.open_answer(ONNX, path, "int8")
                return quantisation.harm(expected, _answers(answer, validation))

        return {
            precision: {ranges: judged(ranges, float_heads) for ranges in quantisation.RANGES}
            for precision, float_heads in INT8.items()
        }


def _answers(answer: Answer, images: np.ndarray) -> dict[str, np.ndarray]:
    """Answers to images one at a time, so that memory is one image's."""
    each = [answer(image[None]) for image in images]
    return {name: np.concatenate([one[name] for one in each]) for name in each[0]}


def _costs(network: keras.Model) -> dict[str, float]:
    return {"parameters": network.count_params(), "gflop": 1e-9 * flop(network)}


def _mean(harm: Mapping[str, float]) -> float:
    return float(np.mean(list(harm.values())))
