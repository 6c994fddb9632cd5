"""What systems answer, and what users may ask for: their names, and what there is to know of each.

Imports no other module, so that a command's `--help` may list the names.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Output:
    """Something that an assembled system answers.

    Attributes:
        unit: of its numbers, with their range, in words.
        layer: `photo` or `sphere`, whose pixels it has if it is an image; None of numbers.
        levels: what black and white stand for in a picture of a layer; None of linear radiance,
            which has no upper end.
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
    "exponent_bin_probabilities": Output(
        "probability of each bin of the exponent; they sum to 1",
    ),
    "log_exponent": Output("log10 of the Blinn-Phong exponent, in [0, 3]"),
}
"""By name, in the order in which systems answer them. No system has them all."""

NEEDED = {
    "mask": ("mask",),
    "specular": ("mask", "specular_shading"),
    "mirror": ("mask", "mirror"),
    "albedo": ("mask", "diffuse_albedo", "specular_albedo"),
    "exponent": ("mask", "exponent_bin_probabilities"),
    "diffuse": ("mask", "specular_shading", "diffuse_albedo", "specular_albedo"),
    "reflectance_map": ("mask", "reflectance_map"),
}
"""What an estimate can be asked for, and the outputs that it takes.

Under regression the exponent takes `log_exponent`. Not every system has them all.
"""
