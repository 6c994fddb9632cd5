"""From one image to everything that was asked for: the subnetworks, joined.

Only the subnetworks that the outputs need become part of the joined model.
"""

import zlib
from collections.abc import Callable, Collection, Mapping
from typing import Any

import keras
from keras import KerasTensor, layers, ops

from lime_keras.networks.albedo import albedo_net
from lime_keras.networks.architecture import Architecture
from lime_keras.networks.exponent import exponent_net
from lime_keras.networks.material import material_net
from lime_keras.networks.mirror import mirror_net
from lime_keras.networks.reflectance_map import reflectance_map_net
from lime_keras.networks.segmentation import segmentation_net
from lime_keras.networks.specular import specular_net
from lime_keras.optics.dynamic_range import expand
from lime_keras.optics.reflectance_map import disc
from lime_keras.optics.shininess import LOG_HIGH, LOG_LOW

SUBNETWORKS: dict[str, Callable[[Architecture], keras.Model]] = {
    "segmentation": segmentation_net,
    "specular": specular_net,
    "mirror": mirror_net,
    "exponent": exponent_net,
    "albedo": albedo_net,
}
"""The five of section 5, by name."""

_BASELINE: dict[str, Callable[[Architecture], keras.Model]] = {
    "segmentation": segmentation_net,
    "reflectance_map": reflectance_map_net,
    "material": material_net,
}

OUTPUTS = (
    "mask",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "exponent_bin_probabilities",
)
"""What the five subnetworks answer together."""

_MASK_CONTRAST = 1.5
"""By which SegmentationNet's answer is stretched about one half before it cuts the object out: ℓ2
draws what it is unsure of towards the middle, and a mask of 0.9 inside the object darkens the
albedo that is read through it (docs/decisions.md)."""


def names(architecture: Architecture) -> tuple[str, ...]:
    """Names of the subnetworks that a system of this architecture has."""
    if architecture.system == "reflectance-map":
        return tuple(_BASELINE)
    return tuple(name for name in SUBNETWORKS if name != "mirror" or architecture.mirror)


def build(architecture: Architecture, seed: int | None = None) -> dict[str, keras.Model]:
    """The architecture's subnetworks by name, freshly initialised.

    Args:
        architecture: of the system.
        seed: makes the initial weights of a subnetwork depend on it and the subnetwork's name, and
            not on what else there is; by default they follow from Keras' global seed.
    """
    known, out = SUBNETWORKS | _BASELINE, {}
    for name in names(architecture):
        if seed is not None:
            keras.utils.set_random_seed(zlib.crc32(f"{seed} {name}".encode()))
        out[name] = known[name](architecture)
    return out


