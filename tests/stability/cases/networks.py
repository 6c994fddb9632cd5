"""Cases of whole systems that are small and have fresh weights."""

import dataclasses
import functools
import tempfile
from collections.abc import Callable
from pathlib import Path

import keras
import numpy as np

from lime_keras.estimate.estimator import Estimator
from lime_keras.eval.stability import suite
from lime_keras.eval.stability.precisions import BRAIN, EXPORTED, HALF, SINGLE, XLA
from lime_keras.eval.stability.systems import TrialSystem
from lime_keras.eval.stability.verdicts import Case, Outcome
from lime_keras.model import weights
from lime_keras.networks import Architecture, build

from ..refusals import refusal

_SMALL = Architecture(size=32, unet_width=4, unet_depth=1, encoder_width=4, dense_width=8)
FRESH = {
    "LIME": _SMALL,
    "baseline": dataclasses.replace(_SMALL, system="reflectance-map"),
    "LIME with the split": dataclasses.replace(_SMALL, pretrained=True, dichromatic=True),
}
"""Architectures small enough to be tried in seconds, by name."""

# Biases that keep mask, shading and albedos inside their range; else all later outputs would be 0.
_HEADS = {"segmentation": 0.6, "specular": 0.5, "mirror": 0.5, "reflectance_map": 0.5}
_UNSOUND: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "a NaN pixel": lambda image: _with_pixel(image, np.nan),
    "an infinite pixel": lambda image: _with_pixel(image, np.inf),
    "a pixel of -0.1": lambda image: _with_pixel(image, -0.1),
    "levels up to 255": lambda image: 255 * image,
    "no colours": lambda image: image[..., 0],
    "an alpha channel": lambda image: np.concatenate([image, image[..., :1]], axis=-1),
    "no pixels": lambda image: image[:0],
}


class FreshSystem(TrialSystem):
    """A system of an architecture, with weights of a fixed seed; it is built when first needed."""

    def __init__(self, architecture: Architecture):
        self._architecture = architecture

    @functools.cached_property
    def folder(self) -> Path:
        """The folder of the weights, which is deleted with this object."""
        self._kept = tempfile.TemporaryDirectory(prefix="lime-stability-")
        folder = Path(self._kept.name) / "model"
        weights.save(folder, self._architecture, _drawn(self._architecture))
        return folder


def cases() -> list[Case]:
    """Return the cases of the systems of `FRESH`, and of photos that they refuse."""
    systems = {f"fresh {name}": FreshSystem(one) for name, one in FRESH.items()}
    out = []
    for part, system in systems.items():
        # The baseline has the same kinds of layers, so compiling and exporting one is enough.
        more = (XLA, *EXPORTED) if part == "fresh LIME" else ()
        out += suite.cases_of(part, system, (SINGLE, HALF, BRAIN, *more))
        for name, spoil in _UNSOUND.items():
            measure = functools.partial(_refused, system, spoil)
            out.append(Case(part, f"{name}, refused", SINGLE.name, measure))
    return out


def _refused(system: TrialSystem, spoil: Callable[[np.ndarray], np.ndarray]) -> Outcome:
    photo = spoil(system.images["in steps of 16 bits"])
    return refusal(lambda: _estimator(system).estimate(photo), "photo")


@functools.cache
def _estimator(system: TrialSystem) -> Estimator:
    return Estimator(system.folder, engine="keras")


def _with_pixel(image: np.ndarray, value: float) -> np.ndarray:
    out = image.copy()
    out[1, 2, 0] = value
    return out


def _drawn(architecture: Architecture) -> dict[str, keras.Model]:
    """Build subnetworks with weights of a fixed seed, and with biases that keep outputs above 0."""
    subnetworks = build(architecture, seed=0)
    for name, network in subnetworks.items():
        if name in _HEADS:
            bias = network.get_layer("head").bias
            bias.assign(np.full(bias.shape, _HEADS[name]))
        elif name in ("albedo", "material"):
            network.get_layer("albedos").bias.assign([0.5] * 4)
    return subnetworks
