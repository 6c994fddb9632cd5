"""Every fault a door may have is found and named, and the inputs go on after it."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz import __main__ as command
from tests.fuzz import broken_doors, doors, seeds, verdicts, workers
from tests.fuzz.inputs import Block
from tests.fuzz.report import Report

ROOT = Path(__file__).parents[2]
FAULTS = {
    "names-nothing": "refused without the file's name",
    "stumbles": "no command expects this error",
    "leaves": "SystemExit",
    "crashes": "crashed: SIGSEGV",
    "ends": "crashed: status 3",
    "hangs": "hung: no end after",
    "swells": "GB of memory",
}


@pytest.fixture
def tried(tmp_path, monkeypatch):
    """`tried(*names)`: what becomes of four inputs of each of the broken doors, in order."""
    monkeypatch.setattr(workers, "LIMIT_SECONDS", 3.0)

    def run(*names, count=2):
        blocks = (Block(name, 0, 4) for name in names)
        scratch = tmp_path / "scratch"
        scratch.mkdir()
        found = workers.tried(
            {name: broken_doors.DOORS[name] for name in names},
            blocks,
            seed=0,
            count=count,
            scratch=scratch,
            make=broken_doors.make,
        )
        return sorted(found, key=lambda one: (names.index(one.door), one.index))

    return run


def test_what_is_refused_by_name_does_not_fall_through(tried):
    found = tried("names")
    assert [one.index for one in found] == list(range(4))
    assert {one.verdict.kind for one in found} <= {verdicts.READ, verdicts.REFUSED}
    assert any("sound.bin is damaged: copy it again" in one.verdict.reason for one in found)


@pytest.mark.parametrize("door", FAULTS)
def test_a_fault_is_found_and_the_next_inputs_are_tried(door, tried, tmp_path):
    found = tried(door, "names")
    assert [one.index for one in found] == [*range(4), *range(4)]
    fell = [one for one in found if one.verdict.kind == verdicts.FELL]
    assert fell and {one.door for one in fell} == {door}
    assert all(FAULTS[door] in one.verdict.reason for one in fell)
    # The input is there to be looked at.
    report = Report((door, "names"), 0, tmp_path / "kept")
    for one in found:
        report.add(one)
    kept = tmp_path / "kept" / f"{door}-seed-0-index-{fell[0].index}"
    assert (kept / "input" / "sound.bin").read_bytes() != broken_doors.SOUND
    assert FAULTS[door] in (kept / "reason.txt").read_text()
    assert (report.tried, report.fell) == (8, len(fell))
    assert f"| {len(fell)} |" in " ".join(report.table().split())


def test_where_a_door_hangs_is_told(tried):
    [reason, *_] = [one.verdict.reason for one in tried("hangs") if one.verdict.reason]
    assert "_hangs" in reason


def test_a_door_that_refuses_sound_inputs_ends_the_run(tried):
    with pytest.raises(
        workers.Unsound, match=r"refuses-all, seed, undamaged: .* whatever it holds"
    ):
        tried("refuses-all")


def test_inputs_are_the_same_for_any_number_of_processes(tried, tmp_path):
    one = tried("names-nothing", "stumbles", count=1)
    kept = {path.parent.name: path.read_bytes() for path in tmp_path.glob("scratch/*-*/sound.bin")}
    (tmp_path / "scratch").rename(tmp_path / "first")
    other = tried("names-nothing", "stumbles", count=3)
    again = {path.parent.name: path.read_bytes() for path in tmp_path.glob("scratch/*-*/sound.bin")}
    assert [x.verdict.kind for x in one] == [x.verdict.kind for x in other]
    assert len(kept) == 8 - sum(x.verdict.kind == verdicts.READ for x in one)
    assert kept == again


def test_blocks_follow_the_shares_up_to_the_count():
    few = {name: doors.DOORS[name] for name in ("photo", "run")}
    [photo, run] = (door.share for door in few.values())
    whole = list(itertools.islice(command.blocks(few, None), 4))
    assert [block.last - block.first for block in whole] == [5 * photo, 5 * run] * 2
    assert whole[2].first == whole[0].last and whole[3].first == whole[1].last
    counted = list(command.blocks(few, 5 * photo + 3))
    assert [block.last - block.first for block in counted] == [5 * photo, 3]


def test_help_is_instant_and_names_every_door():
    code = (
        "import sys; from tests.fuzz import __main__ as command\n"
        "try: command.main(['--help'])\n"
        "except SystemExit as stop: assert stop.code == 0\n"
        "heavy = {'tensorflow', 'keras', 'numpy', 'OpenImageIO', 'av'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    assert all(name in answer.stdout.replace("\n", " ") for name in doors.DOORS)


def test_an_interruption_prints_the_table_so_far_and_leaves_nobody(tmp_path):
    run = [sys.executable, "-m", "tests.fuzz", "--door", "mask", "--out", str(tmp_path / "kept")]
    child = subprocess.Popen(
        run, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    time.sleep(6)
    os.kill(child.pid, signal.SIGINT)
    output, _ = child.communicate(timeout=30)
    assert child.returncode == 130
    assert b"| mask" in output and b"| all" in output
    for _ in range(100):  # Python's own helper ends a moment later
        try:
            os.killpg(child.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("a process is left")


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
