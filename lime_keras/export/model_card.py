"""The model card in an exported file: all that is needed to use it without this package."""

import dataclasses
import operator
from typing import Any

import keras

from lime_keras.networks import PRESETS, Architecture
from lime_keras.optics import shininess
from lime_keras.outputs import OUTPUTS
from lime_keras.version import __version__

_OF_THE_LOBE = ("specular_albedo", "specular_shading")  # outputs whose unit is the lobe's


def card(
    architecture: Architecture, network: keras.Model, precision: str, lobe: str = "furnace"
) -> dict[str, Any]:
    """Return the model card of an assembled network, a dictionary for JSON.

    Returns:
        `package`, `version`, `preset` (None if the architecture is none of the presets),
        `architecture`, `description`, `precision` and `lobe`. For the input, `image`:
        `input_shape`, `input_layout`, `colour_space`, `input_range` and `normalisation`. `outputs`
        by name, each with `shape` and `unit`. If the exponent is classified, also
        `exponent_bin_edges` (9) and `exponent_bin_means` (8), the exponent s of each class.
    """
    sizes = operator.attrgetter("size", "unet_width", "unet_depth")
    presets = (name for name, preset in PRESETS.items() if sizes(preset) == sizes(architecture))
    more = dict.fromkeys(network.output, "")
    if lobe == "printed":
        more |= dict.fromkeys(_OF_THE_LOBE, "; of the paper's lobe, which is not normalised")
    out = {
        "package": "lime-keras",
        "version": __version__,
        "preset": next(presets, None),
        "architecture": dataclasses.asdict(architecture),
        "description": architecture.description,
        "precision": precision,
        "lobe": lobe,
        "input_shape": ["batch", *network.inputs[0].shape[1:]],
        "input_layout": "NHWC, top row first",
        "colour_space": "sRGB",
        "input_range": [0.0, 1.0],
        "normalisation": "none",
        "outputs": {
            name: {"shape": ["batch", *tensor.shape[1:]], "unit": OUTPUTS[name].unit + more[name]}
            for name, tensor in network.output.items()
        },
    }
    if "exponent_bin_probabilities" in network.output:
        out["exponent_bin_edges"] = (10.0**shininess.LOG_EDGES).tolist()
        out["exponent_bin_means"] = (10.0**shininess.LOG_MEANS).tolist()
    return out
