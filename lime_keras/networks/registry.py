"""What systems are made of: a row for each subnetwork, quantity and output.

A quantity is what passes between subnetworks, by the name of the input that takes it: images in
sRGB, and S, M and the reflectance map compressed (`dynamic_range`), 0 outside the object.

A further subnetwork is a function in `subnetworks`, its rows here, the names of its outputs in
`lime_keras.outputs`, what it learns by in `train/terms.py` and, so that weights from before it are
still whole, a field of `Architecture`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import keras
from keras import ops

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.baseline import material_net, reflectance_map_net
from lime_keras.networks.subnetworks import (
    albedo_net,
    exponent_net,
    mirror_net,
    segmentation_net,
    specular_net,
)
from lime_keras.optics.dynamic_range import compress, expand
from lime_keras.optics.reflectance_map import disc
from lime_keras.optics.shininess import LOG_HIGH, LOG_LOW

MASK_CONTRAST = 1.5
"""By which SegmentationNet's answer is stretched about one half before it cuts the object out: ℓ2
draws what it is unsure of towards the middle, and a mask of 0.9 inside the object darkens the
albedo that is read through it (docs/decisions.md)."""


@dataclass(frozen=True)
class Subnetwork:
    """A kind of subnetwork.

    Attributes:
        build: makes one. Its model's inputs are called after the quantities that it sees.
        answers: the quantities that it answers, in order.
        part_of: whether a system of an architecture has it.
        encoder: whether it reads a material's numbers from layers; the others answer layers.
        heads: names of its last layers.
    """

    build: Callable[[Architecture], keras.Model]
    answers: tuple[str, ...]
    part_of: Callable[[Architecture], bool]
    encoder: bool = False
    heads: tuple[str, ...] = ("head",)


Seen = Callable[[str], Any]
"""Any quantity as subnetworks see it, by name."""


def _as_it_is(value: Any, seen: Seen) -> Any:
    return value


@dataclass(frozen=True)
class Quantity:
    """Something that a subnetwork answers.

    Attributes:
        estimated: a subnetwork's answer to the quantity as others see it.
        given: the truth, in linear radiance where it is radiance, to the same.
        channels: of an image; None of numbers, which no subnetwork sees.
    """

    estimated: Callable[[Any, Seen], Any] = _as_it_is
    given: Callable[[Any, Seen], Any] = _as_it_is
    channels: int | None = None


@dataclass(frozen=True)
class Reading:
    """How an output is read from a quantity.

    Attributes:
        quantity: its name.
        read: the quantity, as others see it, to the output.
    """

    quantity: str
    read: Callable[[Any], Any] = lambda value: value


def _lime(architecture: Architecture) -> bool:
    return architecture.system == "lime"


def _baseline(architecture: Architecture) -> bool:
    return architecture.system == "reflectance-map"


SUBNETWORKS = {
    "segmentation": Subnetwork(segmentation_net, ("mask",), lambda architecture: True),
    "specular": Subnetwork(specular_net, ("specular_shading",), _lime),
    "mirror": Subnetwork(mirror_net, ("mirror",), lambda one: _lime(one) and one.mirror),
    "exponent": Subnetwork(
        exponent_net,
        ("exponent_bin_probabilities",),
        _lime,
        encoder=True,
        heads=("logits", "log_exponent"),
    ),
    "albedo": Subnetwork(albedo_net, ("albedos",), _lime, encoder=True, heads=("albedos",)),
    "reflectance_map": Subnetwork(reflectance_map_net, ("reflectance_map",), _baseline),
    "material": Subnetwork(
        material_net,
        ("albedos", "exponent_bin_probabilities"),
        _baseline,
        encoder=True,
        heads=("albedos", "logits"),
    ),
}
"""By name, in the order in which systems have them."""

QUANTITIES = {
    "mask": Quantity(
        lambda answer, _: ops.clip((answer - 0.5) * MASK_CONTRAST + 0.5, 0.0, 1.0), channels=1
    ),
    **dict.fromkeys(
        ("specular_shading", "mirror"),
        Quantity(
            lambda answer, seen: answer * seen("mask"),
            lambda truth, seen: compress(truth) * seen("mask"),
            channels=1,
        ),
    ),
    "reflectance_map": Quantity(
        lambda answer, _: answer * disc(answer.shape[1]),
        lambda truth, _: compress(truth),
        channels=3,
    ),
    "albedos": Quantity(lambda answer, _: ops.clip(answer, 0.0, 1.0)),
    "exponent_bin_probabilities": Quantity(),
    "log_exponent": Quantity(lambda answer, _: ops.clip(answer, LOG_LOW, LOG_HIGH)),
}

READINGS = {
    "mask": Reading("mask"),
    "specular_shading": Reading("specular_shading", expand),
    "mirror": Reading("mirror", expand),
    "reflectance_map": Reading("reflectance_map", expand),
    "diffuse_albedo": Reading("albedos", lambda albedos: albedos[:, :3]),
    "specular_albedo": Reading("albedos", lambda albedos: albedos[:, 3:]),
    "exponent_bin_probabilities": Reading("exponent_bin_probabilities"),
    "log_exponent": Reading("log_exponent"),
}
"""Of each of `lime_keras.outputs.OUTPUTS`."""


def answered(name: str, network: keras.Model) -> tuple[str, ...]:
    """Quantities that a subnetwork answers: its row's, or, of ExponentNet by regression, log10 s.

    Args:
        name: of the subnetwork.
        network: as its row builds it.
    """
    if name == "exponent" and network.output_shape[-1] == 1:
        return ("log_exponent",)
    return SUBNETWORKS[name].answers
