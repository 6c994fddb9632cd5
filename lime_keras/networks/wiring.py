"""Who feeds whom (section 5): one graph of system, stage of training and oracle."""

from collections.abc import Mapping
from typing import Any

import keras

from lime_keras.networks.registry import QUANTITIES, READINGS, answered


def quantities(subnetworks: Mapping[str, keras.Model]) -> dict[str, str]:
    """By quantity that subnetworks answer, which of them does, in their order."""
    return {
        quantity: name
        for name, network in subnetworks.items()
        for quantity in answered(name, network)
    }


def needed(subnetworks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Quantities that have to be given for these subnetworks to work by themselves.

    The mask in any case, which cuts the object out, and what they see that none of them answers.
    """
    seen = {tensor.name for network in subnetworks.values() for tensor in network.inputs}
    unanswered = seen - set(quantities(subnetworks))
    return tuple(name for name in QUANTITIES if name == "mask" or name in unanswered)


class Wiring:
    """Subnetworks joined, each value made when it is first asked for and once.

    Values are symbolic tensors, of which a model can be made, or tensors of numbers.

    Args:
        subnetworks: by name.
        given: `image` `(B, S, S, 3)` sRGB in [0, 1], and the quantities that are inputs in place
            of estimates: `mask` in [0, 1], the others linear radiance.
        training: passed on to the subnetworks; by default they are left to find out.
    """

    def __init__(
        self,
        subnetworks: Mapping[str, keras.Model],
        given: Mapping[str, Any],
        *,
        training: bool | None = None,
    ):
        self._subnetworks, self._given = subnetworks, given
        self._options = {} if training is None else {"training": training}
        self._answering = quantities(subnetworks)
        self._answers: dict[str, dict[str, Any]] = {}
        self._seen: dict[str, Any] = {"image": given["image"]}
        self._estimates: dict[str, Any] = {}

    def answer(self, quantity: str) -> Any:
        """What a subnetwork says of a quantity, as it stands."""
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
        """What subnetworks are fed of a quantity: the truth if it is given, else the estimate.

        `image` and `masked_image` count as quantities here.
        """
        if quantity not in self._seen:
            self._seen[quantity] = self._fed(quantity)
        return self._seen[quantity]

    def output(self, name: str) -> Any:
        """An output, of what the subnetworks answer."""
        row = READINGS[name]
        return row.read(self._estimate(row.quantity))

    def _fed(self, quantity: str) -> Any:
        if quantity == "masked_image":
            return self.seen("image") * self.seen("mask")
        if quantity in self._given:
            return QUANTITIES[quantity].given(self._given[quantity], self.seen)
        return self._estimate(quantity)

    def _estimate(self, quantity: str) -> Any:
        if quantity not in self._estimates:
            answer = self.answer(quantity)
            self._estimates[quantity] = QUANTITIES[quantity].estimated(answer, self.seen)
        return self._estimates[quantity]
