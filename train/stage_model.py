"""The Keras model of a training stage: its wiring, losses and measures.

It is written in `keras.ops` alone, so that it trains under any Keras backend.
"""

from collections.abc import Mapping
from typing import Any

import keras
from keras import ops

from lime_keras.networks import output_names
from lime_keras.networks.registry import is_plain
from lime_keras.networks.wiring import Networks, Wiring, predictors, required_inputs

from . import terms
from .photos.kept import INPUT_MASK, PREDICTED
from .terms import TERMS, StageOutputs


class StageModel(keras.Model):
    """A model of the subnetworks that one stage trains together.

    The input of a subnetwork is the prediction of another subnetwork of the stage if there is one,
    then a prediction of the batch that was kept of a frozen one (`photos.answers`), else the ground
    truth. If SegmentationNet is not in the stage, the object is cut out by the batch's input mask
    (`photos.masks`), if it has one, else by the true mask. All subnetworks together are the whole
    system.

    Args:
        subnetworks: subnetworks of the stage by name; all of them are trained that are not frozen.
        compositing: whether the loss of the albedos contains Eq. 5.
        losses: the family of losses that are learnt by (`Schedule.losses`).
        lobe: lobe of S in the data, one of `corpus.LOBES`.
        kept: subnetworks of the stage, not among these, whose predictions the batches hold.
        replicas: number of devices that each compute the loss of their part of a batch. Their
            gradients are added up, so each loss is divided by this number.
    """

    def __init__(
        self,
        subnetworks: Networks,
        compositing: bool = True,
        losses: str = "printed",
        lobe: str = "furnace",
        kept: Networks | None = None,
        replicas: int = 1,
    ):
        # Truth and losses are in single precision, even if the subnetworks compute in half.
        super().__init__(dtype="float32")
        self.subnetworks = dict(subnetworks)
        self._replicas = replicas
        self._given = required_inputs(subnetworks)
        self._kept = [name for name in predictors(kept or {}) if name in self._given]
        self._answered, self._found = tuple(predictors(subnetworks)), output_names(subnetworks)
        of_radiance = [subnetworks[name] for name in ("specular", "mirror") if name in subnetworks]
        self._units = terms.Units(lobe, any(map(is_plain, of_radiance)))
        self.terms = [
            name
            for name in terms.terms_of(subnetworks, losses, compositing)
            if TERMS[name].quantity in self._answered
        ]
        self._means = {term: keras.metrics.Mean(name=term) for term in self.terms}
        self._measures = terms.metrics_of(subnetworks)
        self.built = True

    @property
    def features(self) -> tuple[str, ...]:
        """The names of the features, as in `data.pipeline`, that a batch must hold."""
        kept = [f"{PREDICTED}{quantity}" for quantity in self._kept]
        true = [
            feature
            for quantity in self._given
            if quantity not in self._kept
            for feature in terms.features_of_truth(quantity)
        ]
        return tuple(dict.fromkeys((*terms.features_of(self.terms), *kept, *true)))

    def call(self, batch: Mapping[str, Any], training: bool = False) -> StageOutputs:
        """Return the predictions of the stage's subnetworks, and what they read, for a batch."""
        given = {
            name: terms.truth(name, batch, self._units)
            for name in self._given
            if name not in self._kept
        }
        given["image"] = batch["image"]
        if "mask" in self._answered:
            del given["mask"]
        else:
            given["mask"] = batch.get(INPUT_MASK, batch["mask"])
        predicted = {name: batch[f"{PREDICTED}{name}"] for name in self._kept}
        graph = Wiring(self.subnetworks, given, training=training, predicted=predicted)
        return StageOutputs(
            raw={quantity: graph.raw_prediction(quantity) for quantity in self._answered},
            # Eq. 5 reads S in this form, whatever AlbedoNet reads.
            seen={
                name: graph.network_input(name)
                for network in self.subnetworks.values()
                for tensor in network.inputs
                for name in {tensor.name, tensor.name.removeprefix("linear_")}
            },
            outputs={name: graph.output(name) for name in self._found},
        )

    def compute_loss(
        self, x: Any = None, y: Any = None, y_pred: Any = None, sample_weight: Any = None, **_: Any
    ) -> Any:
        """Return the weighted sum of the stage's loss terms, each a mean over the batch."""
        total = 0.0
        for name in self.terms:
            term = TERMS[name]
            value = ops.mean(term.loss(x, y_pred, self._units))
            self._means[name].update_state(value)
            total = total + term.weight * value
        return total / self._replicas

    def compute_metrics(
        self, x: Any, y: Any, y_pred: Any, sample_weight: Any = None
    ) -> dict[str, Any]:
        """Return the losses of the batch by name; update the measures if weights are passed.

        Only evaluation passes weights: training batches must not count in the measures, and do not
        spend time on them.
        """
        if sample_weight is not None:
            terms.update(self._measures, x, y_pred.outputs, sample_weight)
        return {metric.name: metric.result() for metric in self._of_a_batch()}

    def reset_metrics(self) -> None:
        """Reset the losses, as Keras asks before each batch, and keep the measures."""
        for metric in self._of_a_batch():
            for variable in metric.variables:
                # Zeros that lie where the variable does: other zeros would make all of several
                # processes (`train.hosts`) compare them, in every step.
                variable.assign(ops.zeros_like(variable.value))

    def reset_measures(self) -> None:
        """Reset the measures."""
        for metric in self._measures.values():
            metric.reset_state()

    def measured(self) -> dict[str, float]:
        """Return the measures by name, over all batches with weights since `reset_measures`."""
        return {
            name: float(ops.convert_to_numpy(metric.result()))
            for name, metric in self._measures.items()
        }

    def _of_a_batch(self) -> list[keras.metrics.Metric]:
        return [metric for metric in self.metrics if metric.name not in self._measures]
