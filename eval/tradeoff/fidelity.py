"""What a runtime and a precision do to the answers: differences from Keras, and the errors."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lime_keras.export import parity
from lime_keras.networks.precision import POLICIES

from ..accuracy import measures
from ..accuracy.evaluate import evaluate
from ..store import Store
from . import machine
from .run_formats import Run
from .runtimes import KERAS

_COMPARED = 16
"""Test images on which runtimes are compared."""


class Fidelity:
    """How well the variants of one run answer.

    Args:
        run: that was trained.
        store: keeps what is measured.
    """

    def __init__(self, run: Run, store: Store):
        self._run, self._store = run, store
        self._of_keras: dict[str, Mapping[str, np.ndarray]] = {}

    def difference(self, runtime: str, precision: str) -> dict[str, float]:
        """Largest difference of each output from Keras in the same precision, on test images.

        As `parity.compare` has it: relative above 1. Eight bits are compared with float32.
        """

        def compare() -> dict[str, float]:
            images = np.load(self._run.samples.test(self._run.image_size))[:_COMPARED]
            reference = precision if precision in POLICIES else "float32"
            if reference not in self._of_keras:
                self._of_keras[reference] = self._run.answer(KERAS, reference)(images)
            answer = dict(self._run.answer(runtime, precision)(images))
            return parity.compare(dict(self._of_keras[reference]), answer)

        key = self._depends_on(runtime, precision) | {"images": _COMPARED}
        return self._store.value(f"differences/{self._name(runtime, precision)}", key, compare)

    def errors(self, runtime: str, precision: str) -> dict[str, Any]:
        """Errors on the whole test split.

        `measured_on`, a runtime's name, `errors` by measure, their `interval`s and the `count` of
        images. A runtime whose answers are Keras' to within `parity.TOLERANCE` has Keras' errors;
        the others are evaluated themselves.
        """
        if precision in POLICIES and runtime != KERAS:
            if max(self.difference(runtime, precision).values()) <= parity.TOLERANCE:
                return self.errors(KERAS, precision)
        run = self._run

        def measure() -> dict[str, Any]:
            evaluation = evaluate(
                run.folder,
                run.samples.corpus,
                camera=run.samples.camera,
                answer=run.answer(runtime, precision),
            )
            summary = measures.summarise(evaluation)
            known = [name for name in measures.MEASURES if name in summary]
            return {
                "measured_on": runtime,
                "errors": {name: summary[name] for name in known},
                "interval": {name: summary["interval"][name] for name in known},
                "count": summary["count"],
            }

        key = self._depends_on(runtime, precision)
        return self._store.value(f"errors/{self._name(runtime, precision)}", key, measure)

    def _depends_on(self, runtime: str, precision: str) -> dict[str, Any]:
        """What answers to test images follow from; a processor's instructions may round."""
        run = self._run
        calibrated = {} if precision in POLICIES else run.samples.depends_on("train")
        return {
            **run.depends_on,
            "runtime": runtime,
            "precision": precision,
            "calibration": calibrated,
            "test": run.samples.depends_on("test"),
            "instructions": machine.describe()["instructions"],
        }

    def _name(self, runtime: str, precision: str) -> str:
        return f"{self._run.name}-{runtime}-{precision}".replace(",", "").replace(" ", "-")
