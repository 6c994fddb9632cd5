"""What a file must say of the network in it, so that it can be used without this package."""

import dataclasses
from typing import Any

import keras

from lime_keras.networks import PRESETS, Architecture
from lime_keras.optics import shininess
from lime_keras.outputs import OUTPUTS
from lime_keras.version import __version__


def card(architecture: Architecture, network: keras.Model, precision: str) -> dict[str, Any]:
    """The description of an assembled network, for JSON.

    Args:
        architecture: of its subnetworks.
        network: of `lime_keras.networks.assemble`.
        precision: that its weights are written in.

    Returns:
        `package`, `version`, `preset` (None if it is of none), `architecture`, `description`,
        `precision`; of the input, `image`: `input_shape`, `input_layout`, `colour_space`,
        `input_range`, `normalisation`; `outputs` by name, each with its `shape` and `unit`; and,
        where the exponent is classified, `exponent_bin_edges` (9) and `exponent_bin_means` (8), the
        exponent s that each class stands for.
    """
    out = {
        "package": "lime-keras",
        "version": __version__,
        "preset": _preset(architecture),
        "architecture": dataclasses.asdict(architecture),
        "description": architecture.description,
        "precision": precision,
        "input_shape": _shape(network.inputs[0]),
        "input_layout": "NHWC, top row first",
        "colour_space": "sRGB",
        "input_range": [0.0, 1.0],
        "normalisation": "none",
        "outputs": {
            name: {"shape": _shape(tensor), "unit": OUTPUTS[name].unit}
            for name, tensor in network.output.items()
        },
    }
    if "exponent_bin_probabilities" in network.output:
        out["exponent_bin_edges"] = (10.0**shininess.LOG_EDGES).tolist()
        out["exponent_bin_means"] = (10.0**shininess.LOG_MEANS).tolist()
    return out


def _preset(architecture: Architecture) -> str | None:
    """The preset it is of; an ablation is of the one that it leaves something out of."""
    whole = dataclasses.replace(architecture, system="lime", mirror=True, exponent="classification")
    return next((name for name, preset in PRESETS.items() if preset == whole), None)


def _shape(tensor: keras.KerasTensor) -> list[int | str]:
    return ["batch", *tensor.shape[1:]]
