"""The connections between subnetworks (section 5), shared by whole systems and training stages."""

from collections.abc import Mapping
from typing import Any

import keras

from lime_keras.networks.registry import DERIVED, OUTPUT_ROWS, QUANTITIES, answered, estimate


def quantities(subnetworks: Mapping[str, keras.Model]) -> dict[str, str]:
    """Map each quantity to the name of the subnetwork that predicts it, in the given order."""
    return {
        quantity: name
        for name, network in subnetworks.items()
        for quantity in answered(name, network)
    }


def needed(subnetworks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Return the quantities that must be given so that these subnetworks can run without others.

    They are the quantities that the subnetworks read and do not predict, and always the mask, which
    cuts the object out.
    """
    seen = {
        tensor.name.removeprefix("linear_")
        for network in subnetworks.values()
        for tensor in network.inputs
    }
    unanswered = seen - set(quantities(subnetworks))
    return tuple(name for name in QUANTITIES if name == "mask" or name in unanswered)


class Wiring:
    """A graph of connected subnetworks that computes each value once, on first request.

    The values are symbolic tensors, from which a Keras model can be made, or tensors of numbers.

    Args:
        subnetworks: subnetworks by name.
        given: `image` `(B, S, S, 3)` sRGB in [0, 1], and the quantities that replace predictions
            as inputs of the subnetworks: `mask` in [0, 1], the others in linear radiance.
        predicted: predictions of quantities that replace subnetworks, in the form that
            `registry.Quantity.estimated` takes.
        training: Keras' `training` argument for the subnetworks; by default it is not passed.
    """

    def __init__(
        self,
        subnetworks: Mapping[str, keras.Model],
        given: Mapping[str, Any],
        *,
        training: bool | None = None,
        predicted: Mapping[str, Any] | None = None,
    ):
        self._subnetworks, self._given = subnetworks, given
        self._predicted = predicted or {}
        self._options = {} if training is None else {"training": training}
        self._answering = quantities(subnetworks)
        self._answers: dict[str, dict[str, Any]] = {}
        self._seen: dict[str, Any] = {"image": given["image"]}
        self._estimates: dict[str, Any] = {}

    def answer(self, quantity: str) -> Any:
        """Return the raw prediction of a quantity, as the subnetwork outputs it."""
        name = self._answering[quantity]
        if name not in self._answers:
            network = self._subnetworks[name]
            seen = [self.seen(tensor.name) for tensor in network.inputs]
            packed = keras.tree.pack_sequence_as(network.input, seen)
            found = network(packed, **self._options)
            values = found if isinstance(found, list) else [found]
            self._answers[name] = dict(zip(answered(name, network), values, strict=True))
        return self._answers[name][quantity]

    def seen(self, quantity: str) -> Any:
        """Return a quantity in the form that subnetworks read: given if it is, else predicted.

        `quantity` may also be `image`, or a row of `DERIVED`.
        """
        if quantity not in self._seen:
            self._seen[quantity] = self._fed(quantity)
        return self._seen[quantity]

    def output(self, name: str) -> Any:
        """Return an output, computed from the predicted quantity even if the quantity is given."""
        row = OUTPUT_ROWS[name]
        return row.read(self._estimate(row.quantity))

    def _fed(self, quantity: str) -> Any:
        if quantity in DERIVED:
            return DERIVED[quantity](self.seen)
        if quantity in self._predicted:
            return QUANTITIES[quantity].estimated(self._predicted[quantity], self.seen)
        if quantity in self._given:
            return QUANTITIES[quantity].given(self._given[quantity], self.seen)
        return self._estimate(quantity)

    def _estimate(self, quantity: str) -> Any:
        if quantity not in self._estimates:
            network = self._subnetworks[self._answering[quantity]]
            self._estimates[quantity] = estimate(
                quantity, network, self.answer(quantity), self.seen
            )
        return self._estimates[quantity]
