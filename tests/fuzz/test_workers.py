"""Faults of doors are found and named, and no door has one."""

import pytest

from tests.fuzz import doors, seeds, verdicts, workers
from tests.fuzz.doors import Door
from tests.fuzz.inputs import Block
from tests.fuzz.report import Report


def raising(error):
    """Return a door that raises an error of that kind, whose words are the input's path."""

    def read(folder):
        raise error(f"{folder}/file is damaged" if error is ValueError else "it is damaged")

    return Door(read, "runs", 1)


@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        (ValueError, verdicts.REFUSED, "file is damaged"),
        (OSError, verdicts.FELL, "refused without the file's name"),
        (IndexError, verdicts.FELL, "no command expects this error"),
        (SystemExit, verdicts.FELL, "SystemExit"),
    ],
)
def test_only_a_refusal_by_name_does_not_fall_through(error, kind, said, tmp_path):
    verdict = verdicts.judged(raising(error), tmp_path, verdicts.LIMITS)
    assert verdict.kind == kind and said in verdict.reason


@pytest.mark.slow
@pytest.mark.parametrize("door", doors.DOORS)
def test_nothing_falls_through(door, tmp_path):
    """The short form of `make fuzz`; each door also shows that it reads something."""
    counts = Report([door], 0, tmp_path / "kept")
    few = {door: doors.DOORS[door]}
    (tmp_path / "scratch").mkdir()
    blocks = iter([Block(door, 0, 40)])
    for outcome in workers.tried(few, blocks, seed=0, count=1, scratch=tmp_path / "scratch"):
        assert outcome.verdict.kind != verdicts.FELL, outcome.verdict.reason
        counts.add(outcome)
    assert counts.tried == 40


def test_every_door_has_seeds():
    assert {door.seeds for door in doors.DOORS.values()} == set(seeds.MAKERS)
