"""A budget's shares fill it, whatever the stages take of theirs, and the rates end at 0."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.train import budget, pace
from lime_keras.train.budget import SAVING, Budget, Cost, Plan
from lime_keras.train.pace import Clock, Count


class Time:
    """A clock that the test moves."""

    def __init__(self, monkeypatch):
        self.now = 1000.0
        for module in (budget, pace):
            monkeypatch.setattr(module, "monotonic", lambda: self.now)


@pytest.fixture
def time():
    with pytest.MonkeyPatch.context() as patch:
        yield Time(patch)


def test_a_budget_counts_from_the_commands_beginning(time):
    budget = Budget(2, began=time.now - 30, spent=20)
    assert budget.left == pytest.approx(70) and budget.spent == pytest.approx(50)
    time.now += 100
    assert budget.left == pytest.approx(-30) and budget.spent == pytest.approx(150)


_SECONDS = st.floats(1e-4, 10)
_PLANS = st.lists(
    st.builds(
        Plan, st.integers(1, 100_000), st.builds(Cost, _SECONDS, _SECONDS), st.floats(0, 0.99)
    ),
    min_size=1,
    max_size=8,
)


@given(_PLANS, st.lists(st.floats(0.5, 1.2), min_size=8, max_size=8))
def test_the_last_share_is_all_that_is_left(plans, taken):
    """What stages save or overrun is spread over those after them; all have their least."""
    with pytest.MonkeyPatch.context() as patch:
        time = Time(patch)
        budget = Budget(60, began=time.now)
        for index, factor in enumerate(taken[: len(plans)]):
            left = plans[index:]
            seconds = budget.share(left, last=5.0)
            assert seconds >= left[0].cost.least
            if len(left) == 1:
                assert seconds == pytest.approx(max(left[0].cost.least, budget.left - 5.0))
            time.now += factor * seconds


def test_shares_go_by_the_schedules_batches_times_their_seconds(time):
    plans = [Plan(100, Cost(0.2, 0.0)), Plan(300, Cost(0.1, 0.0)), Plan(100, Cost(0.2, 0.0), 0.5)]
    least = sum(plan.cost.least for plan in plans)
    share = Budget(10, time.now).share(plans, last=0.0)
    assert share == pytest.approx(plans[0].cost.least + (600 - least) * 20 / (20 + 30 + 10))


def test_with_no_time_left_each_stage_has_its_least(time):
    plans = [Plan(100, Cost(0.2, 3.0)), Plan(300, Cost(0.1, 0.0))]
    assert Budget(0.01, time.now).share(plans, last=9.0) == pytest.approx(0.2 + 6.0 + SAVING)


def test_too_few_minutes_are_refused_with_the_least(time):
    budget = Budget(1, began=time.now - 20)
    cost = Cost(step=2.0, look=1.0)
    budget.check([cost], 8, last=4.0)
    time.now += 32
    # 52 s so far, 5 of a batch and its evaluations for each stage, and 4 at the end.
    with pytest.raises(ValueError, match=r"--minutes 1 is too short.*at least 1\.6 are needed"):
        budget.check([cost] * 8, 8, last=4.0)
    # Of two stages 62 s, and so 248 of eight.
    with pytest.raises(ValueError, match=r"at least 4\.2 are needed.* of 2 of 8 stages"):
        budget.check([cost] * 2, 8, last=4.0)


def test_the_least_of_a_resumed_run_counts_what_it_took_before(time):
    with pytest.raises(ValueError, match=r"at least 1\.5 are needed.* of 2 of 2 stages"):
        Budget(1, began=time.now - 20, spent=50).check([Cost(2.0, 1.0)] * 2, 2, last=9.0)


def _paced(time, seconds=100.0, look=5.0, done=0.0):
    clock = Clock(Budget(10, time.now), seconds, look, done)
    time.now += look
    clock.start()
    return clock


def test_a_stage_ends_in_time_for_its_last_evaluation(time):
    clock = _paced(time)
    began = time.now
    assert clock.progress(0) == 0
    time.now = began + (100 - SAVING - 10) / 2
    assert clock.progress(7) == pytest.approx(0.5)
    time.now = began + 100 - SAVING - 10
    assert clock.progress(9) == 1
    time.now += 50
    assert clock.progress(9) == 1


def test_rates_fall_to_nothing_along_half_a_cosine(time):
    clock = _paced(time)
    rates = [clock.rate(progress, 0.5) for progress in (0, 1 / 3, 0.5, 1)]
    assert rates == pytest.approx([0.5, 0.375, 0.25, 0.0])
    assert Count(4).rate(0.5, 0.5) is None


def test_a_resumed_stage_goes_on_where_it_was(time):
    """With what is left, be it less than was planned."""
    clock = _paced(time, seconds=40.0, look=5.0, done=0.75)
    assert clock.progress(3) == 0.75
    time.now += (40 - SAVING - 10) / 2
    assert clock.progress(3) == pytest.approx(0.875)


def test_a_stage_without_time_is_over_at_once(time):
    assert _paced(time, seconds=0.0).progress(0) == 1


@pytest.mark.parametrize("look, expected", [(0.01, 10), (1.0, 5), (40.0, 1)])
def test_evaluations_take_no_more_than_their_share(time, look, expected):
    """But the last one is always due."""
    clock = _paced(time, look=look)
    looks, step, progress = [], 0, 0.0
    while progress < 1:
        time.now += 0.1
        step += 1
        progress = clock.progress(step)
        if clock.looks(step, progress):
            time.now += look
            clock.looked(progress, look)
            looks.append(progress)
    assert looks[-1] == 1 and len(looks) == expected
    assert all(b - a >= 0.1 - 1e-9 for a, b in itertools.pairwise(looks[:-1]))


def test_a_counted_stage_is_evaluated_at_even_intervals():
    count = Count(25)
    assert [step for step in range(1, 26) if count.looks(step, step / 25)] == [*range(2, 26, 2), 25]
    long = Count(1_000_000)
    assert [step for step in range(1, 1600) if long.looks(step, 0.0)] == [500, 1000, 1500]
    assert count.progress(25) == 1 and count.left is None and not count.state(0.5)


def test_a_checkpoint_records_progress_and_time(time):
    clock = _paced(time)
    assert clock.state(0.25) == {"progress": 0.25, "spent": pytest.approx(5.0)}
    assert clock.left == pytest.approx(595.0)


def test_seconds_of_an_evaluation_leave_compilation_out(time):
    """A batch of each size is evaluated twice, and the others not at all."""
    seen = []

    def evaluate(batch):
        size = len(batch["mask"])
        time.now += size if size in seen else 100.0
        seen.append(size)

    batches = [{"mask": [0] * size} for size in (4, 4, 4, 2)]
    assert budget.seconds_of_evaluation(batches, evaluate) == pytest.approx(14.0)
    assert seen == [4, 4, 2, 2] and math.isfinite(time.now)
