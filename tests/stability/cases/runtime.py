"""Cases for ONNX Runtime: the estimator's graphs, half precision, given masks, odd photos.

Outputs are compared with `double_precision`, as in `networks`.
"""

import functools
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.estimate.estimator import Estimator
from lime_keras.eval.stability.systems import BATCH, Answers, TrialSystem, extreme_photos
from lime_keras.eval.stability.verdicts import Case, Compared, Outcome, joined
from lime_keras.export import exporter
from lime_keras.runtime import engine as runtime
from lime_keras.runtime import onnx_graphs
from lime_keras.runtime.engine import Engine

from ..precisions import HALF, SINGLE
from .networks import FRESH, FreshSystem

_ENGINE, _HALF = "ONNX Runtime", "ONNX float16"
_PHOTOS = {
    f"{height} × {width} pixels": (height, width)
    for height, width in ((1, 1), (1, 64), (64, 1), (2, 3), (31, 17), (200, 3))
}
_LEVELS = {"black": 0.0, "grey": 0.5, "white": 1.0}


def cases() -> list[Case]:
    """Return the cases of the runtime engine."""
    system = FreshSystem(FRESH["LIME"])
    out = []

    def add(part: str, name: str, precision: str, measure: Any, *arguments: Any) -> None:
        out.append(Case(part, name, precision, functools.partial(measure, system, *arguments)))

    for image in extreme_photos(2):
        for streaming in (False, True):
            name = f"{image}{', streaming' * streaming}"
            add("runtime", name, _ENGINE, _alone, image, streaming)
        add("runtime", f"{image}, in a batch of {BATCH}", _ENGINE, _batched, image)
        add("runtime", f"{image}, half precision", _HALF, _halved, image)
        for mask in ("empty", "one-pixel", "faint", "full"):
            add("runtime", f"{image}, {mask} mask given", _ENGINE, _given, image, mask)
        add("runtime", f"{image}, outputs one by one", _ENGINE, _apart, image)
    for name, shape in _PHOTOS.items():
        for level in _LEVELS:
            add("runtime", f"{level}, {name}", _ENGINE, _estimated, shape, _LEVELS[level], None)
            for mask in ("one-pixel", "full"):
                case = f"{level}, {name}, {mask} mask given"
                add("runtime", case, _ENGINE, _estimated, shape, _LEVELS[level], mask)
    return out


@functools.cache
def _run(system: TrialSystem) -> Path:
    """Write the system's graphs beside its weights, and return the folder of both."""
    run = system.folder.parent
    exporter.export(run, exporter.GRAPHS, system.folder)
    return run


@functools.cache
def _engine(system: TrialSystem, streaming: bool) -> Engine:
    return runtime.load(_run(system), streaming=streaming)


@functools.cache
def _estimator(system: TrialSystem) -> Estimator:
    return Estimator(_run(system))


@functools.cache
def _narrow(system: TrialSystem) -> Answers:
    """Return the outputs of the float16 graph for all images, by name."""
    folder = system.folder.parent / "narrow"
    folder.mkdir()
    exporter.export(folder, exporter.ONNX, system.folder, precision="float16")
    engine = onnx_graphs.open_file(exporter.target(folder, exporter.ONNX, "float16"))
    images = np.stack(list(system.images.values()))
    return _double(engine.run(engine.outputs, {"image": images}))


@functools.cache
def _every(system: TrialSystem) -> Answers:
    engine = _engine(system, False)
    return _double(engine.run(engine.outputs, {"image": system.batch[1]}))


def _alone(system: TrialSystem, image: str, streaming: bool) -> Outcome:
    engine = _engine(system, streaming)
    found = engine.run(engine.outputs, {"image": system.images[image][None]})
    return Outcome(system.compared(image, _double(found), SINGLE.epsilon))


def _batched(system: TrialSystem, image: str) -> Outcome:
    """Try an image in a batch whose last image is NaN; no other may change an output."""
    position = system.batch[0].index(image)
    found = {name: x[position : position + 1] for name, x in _every(system).items()}
    return Outcome(system.compared(image, found, SINGLE.epsilon))


def _halved(system: TrialSystem, image: str) -> Outcome:
    position = list(system.images).index(image)
    found = {name: x[position : position + 1] for name, x in _narrow(system).items()}
    return Outcome(system.compared(image, found, HALF.epsilon))


def _apart(system: TrialSystem, image: str) -> Outcome:
    """Try each output alone: where fewer graphs run, its bits must be the same."""
    engine = _engine(system, False)
    given = {"image": system.images[image][None]}
    together = engine.run(engine.outputs, given)
    return Outcome(
        joined(
            Compared(
                np.asarray(engine.run([name], given)[name], np.float64),
                np.asarray(right, np.float64),
                right,
                0.0,
            )
            for name, right in together.items()
        )
    )


def _given(system: TrialSystem, image: str, mask: str) -> Outcome:
    """Try a mask: outside it S and M are exactly 0, and everything is finite and in range."""
    engine = _engine(system, False)
    size = engine.size
    coverage = _mask(mask, size, size)[None]
    outputs = [name for name in engine.outputs if name != "mask"]
    found = engine.run(outputs, {"image": system.images[image][None], "mask": coverage})
    parts = []
    for values in _double(found).values():
        most = 59874.0 * (coverage > 0) if values.ndim == 4 else 1.0
        parts.append(Compared(values, 0.0, most, 0.0))
    total = found["exponent_bin_probabilities"].sum()
    parts.append(SINGLE.compare(np.asarray(total, np.float64), 1.0, 1.0, 1.0, terms=8))
    return Outcome(joined(parts))


def _estimated(
    system: TrialSystem, shape: tuple[int, int], level: float, mask: str | None
) -> Outcome:
    """Try a photo of any shape: all that is estimated is finite, in range, and of its size."""
    photo = np.full((*shape, 3), level, np.float32)
    given = None if mask is None else _mask(mask, *shape)
    material = _estimator(system).estimate(photo, given)
    parts = [Compared(np.array(material.mask_coverage), 0.0, 1.0, 0.0)]
    for name, layer in material.layers.items():
        values = np.asarray(layer, np.float64)
        if values.shape[:2] != shape:
            raise ValueError(f"{name} is {values.shape}, and the photo {shape}")
        highest = 1.0 if name in ("mask", "diffuse") else 59874.0
        parts.append(Compared(values, 0.0, highest, 1e-6))
    if material.mask_coverage:
        parts.append(Compared(np.array(material.exponent), 1.0, 1000.0, 1e-3))
        for albedo in (material.diffuse_albedo, material.specular_albedo):
            parts.append(Compared(np.asarray(np.array(albedo), np.float64), 0.0, 1.0, 0.0))
    return Outcome(joined(parts))


def _mask(name: str, height: int, width: int) -> np.ndarray:
    """Return a mask `(H, W, 1)` float32."""
    out = np.full((height, width, 1), float(name == "full"), np.float32)
    if name == "faint":
        out[:] = 1 / 255
    if name == "one-pixel":
        out[height // 2, width // 2] = 1.0
    return out


def _double(found: Any) -> Answers:
    return {name: np.asarray(values, np.float64) for name, values in found.items()}
