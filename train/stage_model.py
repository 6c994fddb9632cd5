"""A stage as a Keras model: wiring, losses and measures, and nothing else.

Written in `keras.ops` alone, so that it trains under any Keras backend.
"""

from collections.abc import Mapping
from typing import Any

import keras
from keras import ops

from lime_keras.data import pipeline
from lime_keras.networks import answers
from lime_keras.networks.wiring import Wiring, needed, quantities

from . import terms
from .terms import LEARNING, TERMS, Answer


class StageModel(keras.Model):
    """Subnetworks trained together on batches of records.

    A subnetwork's input comes from another one of the stage if that is present, else from the
    truth; the true mask cuts out the object throughout.

    Args:
        subnetworks: by name; only these are trained.
        compositing: whether AlbedoNet is also held to Eq. 5.
        replicas: how many parts of one batch are seen apart, their gradients added up.
    """

    def __init__(
        self, subnetworks: Mapping[str, keras.Model], compositing: bool = True, replicas: int = 1
    ):
        # Truth and losses in single precision, whatever the subnetworks compute in.
        super().__init__(dtype="float32")
        self.subnetworks = dict(subnetworks)
        self._replicas = replicas
        self._given = needed(subnetworks)
        self._answered, self._found = tuple(quantities(subnetworks)), answers(subnetworks)
        self.terms = [
            term
            for name in subnetworks
            for term in LEARNING[name].terms
            if TERMS[term].quantity in self._answered and (compositing or term != "compositing")
        ]
        self._means = {term: keras.metrics.Mean(name=term) for term in self.terms}
        self._measures = terms.metrics_of(subnetworks)
        self.built = True

    @property
    def features(self) -> tuple[str, ...]:
        """What a batch must hold, by the names of `pipeline`."""
        wanted = list(pipeline.LEARNT_FROM)
        for quantity in self._given:
            wanted += terms.features_of_truth(quantity)
        for term in self.terms:
            wanted += TERMS[term].features
        return tuple(dict.fromkeys(wanted))

    def call(self, batch: Mapping[str, Any], training: bool = False) -> Answer:
        """What the stage's subnetworks answer."""
        truths = {quantity: terms.truth(quantity, batch) for quantity in self._given}
        graph = Wiring(self.subnetworks, truths | {"image": batch["image"]}, training=training)
        return Answer(
            raw={quantity: graph.answer(quantity) for quantity in self._answered},
            seen={
                tensor.name: graph.seen(tensor.name)
                for network in self.subnetworks.values()
                for tensor in network.inputs
            },
            outputs={name: graph.output(name) for name in self._found},
        )

    def compute_loss(
        self, x: Any = None, y: Any = None, y_pred: Any = None, sample_weight: Any = None, **_: Any
    ) -> Any:
        """Weighted sum of the stage's terms over the batch."""
        total = 0.0
        for name in self.terms:
            term = TERMS[name]
            value = ops.mean(term.loss(x, y_pred))
            self._means[name].update_state(value)
            total = total + term.weight * value
        return total / self._replicas

    def compute_metrics(
        self, x: Any, y: Any, y_pred: Any, sample_weight: Any = None
    ) -> dict[str, Any]:
        """The losses of the batch, by name; one that comes with weights is measured too.

        Training passes none, and so has no part in the measures, nor does it pay for them.
        """
        if sample_weight is not None:
            terms.update(self._measures, x, y_pred.outputs, sample_weight)
        return {metric.name: metric.result() for metric in self._of_a_batch()}

    def reset_metrics(self) -> None:
        """Start the losses anew, which Keras asks for before each batch; measures are kept."""
        for metric in self._of_a_batch():
            metric.reset_state()

    def reset_measures(self) -> None:
        """Start the measures anew."""
        for metric in self._measures.values():
            metric.reset_state()

    def measured(self) -> dict[str, float]:
        """The measures by name, over all batches with weights since the last `reset_measures`."""
        return {
            name: float(ops.convert_to_numpy(metric.result()))
            for name, metric in self._measures.items()
        }

    def _of_a_batch(self) -> list[keras.metrics.Metric]:
        return [metric for metric in self.metrics if metric.name not in self._measures]
