"""The registry of the systems' parts: a row for each subnetwork, each quantity and each output.

A *quantity* is a value that one subnetwork predicts, such as the mask. Other subnetworks may read
it: each input of a subnetwork's model is named after the quantity that it takes. Subnetworks read
S, M and the reflectance map compressed (`dynamic_range`) and 0 outside the object, and images in
sRGB. An *output* is a value for users, computed from one quantity; its radiance is linear.

To add a subnetwork: `docs/how-to/extending.md`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import keras
from keras import ops

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.baseline import material_net, reflectance_map_net
from lime_keras.networks.blocks import PLAIN_HEAD
from lime_keras.networks.subnetworks import (
    albedo_net,
    exponent_net,
    mirror_net,
    segmentation_net,
    specular_net,
)
from lime_keras.optics.dichromatic import channels
from lime_keras.optics.dynamic_range import compress, expand
from lime_keras.optics.reflectance_map import disc
from lime_keras.optics.shininess import LOG_HIGH, LOG_LOW

MASK_CONTRAST = 1.5
"""Factor by which SegmentationNet's prediction is stretched about one half, before the mask cuts
the object out. The loss, ℓ2 most of all, draws uncertain pixels towards one half, and a mask of 0.9
inside the object would make the estimated albedo too dark (docs/explanation/decisions.md). The
guided filter, where there is one, stretches beside it."""


@dataclass(frozen=True)
class Subnetwork:
    """A row of the registry: one subnetwork.

    Attributes:
        build: function that builds the model for an architecture. The model's inputs are named
            after the quantities that the subnetwork reads, a row of `DERIVED`, or `image`.
        predicts: names of the quantities that it predicts, in the order of the model's outputs.
        part_of: function that says whether a system of an architecture has this subnetwork.
        encoder: whether it predicts numbers of the material (True) or images (False).
        heads: names that the model's last layers with weights may have.
    """

    build: Callable[[Architecture], keras.Model]
    predicts: tuple[str, ...]
    part_of: Callable[[Architecture], bool]
    encoder: bool = False
    heads: tuple[str, ...] = ("head", PLAIN_HEAD)


InputLookup = Callable[[str], Any]
"""Function from the name of a quantity, of a row of `DERIVED`, or `image`, to the value that
subnetworks read (`Wiring.network_input`)."""


@dataclass(frozen=True)
class Quantity:
    """A row of the registry: one quantity, which a subnetwork predicts and others may read.

    Both functions take an `InputLookup` as their second argument and return the quantity in the
    form that other subnetworks read and that outputs are computed from.

    Attributes:
        from_prediction: function of the subnetwork's raw prediction.
        from_truth: function of the ground truth, which is linear if it is radiance.
        plain: function of the raw prediction of a subnetwork with a `PLAIN_HEAD`, in the form that
            `from_prediction` takes.
        channels: number of channels if the quantity is an image; None if it is numbers, which no
            subnetwork reads.
    """

    from_prediction: Callable[[Any, InputLookup], Any] = lambda value, _: value
    from_truth: Callable[[Any, InputLookup], Any] = lambda value, _: value
    plain: Callable[[Any], Any] = lambda raw: raw
    channels: int | None = None


@dataclass(frozen=True)
class OutputRow:
    """A row of the registry: one output, and the quantity that it is computed from.

    Attributes:
        quantity: name of the quantity.
        read: function from the quantity, in the form of `Quantity.from_prediction`, to the output.
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
        ("exponent_bin_probabilities", "albedos"),
        _baseline,
        encoder=True,
        heads=("albedos", "logits"),
    ),
}
"""Row of each subnetwork by name, in the order of `system.build`."""

DERIVED: dict[str, Callable[[InputLookup], Any]] = {
    "masked_image": lambda lookup: lookup("image") * lookup("mask"),
    "dichromatic": lambda lookup: channels(lookup("image"), lookup("mask")),
    "linear_specular_shading": lambda lookup: expand(lookup("specular_shading")),
    "linear_mirror": lambda lookup: expand(lookup("mirror")),
}
"""Function of each value that no subnetwork predicts and all may read, by name."""

QUANTITIES = {
    "mask": Quantity(
        lambda raw, _: ops.clip((raw - 0.5) * MASK_CONTRAST + 0.5, 0.0, 1.0),
        plain=lambda raw: (raw - 0.5) / MASK_CONTRAST + 0.5,
        channels=1,
    ),
    **dict.fromkeys(
        ("specular_shading", "mirror"),
        Quantity(
            lambda raw, lookup: raw * lookup("mask"),
            lambda truth, lookup: compress(truth) * lookup("mask"),
            plain=compress,
            channels=1,
        ),
    ),
    "reflectance_map": Quantity(
        lambda raw, _: raw * disc(raw.shape[1]), lambda truth, _: compress(truth), channels=3
    ),
    "albedos": Quantity(lambda raw, _: ops.clip(raw, 0.0, 1.0)),
    "exponent_bin_probabilities": Quantity(lambda logits, _: ops.softmax(logits)),
    "log_exponent": Quantity(lambda raw, _: ops.clip(raw, LOG_LOW, LOG_HIGH)),
}
"""Row of each quantity by name."""

OUTPUT_ROWS = {
    "mask": OutputRow("mask"),
    "specular_shading": OutputRow("specular_shading", expand),
    "mirror": OutputRow("mirror", expand),
    "reflectance_map": OutputRow("reflectance_map", expand),
    "diffuse_albedo": OutputRow("albedos", lambda albedos: albedos[:, :3]),
    "specular_albedo": OutputRow("albedos", lambda albedos: albedos[:, 3:]),
    "exponent_bin_probabilities": OutputRow("exponent_bin_probabilities"),
    "log_exponent": OutputRow("log_exponent"),
}
"""Row of each output by name; the names are those of `lime_keras.outputs.OUTPUTS`."""


def predicted_quantities(name: str, network: keras.Model) -> tuple[str, ...]:
    """Return the names of the quantities that a subnetwork predicts.

    They are those that its row `predicts`, but `log_exponent` in place of probabilities where a
    network regresses log10 s.

    Args:
        name: name of the subnetwork.
        network: the subnetwork, as its row builds it.
    """
    names = SUBNETWORKS[name].predicts
    if names[0] == "exponent_bin_probabilities" and network.outputs[0].shape[-1] == 1:
        return ("log_exponent", *names[1:])
    return names


def estimate(quantity: str, network: keras.Model, raw: Any, lookup: InputLookup) -> Any:
    """Return a quantity in the form that other subnetworks read, from a raw prediction.

    Args:
        quantity: name of the quantity.
        network: subnetwork that predicted it.
        raw: its prediction.
        lookup: function that returns what subnetworks read.
    """
    row = QUANTITIES[quantity]
    return row.from_prediction(row.plain(raw) if is_plain(network) else raw, lookup)


def is_plain(network: keras.Model) -> bool:
    """Return whether a subnetwork has a `PLAIN_HEAD`: linear radiance, or an unstretched mask."""
    return any(layer.name == PLAIN_HEAD for layer in network.layers)
