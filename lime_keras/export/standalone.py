"""Each subnetwork as a model of its own; together they compute the outputs of `assemble`.

The split of colours (`optics.dichromatic`), which several subnetworks read, is a model beside them.

A part reads and answers quantities in the form that subnetworks exchange, so a program that joins
parts by these names needs no arithmetic of its own:

- `image`, sRGB in [0, 1], `mask`, coverage in [0, 1], and `dichromatic` are themselves;
- `compressed_specular_shading` and the like are S, M and the reflectance map as the registry's
  `Quantity.from_prediction` returns them: compressed, and 0 outside the object.
"""

from typing import Any

import keras
from keras import layers

from lime_keras.model.folder import SPLIT
from lime_keras.networks.registry import DERIVED, OUTPUT_ROWS, QUANTITIES, predicted_quantities
from lime_keras.networks.wiring import Networks, Wiring
from lime_keras.optics import dichromatic


def parts(subnetworks: Networks) -> dict[str, keras.Model]:
    """Return models that together compute the outputs of the joined subnetworks.

    Args:
        subnetworks: subnetworks by name, none before another that it reads.

    Returns:
        `standalone` of each subnetwork by name; and before the first that reads it the split of
        colours, computed once for all.
    """
    out: dict[str, keras.Model] = {}
    for name, network in subnetworks.items():
        alone = standalone(name, network)
        if SPLIT in alone.input and SPLIT not in out:
            out[SPLIT] = _split(network.inputs[0].shape[1])
        out[name] = alone
    return out


def standalone(name: str, network: keras.Model) -> keras.Model:
    """Return a subnetwork as a model of its own.

    Args:
        name: name of the subnetwork.
        network: the subnetwork, as its row of the registry builds it.

    Returns:
        A model from a dictionary of images `(B, S, S, C)` by name to a dictionary: all outputs out
        of `outputs.OUTPUTS` that the subnetwork alone decides, and `compressed_NAME` of each image
        among its quantities but the mask.
    """
    graph = _SubnetworkGraph(name, network)
    tensors = {}
    for quantity in predicted_quantities(name, network):
        if QUANTITIES[quantity].channels:
            tensors[_exchanged(quantity)] = graph.network_input(quantity)
        for output, row in OUTPUT_ROWS.items():
            if row.quantity == quantity:
                tensors[output] = graph.output(output)
    outputs = {
        output: layers.Identity(dtype="float32", name=output)(value)
        for output, value in tensors.items()
    }
    return keras.Model(graph.inputs, outputs, name=f"{name}_part")


def _split(size: int) -> keras.Model:
    """Return the split of colours as a model of its own, from `image` and `mask`."""
    inputs = {
        name: keras.Input((size, size, channels), name=name)
        for name, channels in (("image", 3), ("mask", 1))
    }
    tensor = DERIVED[SPLIT](inputs.__getitem__)
    outputs = {SPLIT: layers.Identity(dtype="float32", name=SPLIT)(tensor)}
    return keras.Model(inputs, outputs, name=f"{SPLIT}_part")


def _exchanged(quantity: str) -> str:
    """Return the name of a quantity in the form that subnetworks read."""
    return quantity if quantity in ("image", "mask", SPLIT) else f"compressed_{quantity}"


class _SubnetworkGraph(Wiring):
    """The graph of one subnetwork, in which all that it does not predict is an input.

    Attributes:
        inputs: inputs that were asked for, by name.
    """

    def __init__(self, name: str, network: keras.Model):
        super().__init__({name: network}, {"image": None})
        self._inputs.clear()
        self._size = network.inputs[0].shape[1]
        self.inputs: dict[str, keras.KerasTensor] = {}

    def _compute_input(self, quantity: str) -> Any:
        if (quantity in DERIVED and quantity != SPLIT) or quantity in self._predictors:
            return super()._compute_input(quantity)
        name = _exchanged(quantity)
        others = {"image": 3, SPLIT: dichromatic.CHANNELS}  # these are no quantities
        channels = others.get(quantity) or QUANTITIES[quantity].channels
        self.inputs[name] = keras.Input((self._size, self._size, channels), name=name)
        return self.inputs[name]
