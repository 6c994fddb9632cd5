"""The accuracy of a run in each runtime and precision: differences from Keras, and errors."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lime_keras.export import parity
from lime_keras.networks.precision import POLICIES

from ..accuracy import measures
from ..accuracy.evaluate import evaluate
from ..source_code import code_of
from ..store import Store
from . import machine
from .run_formats import Run
from .runtimes import KERAS

_COMPARED = 16
"""Number of test images on which runtimes are compared."""


class Fidelity:
    """The accuracy of one run's variants.

    Args:
        run: trained run.
        store: store that keeps the measurements.
    """

    def __init__(self, run: Run, store: Store):
        self._run, self._store = run, store
        self._of_keras: dict[str, Mapping[str, np.ndarray]] = {}

    def difference(self, runtime: str, precision: str) -> dict[str, float]:
        """Return the largest difference of each output from Keras on test images.

        The difference is that of `parity.compare`: absolute, and relative for values above 1. Keras
        computes in the same precision; eight bits are compared with Keras in float32.
        """

        def compare() -> dict[str, float]:
            images = np.load(self._run.samples.test(self._run.image_size))[:_COMPARED]
            reference = precision if precision in POLICIES else "float32"
            if reference not in self._of_keras:
                self._of_keras[reference] = self._run.answer(KERAS, reference)(images)
            answer = dict(self._run.answer(runtime, precision)(images))
            return parity.compare(dict(self._of_keras[reference]), answer)

        key = self._depends_on(runtime, precision) | {"images": _COMPARED}
        name = f"differences/{self._name(runtime, precision)}"
        return self._store.value(name, key, compare, code=code_of(__name__))

    def errors(self, runtime: str, precision: str) -> dict[str, Any]:
        """Return the errors on the whole test split.

        A runtime whose outputs agree with Keras' to within `parity.TOLERANCE` gets the errors of
        Keras. The other runtimes, and eight bits, are evaluated themselves.

        Returns:
            `measured_on` (name of the runtime), `errors`, `interval` and `chance` by measure, and
            the `count` of images.
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
                engine=_Whole(run.answer(runtime, precision)),
            )
            summary = measures.summarise(evaluation)
            known = [name for name in measures.MEASURES if name in summary]
            return {
                "measured_on": runtime,
                "errors": {name: summary[name] for name in known},
                "interval": {name: summary["interval"][name] for name in known},
                "chance": summary["chance"],
                "count": summary["count"],
            }

        key = self._depends_on(runtime, precision)
        name = f"errors/{self._name(runtime, precision)}"
        return self._store.value(name, key, measure, code=code_of(__name__))

    def _depends_on(self, runtime: str, precision: str) -> dict[str, Any]:
        """Return the inputs of a variant's outputs, for the store.

        The processor's instructions are among them, because they may round differently.
        """
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


class _Whole:
    """A whole system as an engine."""

    size, system = 0, ""
    outputs: tuple[str, ...] = ()

    def __init__(self, answer: Any):
        self._answer = answer

    def subnetworks(self, outputs: Any, given: Any) -> tuple[str, ...]:
        return ()

    def run(self, outputs: Any, given: Any) -> dict[str, np.ndarray]:
        return dict(self._answer(given["image"]))
