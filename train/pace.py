"""The pace of a stage: its end, its learning rates, and when it is evaluated.

A stage ends after a number of batches (`Count`) or with its share of a budget of time (`Clock`).
Its progress is 0 at its first batch and 1 at its end.
"""

import math
from collections.abc import Mapping
from time import monotonic

from .budget import SAVING, Budget

_CURVE_POINTS, _LONGEST_INTERVAL = 10, 500
"""Number of evaluations on held-out examples in a stage, and most batches between two of them."""
_LOOKING = 0.05
"""Largest share of a stage's time for evaluations on held-out examples before its end."""


class Count:
    """The pace of a stage that has a number of batches.

    Args:
        steps: number of batches.
    """

    left: float | None = None

    def __init__(self, steps: int):
        self._steps = steps
        self._interval = min(max(1, steps // _CURVE_POINTS), _LONGEST_INTERVAL)

    def start(self) -> None:
        """Begin with the first batch of this command."""

    def progress(self, step: int) -> float:
        """Return the progress in [0, 1] after so many batches."""
        return step / self._steps

    def rate(self, progress: float, highest: float) -> float | None:
        """Return None: the optimiser has a schedule of its own."""
        return None

    def looks(self, step: int, progress: float) -> bool:
        """Return whether an evaluation on the held-out examples is due."""
        return step % self._interval == 0 or step == self._steps

    def looked(self, progress: float, seconds: float) -> None:
        """Take note of the seconds that an evaluation took."""

    def state(self, progress: float) -> Mapping[str, float]:
        """Return what a checkpoint records beside the number of batches."""
        return {}


class Clock:
    """The pace of a stage that has a share of a budget.

    The progress never falls, also if a stage is resumed with less time than it was begun with.

    Args:
        budget: budget of the run.
        seconds: seconds of the stage from now on.
        look: seconds of an evaluation on the held-out examples.
        done: progress of the stage before this command, in [0, 1).
    """

    def __init__(self, budget: Budget, seconds: float, look: float, done: float = 0.0):
        self._budget, self._look, self._done = budget, look, done
        self._start = monotonic()
        self._end = self._start + seconds - SAVING
        self._looking, self._next = 0.0, done + 1 / _CURVE_POINTS

    @property
    def left(self) -> float | None:
        """Seconds left of the run's budget."""
        return self._budget.left

    def start(self) -> None:
        """Begin with the first batch of this command."""
        self._start, self._looking = monotonic(), 0.0

    def progress(self, step: int) -> float:
        """Return the progress in [0, 1]: it is 1 when there is time for one more evaluation."""
        planned = self._end - self._look - self._start
        passed = (monotonic() - self._start) / planned if planned > 0 else 1.0
        return min(1.0, self._done + (1 - self._done) * passed)

    def rate(self, progress: float, highest: float) -> float | None:
        """Return the learning rate: it falls from the highest one to 0 along half a cosine."""
        return highest * (1 + math.cos(math.pi * progress)) / 2

    def looks(self, step: int, progress: float) -> bool:
        """Return whether an evaluation on the held-out examples is due."""
        cheap = self._looking + self._look <= _LOOKING * (monotonic() - self._start)
        return progress >= 1 or (progress >= self._next and cheap)

    def looked(self, progress: float, seconds: float) -> None:
        """Take note of the seconds that an evaluation took."""
        self._look = seconds
        self._looking += seconds
        self._next = progress + 1 / _CURVE_POINTS

    def state(self, progress: float) -> Mapping[str, float]:
        """Return what a checkpoint records beside the number of batches."""
        return {"progress": progress, "spent": self._budget.spent}


Pace = Count | Clock
