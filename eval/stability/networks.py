"""Cases for whole systems with extreme images: precisions, exported formats, batches.

Outputs are compared with `double_precision`. Its random rounding errors of each precision determine
the tolerance.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

from .photos import extreme_photos
from .precisions import EXPORTED, TENSORS, Precision
from .systems import BATCH, TrialSystem
from .verdicts import Case, Compared, Outcome, joined

_SQUARABLE = 1e15
"""Largest derivative accepted, so that the optimiser can square it in single precision."""


def cases(
    part: str, system: TrialSystem, precisions: Sequence[Precision] = (*TENSORS, *EXPORTED)
) -> list[Case]:
    """Return the cases of a system: images, batches and derivatives in each precision.

    Its name in the tables is `part`.
    """
    out = []

    def add(name: str, precision: Precision, measure: Callable[..., Outcome], *more: Any) -> None:
        measure = functools.partial(measure, system, *more)
        out.append(Case(part, name, precision.name, measure))

    for precision in precisions:
        for image in extreme_photos(2):
            add(image, precision, _alone, precision, image)
        in_a_batch = f"all images, in a batch of {BATCH} that ends in NaN"
        add(in_a_batch, precision, _in_a_batch, precision)
        if not precision.compiled:
            add("derivatives by the weights, all images", precision, _derivatives, precision)
    return out


def _alone(system: TrialSystem, precision: Precision, image: str) -> Outcome:
    """Try an image in a batch of one."""
    found = system.answers(precision, system.images[image][None])
    return Outcome(system.compared(image, found, precision.epsilon))


def _derivatives(system: TrialSystem, precision: Precision) -> Outcome:
    """Try the derivatives by the weights: the optimiser must be able to square them."""
    steepest = system.steepest(precision)
    return Outcome(gradient=Compared(steepest, 0.0, _SQUARABLE, 0.0))


def _in_a_batch(system: TrialSystem, precision: Precision) -> Outcome:
    """Try all images in one batch: position and other images must not change an output."""
    names, batch = system.batch
    found = system.answers(precision, batch)
    return Outcome(
        joined(
            system.compared(
                image, {name: x[k : k + 1] for name, x in found.items()}, precision.epsilon
            )
            for k, image in enumerate(names)
        )
    )
