"""The construction of a whole system: its subnetworks, built and joined into one model.

The joined model contains only the subnetworks that its outputs need.
"""

import random
import zlib
from collections.abc import Collection

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.registry import OUTPUT_ROWS, SUBNETWORKS
from lime_keras.networks.wiring import Networks, Wiring, predictors


def subnetwork_names(architecture: Architecture) -> tuple[str, ...]:
    """Return the names of the subnetworks that a system of this architecture has."""
    return tuple(name for name, row in SUBNETWORKS.items() if row.part_of(architecture))


def build(architecture: Architecture, seed: int | None = None) -> dict[str, keras.Model]:
    """Build the subnetworks of an architecture, by name, with freshly initialised weights.

    Args:
        architecture: architecture of the system.
        seed: seed of the initial weights. A subnetwork's weights depend on the seed and on its name
            alone, not on the other subnetworks. By default they follow Keras' global seed.
    """
    out, state = {}, random.getstate()
    for name in subnetwork_names(architecture):
        if seed is not None:
            # Keras draws the initialisers' seeds from Python's generator. Its function for seeds
            # would import TensorFlow under any backend.
            random.seed(zlib.crc32(f"{seed} {name}".encode()))
        out[name] = SUBNETWORKS[name].build(architecture)
    if seed is not None:
        random.setstate(state)
    return out


def output_names(subnetworks: Networks) -> tuple[str, ...]:
    """Return the names out of `outputs.OUTPUTS` that `assemble` can compute with these subnetworks.

    Without MirrorNet there is no `mirror`. With regression, `log_exponent` `(B, 1)`, log10 s,
    replaces `exponent_bin_probabilities`. In the baseline, `reflectance_map` `(B, S, S, 3)`, linear
    radiance, replaces `specular_shading` and `mirror`.
    """
    predicted = predictors(subnetworks)
    return tuple(name for name, row in OUTPUT_ROWS.items() if row.quantity in predicted)


def assemble(
    subnetworks: Networks, outputs: Collection[str] | None = None, *, with_mask: bool = False
) -> keras.Model:
    """Join subnetworks into one functional model from the image to the named outputs.

    Args:
        subnetworks: subnetworks by name, as `build` returns them; a subnetwork that no output needs
            may be missing.
        outputs: names out of `output_names(subnetworks)`; by default all of them.
        with_mask: whether the mask is an input, and so no output, in place of SegmentationNet's.

    Returns:
        A model from images to a dictionary of the named outputs. Its input is `image`
        `(B, S, S, 3)` sRGB in [0, 1] or, with the mask, a dictionary of the image and `mask`
        `(B, S, S, 1)` in [0, 1]. The outputs of LIME are `mask` `(B, S, S, 1)` in [0, 1];
        `specular_shading` and `mirror` `(B, S, S, 1)` linear radiance, 0 outside the mask;
        `diffuse_albedo` `(B, 3)` linear; `specular_albedo` `(B, 1)`; and
        `exponent_bin_probabilities` `(B, 8)`. See `output_names` for the outputs of the ablations.

    Raises:
        ValueError: if no output is named, or an output is unknown.
    """
    known = tuple(name for name in output_names(subnetworks) if name != "mask" or not with_mask)
    outputs = known if outputs is None else outputs
    unknown = sorted(set(outputs) - set(known))
    if unknown or not outputs:
        raise ValueError(f"outputs {unknown} not among {', '.join(known)}: name at least one")
    size = next(iter(subnetworks.values())).inputs[0].shape[1]
    image = keras.Input((size, size, 3), name="image")
    inputs = {"image": image}
    if with_mask:
        inputs["mask"] = keras.Input((size, size, 1), name="mask")
    graph = Wiring(subnetworks, inputs)
    tensors = {
        name: layers.Identity(dtype="float32", name=name)(graph.output(name)) for name in outputs
    }
    return keras.Model(inputs if with_mask else image, tensors, name="lime")
