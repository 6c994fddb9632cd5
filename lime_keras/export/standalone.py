"""Each subnetwork as a model of its own, which together answer what `assemble` answers.

A part reads and answers quantities in the form that subnetworks exchange, so a program that joins
parts by these names needs no arithmetic of its own:

- `image`, sRGB in [0, 1], and `mask`, coverage in [0, 1], are themselves;
- `compressed_specular_shading` and the like are S, M and the reflectance map as the registry's
  `Quantity.estimated` returns them: compressed, and 0 outside the object.
"""

from typing import Any

import keras
from keras import layers

from lime_keras.networks.registry import DERIVED, OUTPUT_ROWS, QUANTITIES, answered
from lime_keras.networks.wiring import Wiring


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
    graph = _Alone(name, network)
    found = {}
    for quantity in answered(name, network):
        if QUANTITIES[quantity].channels:
            found[_exchanged(quantity)] = graph.seen(quantity)
        for output, row in OUTPUT_ROWS.items():
            if row.quantity == quantity:
                found[output] = graph.output(output)
    outputs = {
        output: layers.Identity(dtype="float32", name=output)(value)
        for output, value in found.items()
    }
    return keras.Model(graph.inputs, outputs, name=f"{name}_part")


def _exchanged(quantity: str) -> str:
    """Return the name of a quantity in the form that subnetworks read."""
    return quantity if quantity in ("image", "mask") else f"compressed_{quantity}"


class _Alone(Wiring):
    """The graph of one subnetwork, in which all that it does not predict is an input.

    Attributes:
        inputs: inputs that were asked for, by name.
    """

    def __init__(self, name: str, network: keras.Model):
        super().__init__({name: network}, {"image": None})
        self._seen.clear()
        self._size = network.inputs[0].shape[1]
        self.inputs: dict[str, keras.KerasTensor] = {}

    def _fed(self, quantity: str) -> Any:
        if quantity in DERIVED or quantity in self._answering:
            return super()._fed(quantity)
        name = _exchanged(quantity)
        channels = 3 if quantity == "image" else QUANTITIES[quantity].channels
        self.inputs[name] = keras.Input((self._size, self._size, channels), name=name)
        return self.inputs[name]
