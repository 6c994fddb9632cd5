"""A whole system: its subnetworks built, and joined.

Only the subnetworks that the outputs need become part of the joined model.
"""

import zlib
from collections.abc import Collection, Mapping

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.registry import QUANTITIES, READINGS, SUBNETWORKS
from lime_keras.networks.wiring import Wiring, quantities


def names(architecture: Architecture) -> tuple[str, ...]:
    """Names of the subnetworks that a system of this architecture has."""
    return tuple(name for name, row in SUBNETWORKS.items() if row.part_of(architecture))


def build(architecture: Architecture, seed: int | None = None) -> dict[str, keras.Model]:
    """The architecture's subnetworks by name, freshly initialised.

    Args:
        architecture: of the system.
        seed: makes the initial weights of a subnetwork depend on it and the subnetwork's name, and
            not on what else there is; by default they follow from Keras' global seed.
    """
    out = {}
    for name in names(architecture):
        if seed is not None:
            keras.utils.set_random_seed(zlib.crc32(f"{seed} {name}".encode()))
        out[name] = SUBNETWORKS[name].build(architecture)
    return out


def answers(subnetworks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Names of the outputs that `assemble` can make of subnetworks, out of `outputs.OUTPUTS`.

    Without MirrorNet there is no `mirror`; under regression, `log_exponent` `(B, 1)`, log10 s, is
    in place of `exponent_bin_probabilities`; for the baseline, `reflectance_map` `(B, S, S, 3)`
    linear radiance in place of S and M.
    """
    found = quantities(subnetworks)
    return tuple(name for name, row in READINGS.items() if row.quantity in found)


def assemble(
    subnetworks: Mapping[str, keras.Model],
    outputs: Collection[str] | None = None,
    *,
    given: Collection[str] = (),
) -> keras.Model:
    """Join subnetworks into one functional model from the image to the named outputs.

    Args:
        subnetworks: as `build` returns them; those that no output needs may be missing.
        outputs: names out of `answers(subnetworks)`; by default all of them.
        given: what is an input beside the image, in place of a subnetwork's answer: `mask`
            `(B, S, S, 1)` in [0, 1], `specular_shading` and `mirror` `(B, S, S, 1)` or
            `reflectance_map` `(B, S, S, 3)`, linear radiance. It is no output then.

    Returns:
        A model from `image` `(B, S, S, 3)` sRGB in [0, 1], or, where something is given, from a
        dictionary of it and that, to a dictionary with, of the outputs named: `mask`
        `(B, S, S, 1)` in [0, 1]; `specular_shading` and `mirror` `(B, S, S, 1)` linear radiance,
        0 outside the mask; `diffuse_albedo` `(B, 3)` linear; `specular_albedo` `(B, 1)`;
        `exponent_bin_probabilities` `(B, 8)`; or what `answers` says of the ablations.

    Raises:
        ValueError: if no output or an unknown one is named, or something is given that no
            subnetwork can be fed with.
    """
    channels = {name: row.channels for name, row in QUANTITIES.items() if row.channels}
    if unknown := sorted(set(given) - set(channels)):
        raise ValueError(f"{unknown} cannot be given: choose from {', '.join(channels)}")
    known = tuple(name for name in answers(subnetworks) if READINGS[name].quantity not in given)
    outputs = known if outputs is None else outputs
    unknown = sorted(set(outputs) - set(known))
    if unknown or not outputs:
        raise ValueError(f"outputs {unknown} not among {', '.join(known)}: name at least one")
    size = next(iter(subnetworks.values())).inputs[0].shape[1]
    image = keras.Input((size, size, 3), name="image")
    inputs = {"image": image}
    for name in filter(set(given).__contains__, channels):
        inputs[name] = keras.Input((size, size, channels[name]), name=name)
    graph = Wiring(subnetworks, inputs)
    found = {
        name: layers.Identity(dtype="float32", name=name)(graph.output(name)) for name in outputs
    }
    return keras.Model(inputs if given else image, found, name="lime")
