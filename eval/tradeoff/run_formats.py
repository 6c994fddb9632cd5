"""The formats of a trained run: its files for every runtime and precision."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import keras
import onnx.utils

from lime_keras.arrays import Predict
from lime_keras.export import exporter, formats, quantisation
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import assemble, output_names
from lime_keras.networks.precision import POLICIES, computing_in
from lime_keras.outputs import available

from ..source_code import code_of
from ..store import DependsOn, Store, sha256, size
from . import runtimes
from .costs import flop
from .runtimes import KERAS, ONNX, SAVED_MODEL
from .samples import Samples

PRECISIONS = {
    KERAS: tuple(POLICIES),
    SAVED_MODEL: tuple(POLICIES),
    # ONNX Runtime has no bfloat16 convolution on processors.
    ONNX: exporter.PRECISIONS[exporter.ONNX],
}
"""Precisions of each runtime."""
EVERYTHING = "everything"


class Run:
    """A trained run and its files, each of which is made when it is first needed, and kept.

    Args:
        name: name of the run in file names and tables.
        folder: run of `lime-train`, or folder of `lime_keras.model.weights.save`.
        samples: images of the corpus that the run was trained on.
        store: store that keeps the files.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
    """

    def __init__(self, name: str, folder: Path, samples: Samples, store: Store):
        self.name, self.folder, self.samples = name, folder, samples
        self._store = store
        self._files = model_folder.files(folder)

    @functools.cached_property
    def depends_on(self) -> DependsOn:
        """The inputs of the float32 files, for the store."""
        return {"weights": sha256(*self._files)}

    @functools.cached_property
    def costs(self) -> Mapping[str, Any]:
        """The costs of the run, as JSON.

        They are `architecture`, its `description`, and by name the `subnetworks` and the `parts`,
        each with its `parameters` and its `gflop` for one image. A part is a choice of
        `lime-estimate --only`, or `everything`; it also has the `outputs` that it needs.
        """
        return self._store.value(
            f"costs/{self.name}", self.depends_on, self._count_costs, code=code_of(__name__)
        )

    @property
    def image_size(self) -> int:
        """The height and width of the images that the run takes."""
        return self.costs["architecture"]["size"]

    def path(self, runtime: str, precision: str) -> Path:
        """Return the path of the model for a runtime and precision; write the files if missing.

        Args:
            runtime: name of the runtime (see `runtimes`).
            precision: name of one of its `PRECISIONS`.
        """
        if runtime == KERAS:
            return self.folder
        if runtime == SAVED_MODEL:
            write = functools.partial(self._write_saved_model, precision)
            return self._file(f"{precision}-saved-model", write)
        if precision == "float32":
            return self._file("float32.onnx", self._write_onnx)
        prepared = self._file(
            "prepared.onnx", lambda path: quantisation.prepare(self.path(ONNX, "float32"), path)
        )
        if precision == "float16":
            write_float16 = functools.partial(quantisation.write_float16, prepared)
            return self._file("float16.onnx", write_float16)
        calibrated = {**self.depends_on, "calibration": self.samples.depends_on("train")}
        write_int8 = functools.partial(self._write_int8, prepared)
        return self._file("int8.onnx", write_int8, calibrated)

    def file_size(self, runtime: str, precision: str) -> int:
        """Return the number of bytes in the files that a runtime needs."""
        if runtime == KERAS:
            return sum(map(size, self._files))
        return size(self.path(runtime, precision))

    def part(self, name: str) -> Path:
        """Return the ONNX file of a part (see `costs["parts"]`), cut out of the whole system."""
        whole = self.path(ONNX, "float32")
        outputs = self.costs["parts"][name]["outputs"]

        def write(path: Path) -> None:
            onnx.utils.extract_model(str(whole), str(path), ["image"], outputs)

        return self._file(f"only-{name}.onnx", write)

    def subnetwork(self, name: str) -> Path:
        """Return the ONNX file of one subnetwork alone, with its inputs left open."""
        return self._file(
            f"subnetwork-{name}.onnx",
            lambda path: formats.write_onnx(self._subnetworks[name], path),
        )

    def answer(self, runtime: str, precision: str) -> Predict:
        """Load the model into this process; return the function that runs it on images."""
        return runtimes.open_answer(runtime, self.path(runtime, precision), precision)

    @functools.cached_property
    def _subnetworks(self) -> dict[str, keras.Model]:
        return weights.load(self.folder)[1]

    def _count_costs(self) -> dict[str, Any]:
        architecture, subnetworks = weights.load(self.folder)
        parts = available(output_names(subnetworks)) | {EVERYTHING: output_names(subnetworks)}
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
        return self._store.file(
            f"models/{self.name}-{name}",
            depends_on or self.depends_on,
            write,
            code=code_of(__name__),
        )

    def _write_saved_model(self, precision: str, path: Path) -> None:
        with computing_in(precision):
            _, subnetworks = weights.load(self.folder)
        formats.write_saved_model(assemble(subnetworks), path)

    def _write_onnx(self, path: Path) -> None:
        formats.write_onnx(assemble(self._subnetworks), path)

    def _write_int8(self, prepared: Path, path: Path) -> None:
        pictures = self.samples.calibration(self.image_size)
        quantisation.write_int8(prepared, path, [{"image": one[None]} for one in pictures])


def _costs(network: keras.Model) -> dict[str, float]:
    return {"parameters": network.count_params(), "gflop": 1e-9 * flop(network)}
