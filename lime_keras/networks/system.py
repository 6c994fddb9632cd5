"""From one image to everything that was asked for: the subnetworks, joined.

Only the subnetworks that the outputs need become part of the joined model.
"""

from collections.abc import Callable, Collection, Mapping

import keras
from keras import KerasTensor, layers, ops

from lime_keras.dynamic_range import expand
from lime_keras.networks.albedo import albedo_net
from lime_keras.networks.architecture import Architecture
from lime_keras.networks.exponent import exponent_net
from lime_keras.networks.mirror import mirror_net
from lime_keras.networks.segmentation import segmentation_net
from lime_keras.networks.specular import specular_net

SUBNETWORKS: dict[str, Callable[[Architecture], keras.Model]] = {
    "segmentation": segmentation_net,
    "specular": specular_net,
    "mirror": mirror_net,
    "exponent": exponent_net,
    "albedo": albedo_net,
}

OUTPUTS = (
    "mask",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "exponent_bin_probabilities",
)


def build(architecture: Architecture) -> dict[str, keras.Model]:
    """The five subnetworks by name, freshly initialised from Keras' global seed."""
    return {name: network(architecture) for name, network in SUBNETWORKS.items()}


def assemble(
    subnetworks: Mapping[str, keras.Model], outputs: Collection[str] = OUTPUTS
) -> keras.Model:
    """Join subnetworks into one functional model from the image to the named outputs.

    Args:
        subnetworks: as `build` returns them; those that no output needs may be missing.
        outputs: names out of `OUTPUTS`.

    Returns:
        A model from `image` `(B, S, S, 3)` sRGB in [0, 1] to a dictionary with, of the outputs
        named: `mask` `(B, S, S, 1)` in [0, 1]; `specular_shading` and `mirror` `(B, S, S, 1)`
        linear radiance, 0 outside the mask; `diffuse_albedo` `(B, 3)` linear; `specular_albedo`
        `(B, 1)`; `exponent_bin_probabilities` `(B, 8)`.

    Raises:
        ValueError: if no output or an unknown one is named.
    """
    unknown = set(outputs) - set(OUTPUTS)
    if unknown or not outputs:
        raise ValueError(f"outputs {sorted(unknown)} not among {OUTPUTS}: name at least one")
    image = keras.Input(subnetworks["segmentation"].input_shape[1:], name="image")
    graph = _Graph(subnetworks, image)
    return keras.Model(image, {name: graph.output(name) for name in outputs}, name="lime")


class _Graph:
    """Who feeds whom (section 5), each tensor made when first needed and once."""

    def __init__(self, subnetworks: Mapping[str, keras.Model], image: KerasTensor):
        self._subnetworks = subnetworks
        self._made = {"image": image}

    def output(self, name: str) -> KerasTensor:
        """The public output `name`, under a layer of that name."""
        tensor = getattr(self, f"_{name}")()
        return layers.Identity(dtype="float32", name=name)(tensor)

    def _once(self, name: str, make: Callable[[], KerasTensor]) -> KerasTensor:
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]

    def _mask(self) -> KerasTensor:
        image = self._made["image"]
        return self._once(
            "mask", lambda: ops.clip(self._subnetworks["segmentation"](image), 0.0, 1.0)
        )

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

    def _albedos(self) -> KerasTensor:
        return self._once(
            "albedos",
            lambda: ops.clip(
                self._subnetworks["albedo"]([self._masked_image(), self._compressed_specular()]),
                0.0,
                1.0,
            ),
        )

    def _specular_shading(self) -> KerasTensor:
        return expand(self._compressed_specular())

    def _mirror(self) -> KerasTensor:
        return expand(self._compressed_mirror())

    def _diffuse_albedo(self) -> KerasTensor:
        return self._albedos()[:, :3]

    def _specular_albedo(self) -> KerasTensor:
        return self._albedos()[:, 3:]

    def _exponent_bin_probabilities(self) -> KerasTensor:
        return self._subnetworks["exponent"](
            [self._compressed_specular(), self._compressed_mirror()]
        )
