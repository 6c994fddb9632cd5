"""The budget of a run whose length is given in minutes, and each stage's share of it.

A stage gets a share of the time left in proportion to the schedule's number of batches times the
measured time of a batch. So what one stage saves or overruns is spread over the stages after it.
"""

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

Batch = dict[str, Any]

SAVING = 1.0
"""Seconds that are kept free to write a checkpoint or a model."""


@dataclass(frozen=True)
class Cost:
    """The measured time that a stage takes, once its functions are compiled.

    Attributes:
        step: seconds of a training batch, the wait for data included.
        look: seconds of an evaluation on the held-out examples.
    """

    step: float
    look: float

    @property
    def least(self) -> float:
        """Seconds of one batch between two evaluations, and of saving."""
        return self.step + 2 * self.look + SAVING


@dataclass(frozen=True)
class Plan:
    """A stage that is still to be trained, or trained on.

    Attributes:
        batches: number of batches that the schedule gives it.
        cost: measured time that it takes.
        done: progress that it has made already, in [0, 1).
    """

    batches: int
    cost: Cost
    done: float = 0.0


class Budget:
    """The wall-clock time of a run, over all commands that train it.

    Args:
        minutes: time of the run.
        began: `time.monotonic()` when this command began.
        spent: seconds that earlier commands have spent, up to their last checkpoint.
    """

    def __init__(self, minutes: float, began: float, spent: float = 0.0):
        self._minutes, self._earlier = minutes, spent
        self._end = began + 60 * minutes - spent

    @property
    def left(self) -> float:
        """Seconds left; negative if the run takes longer."""
        return self._end - monotonic()

    @property
    def spent(self) -> float:
        """Seconds spent by this command and the earlier ones."""
        return 60 * self._minutes - self.left

    def check(self, costs: Sequence[Cost], stages: int, last: float) -> None:
        """Raise ValueError if the time left is too short for one batch of each stage.

        Args:
            costs: costs of the stages that are compiled and measured, at least one.
            stages: number of stages to train; those without a cost are not yet compiled.
            last: seconds of what follows the last stage.
        """
        known = sum(cost.least for cost in costs)
        if known + last <= self.left:
            return
        # A stage that is not compiled yet is taken to need as long as the mean of the others.
        here = self.spent - self._earlier + known
        least = self._earlier + here * stages / len(costs) + last
        raise ValueError(
            f"--minutes {self._minutes:g} is too short for a batch of each stage: at least "
            f"{math.ceil(least / 6) / 10:g} are needed, by the time of start-up, compilation and "
            f"the first batches of {len(costs)} of {stages} stages; pass more --minutes and, if "
            "there is a run already, another --out"
        )

    def share(self, plans: Sequence[Plan], last: float) -> float:
        """Return the seconds for the first of the stages.

        Args:
            plans: the stages that are left, in order.
            last: seconds of what follows the last stage.
        """
        free = max(0.0, self.left - last - sum(plan.cost.least for plan in plans))
        work = [plan.batches * (1 - plan.done) * plan.cost.step for plan in plans]
        return plans[0].cost.least + free * work[0] / sum(work)


def seconds_of(action: Callable[[], object]) -> float:
    """Return the seconds that an action takes."""
    began = monotonic()
    action()
    return monotonic() - began


def seconds_of_evaluation(batches: Iterable[Batch], evaluate: Callable[[Batch], object]) -> float:
    """Return the seconds to evaluate all batches when everything is compiled.

    Of each size of a batch, one is evaluated twice: to compile what it needs, and to measure it.
    """
    total, known = 0.0, dict[int, float]()
    for batch in batches:
        size = len(batch["mask"])
        if size not in known:
            evaluate(batch)
            known[size] = seconds_of(functools.partial(evaluate, batch))
        total += known[size]
    return total