def answers(subnetworks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Names of the outputs that `assemble` can make of a whole system's subnetworks.

    `OUTPUTS`; without MirrorNet, the same without `mirror`; under regression, `log_exponent`
    `(B, 1)`, log10 s, in place of `exponent_bin_probabilities`; for the baseline, `reflectance_map`
    `(B, S, S, 3)` linear radiance in place of S and M.
    """
    if "reflectance_map" in subnetworks:
        layers_of_it: tuple[str, ...] = ("reflectance_map",)
    else:
        layers_of_it = ("specular_shading", *(["mirror"] if "mirror" in subnetworks else []))
    regresses = "exponent" in subnetworks and subnetworks["exponent"].output_shape[-1] == 1
    exponent = "log_exponent" if regresses else "exponent_bin_probabilities"
    return ("mask", *layers_of_it, "diffuse_albedo", "specular_albedo", exponent)


def assemble(
    subnetworks: Mapping[str, keras.Model],
    outputs: Collection[str] | None = None,
    *,
    mask_given: bool = False,
) -> keras.Model:
    """Join subnetworks into one functional model from the image to the named outputs.

    Args:
        subnetworks: as `build` returns them; those that no output needs may be missing.
        outputs: names out of `answers(subnetworks)`; by default all of them.
        mask_given: whether `mask` `(B, S, S, 1)` in [0, 1] is an input beside the image, in place
            of SegmentationNet's answer.

    Returns:
        A model from `image` `(B, S, S, 3)` sRGB in [0, 1] to a dictionary with, of the outputs
        named: `mask` `(B, S, S, 1)` in [0, 1]; `specular_shading` and `mirror` `(B, S, S, 1)`
        linear radiance, 0 outside the mask; `diffuse_albedo` `(B, 3)` linear; `specular_albedo`
        `(B, 1)`; `exponent_bin_probabilities` `(B, 8)`; or what `answers` says of the ablations.

    Raises:
        ValueError: if no output or an unknown one is named.
    """
    known = tuple(name for name in answers(subnetworks) if name != "mask" or not mask_given)
    outputs = known if outputs is None else outputs
    unknown = sorted(set(outputs) - set(known))
    if unknown or not outputs:
        raise ValueError(f"outputs {unknown} not among {', '.join(known)}: name at least one")
    image = keras.Input(subnetworks["segmentation"].input_shape[1:], name="image")
    inputs = {"image": image}
    if mask_given:
        inputs["mask"] = keras.Input((*image.shape[1:3], 1), name="mask")
    graph = _Graph(subnetworks, inputs)
    found = {name: graph.output(name) for name in outputs}
    return keras.Model(inputs if mask_given else image, found, name="lime")


class _Graph:
    """Who feeds whom (section 5), each tensor made when first needed and once."""

    def __init__(self, subnetworks: Mapping[str, keras.Model], inputs: dict[str, KerasTensor]):
        self._subnetworks = subnetworks
        self._size = inputs["image"].shape[1]
        self._made = dict(inputs)

    def output(self, name: str) -> KerasTensor:
        """The public output `name`, under a layer of that name."""
        tensor = getattr(self, f"_{name}")()
        return layers.Identity(dtype="float32", name=name)(tensor)

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]

    def _mask(self) -> KerasTensor:
        def make() -> KerasTensor:
            found = self._subnetworks["segmentation"](self._made["image"])
            return ops.clip((found - 0.5) * _MASK_CONTRAST + 0.5, 0.0, 1.0)

        return self._once("mask", make)

    def _masked_image(self) -> KerasTensor:
        return self._once("masked_image", lambda: self._made["image"] * self._mask())

    def _compressed_specular(self) -> KerasTensor:
        return self._once(
            "compressed_specular",
            lambda: self._subnetworks["specular"](self._masked_image()) * self._mask(),
        )

    def _compressed_mirror(self) -> KerasTensor:
        return self._once(
            "compressed_mirror",
            lambda: self._subnetworks["mirror"](self._compressed_specular()) * self._mask(),
        )

    def _compressed_reflectance_map(self) -> KerasTensor:
        return self._once(
            "compressed_reflectance_map",
            lambda: self._subnetworks["reflectance_map"](self._masked_image()) * disc(self._size),
        )

    def _material(self) -> list[KerasTensor]:
        """Albedos, not clipped, and probabilities, of the baseline."""
        return self._once(
            "material", lambda: self._subnetworks["material"](self._compressed_reflectance_map())
        )

    def _albedos(self) -> KerasTensor:
        def make() -> KerasTensor:
            if "material" in self._subnetworks:
                found = self._material()[0]
            else:
                seen = [self._masked_image(), self._compressed_specular()]
                found = self._subnetworks["albedo"](seen)
            return ops.clip(found, 0.0, 1.0)

        return self._once("albedos", make)

    def _exponent(self) -> KerasTensor:
        """Whatever ExponentNet answers."""
        seen = [self._compressed_specular()]
        if "mirror" in self._subnetworks:
            seen.append(self._compressed_mirror())
        return self._subnetworks["exponent"](seen)

    def _reflectance_map(self) -> KerasTensor:
        return expand(self._compressed_reflectance_map())

    def _specular_shading(self) -> KerasTensor:
        return expand(self._compressed_specular())

    def _mirror(self) -> KerasTensor:
        return expand(self._compressed_mirror())

    def _diffuse_albedo(self) -> KerasTensor:
        return self._albedos()[:, :3]

    def _specular_albedo(self) -> KerasTensor:
        return self._albedos()[:, 3:]

    def _exponent_bin_probabilities(self) -> KerasTensor:
        if "material" in self._subnetworks:
            return self._material()[1]
        return self._exponent()

    def _log_exponent(self) -> KerasTensor:
        return ops.clip(self._exponent(), LOG_LOW, LOG_HIGH)
