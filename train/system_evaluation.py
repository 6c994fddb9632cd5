"""The evaluation of the whole system on held-out examples, at the end of a run.

It is the assembled system that is evaluated: its subnetworks read one another's predictions, and it
cuts the object out by its own mask.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
from keras import ops

from lime_keras.io import atomic
from lime_keras.networks import assemble

from . import terms
from .data import Batch, Data
from .devices import Devices


class SystemModel(keras.Model):
    """A model of a whole system that only measures its outputs.

    Args:
        subnetworks: all subnetworks of a system by name.
    """

    def __init__(self, subnetworks: Mapping[str, keras.Model]):
        super().__init__(dtype="float32")
        self._system = assemble(subnetworks)
        self._measures = terms.metrics_of(subnetworks)
        self.built = True

    def call(self, batch: Batch, training: bool = False) -> dict[str, Any]:
        """Return the system's outputs for the images of a batch."""
        return self._system(batch["image"], training=training)

    def compute_loss(self, *_: Any, **__: Any) -> Any:
        """Return 0: nothing is learnt."""
        return ops.zeros(())

    def compute_metrics(
        self, x: Any, y: Any, y_pred: Any, sample_weight: Any = None
    ) -> dict[str, Any]:
        """Update the measures and return none, so that nothing is read back for each batch."""
        terms.update(self._measures, x, y_pred, sample_weight)
        return {}

    def reset_metrics(self) -> None:
        """Keep the measures, which Keras asks to reset before each batch."""

    def reset_measures(self) -> None:
        """Reset the measures."""
        super().reset_metrics()

    def measured(self) -> dict[str, float]:
        """Return the measures by name, over all batches since `reset_measures`."""
        return terms.measured(self._measures)


class SystemEvaluation:
    """The evaluation of a system on the held-out examples of a run.

    Args:
        subnetworks: all subnetworks of the system by name.
        data: data of the run.
        devices: devices that each batch is split between.
    """

    def __init__(self, subnetworks: Mapping[str, keras.Model], data: Data, devices: Devices):
        self._data, self._devices = data, devices
        with devices.scope():
            self._model = SystemModel(subnetworks)
            self._model.compile()

    def write(self, run: Path) -> None:
        """Evaluate the system and write the result to `RUN/evaluation.json`.

        It holds `examples`, the number of held-out examples, and `measures` by name; a measure that
        is not finite is null.
        """
        model, examples = self._model, 0
        model.reset_measures()
        for batch in self._data.validation(self._data.features):
            examples += len(batch["mask"])
            self._evaluate(batch)
        measures = model.measured() if examples else {}
        if not self._devices.leads:
            return
        finite = {name: v if math.isfinite(v) else None for name, v in measures.items()}
        text = json.dumps({"examples": examples, "measures": finite}, indent=1)
        atomic.write(evaluation_path(run), text + "\n")

    def _evaluate(self, batch: Batch) -> None:
        devices = self._devices
        seen, weights = devices.split(devices.local_rows(batch)), devices.weights(batch)
        self._model.test_on_batch(seen, sample_weight=weights)


def evaluation_path(run: Path) -> Path:
    """Return the path of a run's evaluation."""
    return run / "evaluation.json"
