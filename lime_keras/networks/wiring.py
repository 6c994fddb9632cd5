"""The connections between subnetworks (section 5), shared by whole systems and training stages."""

from collections.abc import Mapping
from typing import Any

import keras

from lime_keras.networks.registry import (
    DERIVED,
    OUTPUT_ROWS,
    QUANTITIES,
    estimate,
    predicted_quantities,
)

Networks = Mapping[str, keras.Model]  # subnetworks by name


def predictors(subnetworks: Networks) -> dict[str, str]:
    """Map each quantity to the name of the subnetwork that predicts it, in the given order."""
    return {
        quantity: name
        for name, network in subnetworks.items()
        for quantity in predicted_quantities(name, network)
    }


def required_inputs(subnetworks: Networks) -> tuple[str, ...]:
    """Return the quantities that must be given so that these subnetworks can run without others.

    They are the quantities that the subnetworks read and do not predict, and always the mask, which
    cuts the object out.
    """
    read = {
        tensor.name.removeprefix("linear_")
        for network in subnetworks.values()
        for tensor in network.inputs
    }
    missing = read - set(predictors(subnetworks))
    return tuple(name for name in QUANTITIES if name == "mask" or name in missing)


class Wiring:
    """A graph of connected subnetworks that computes each value once, on first request.

    The values are symbolic tensors, from which a Keras model can be made, or tensors of numbers.

    Args:
        subnetworks: subnetworks by name.
        given: `image` `(B, S, S, 3)` sRGB in [0, 1], and the quantities that replace predictions
            as inputs of the subnetworks: `mask` in [0, 1], the others in linear radiance.
        predicted: predictions of quantities that replace subnetworks, in the form that
            `registry.Quantity.from_prediction` takes.
        training: Keras' `training` argument for the subnetworks; by default it is not passed.
    """

    def __init__(
        self,
        subnetworks: Networks,
        given: Mapping[str, Any],
        *,
        training: bool | None = None,
        predicted: Mapping[str, Any] | None = None,
    ):
        self._subnetworks, self._given = subnetworks, given
        self._predicted = predicted or {}
        self._options = {} if training is None else {"training": training}
        self._predictors = predictors(subnetworks)
        self._raw: dict[str, dict[str, Any]] = {}
        self._inputs: dict[str, Any] = {"image": given["image"]}
        self._estimates: dict[str, Any] = {}

    def raw_prediction(self, quantity: str) -> Any:
        """Return the raw prediction of a quantity, as the subnetwork outputs it."""
        name = self._predictors[quantity]
        if name not in self._raw:
            network = self._subnetworks[name]
            inputs = [self.network_input(tensor.name) for tensor in network.inputs]
            packed = keras.tree.pack_sequence_as(network.input, inputs)
            predicted = network(packed, **self._options)
            values = predicted if isinstance(predicted, list) else [predicted]
            self._raw[name] = dict(zip(predicted_quantities(name, network), values, strict=True))
        return self._raw[name][quantity]

    def network_input(self, quantity: str) -> Any:
        """Return a quantity in the form that subnetworks read: given if it is, else predicted.

        `quantity` may also be `image`, or a row of `DERIVED`.
        """
        if quantity not in self._inputs:
            self._inputs[quantity] = self._compute_input(quantity)
        return self._inputs[quantity]

    def output(self, name: str) -> Any:
        """Return an output, computed from the predicted quantity even if the quantity is given."""
        row = OUTPUT_ROWS[name]
        return row.read(self._estimate(row.quantity))

    def _compute_input(self, quantity: str) -> Any:
        if quantity in DERIVED:
            return DERIVED[quantity](self.network_input)
        if quantity in self._predicted:
            return QUANTITIES[quantity].from_prediction(
                self._predicted[quantity], self.network_input
            )
        if quantity in self._given:
            return QUANTITIES[quantity].from_truth(self._given[quantity], self.network_input)
        return self._estimate(quantity)

    def _estimate(self, quantity: str) -> Any:
        if quantity not in self._estimates:
            network = self._subnetworks[self._predictors[quantity]]
            self._estimates[quantity] = estimate(
                quantity, network, self.raw_prediction(quantity), self.network_input
            )
        return self._estimates[quantity]
