"""The outputs of the systems and the estimates that users may ask for, by name.

This module imports no other of the package, so that a command's `--help` lists the names at once.
"""

from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True)
class Output:
    """The description of one output of an assembled system.

    Attributes:
        unit: unit and range of the output's numbers, in words.
        layer: for an image, whether its pixels are those of the `photo` or of a `sphere`; None if
            the output is no image.
        levels: values that are black and white in a picture of the layer; None for linear radiance,
            which has no upper limit.
    """

    unit: str
    layer: str | None = None
    levels: tuple[float, float] | None = None


OUTPUTS = {
    "mask": Output("share of the pixel that the object covers, in [0, 1]", "photo", (0.0, 1.0)),
    "specular_shading": Output("linear radiance, 0 outside the mask", "photo"),
    "mirror": Output("linear radiance, 0 outside the mask", "photo"),
    "reflectance_map": Output("linear RGB radiance over the disc of a sphere's normals", "sphere"),
    "diffuse_albedo": Output("linear RGB reflectance in [0, 1]"),
    "specular_albedo": Output("linear reflectance in [0, 1]"),
    "exponent_bin_probabilities": Output("probability of each bin of the exponent; they sum to 1"),
    "log_exponent": Output("log10 of the Blinn-Phong exponent, in [0, 3]"),
}
"""All outputs by name, in the order in which a system gives them. No system has every output."""

NEEDED = {
    "mask": ("mask",),
    "specular": ("mask", "specular_shading"),
    "mirror": ("mask", "mirror"),
    "albedo": ("mask", "diffuse_albedo", "specular_albedo"),
    "exponent": ("mask", "exponent_bin_probabilities"),
    "diffuse": ("mask", "specular_shading", "diffuse_albedo", "specular_albedo"),
    "reflectance_map": ("mask", "reflectance_map"),
}
"""The estimates that can be asked for, by name, and the outputs that each of them needs.

In a system that regresses the exponent, `exponent` needs `log_exponent` instead of the
probabilities. No system has every output, so none can give every estimate.
"""
OF_A_FRAME = ("mask", "albedo", "exponent")
"""What is estimated of a frame by default: a video's table and overlay show it, and no layers."""


def available(outputs: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return the estimates that a system can give, by name, with the outputs that each needs.

    Args:
        outputs: names of all outputs that the system has.

    Returns:
        The part of `NEEDED` that these outputs can give; `exponent` needs `log_exponent` if the
        system regresses the exponent.
    """
    regression = {"exponent": ("mask", "log_exponent")} if "log_exponent" in outputs else {}
    needed = NEEDED | regression
    return {name: parts for name, parts in needed.items() if set(parts) <= set(outputs)}
