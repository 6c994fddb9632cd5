"""Every fault a door may have is found and named, and the inputs go on after it."""

import dataclasses
import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from time import monotonic

import ctrl_c
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
    "swells": "GB of memory, and was ended",
}
"""What is said of each of the broken doors; the others have tests apart."""
COUNT = 2  # inputs of a door


def tried(scratch, *names, limits=broken_doors.LIMITS, count=2):
    """What becomes of the inputs of some of the broken doors, in order."""
    scratch.mkdir()
    found = workers.tried(
        {name: broken_doors.DOORS[name] for name in names},
        (Block(name, 0, COUNT) for name in names),
        seed=0,
        count=count,
        scratch=scratch,
        make=broken_doors.make,
        limits=limits,
    )
    return sorted(found, key=lambda one: (names.index(one.door), one.index))


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """What becomes of the inputs of each door, all read in one run."""
    return tried(tmp_path_factory.mktemp("fuzz") / "scratch", *FAULTS, "names")


def test_what_is_refused_by_name_does_not_fall_through(outcomes):
    found = [one for one in outcomes if one.door == "names"]
    assert [one.index for one in found] == list(range(COUNT))
    assert {one.verdict.kind for one in found} <= {verdicts.READ, verdicts.REFUSED}
    assert any("sound.bin is damaged: copy it again" in one.verdict.reason for one in found)


@pytest.mark.parametrize("door", FAULTS)
def test_a_fault_is_found_and_the_next_inputs_are_tried(door, outcomes, tmp_path):
    found = [one for one in outcomes if one.door == door]
    check(door, found, FAULTS[door], tmp_path)


def check(door, found, said, folder):
    """Nothing but the fault is said of any input, and the input is there to be looked at."""
    assert [one.index for one in found] == list(range(COUNT))
    fell = [one for one in found if one.verdict.kind == verdicts.FELL]
    assert fell and [one.verdict.reason for one in fell if said not in one.verdict.reason] == []
    report = Report([door], 0, folder / "kept")
    for one in fell:  # of copies, since it takes the files away
        copy = shutil.copytree(one.folder, folder / str(one.index))
        report.add(dataclasses.replace(one, folder=copy))
    kept = folder / "kept" / f"{door}-seed-0-index-{fell[0].index}"
    assert (kept / "input" / "sound.bin").read_bytes() != broken_doors.SOUND
    assert said in (kept / "reason.txt").read_text()
    assert report.tried == report.fell == len(fell)
    assert f"| {len(fell)} |" in " ".join(report.table().split())


def test_a_door_that_hangs_is_ended_and_where_it_hung_is_told(tmp_path):
    """Alone, as its limit is so short that a sound door might pass it on a busy machine."""
    found = tried(tmp_path / "scratch", "hangs", limits=verdicts.Limits(seconds=0.5), count=1)
    check("hangs", found, "hung: no end after", tmp_path)
    assert all("_hangs" in one.verdict.reason for one in found if one.verdict.reason)


@pytest.mark.parametrize(
    ("queued", "kind"), [(lambda pid: 0.0, verdicts.FELL), (lambda pid: monotonic(), verdicts.READ)]
)
def test_waiting_for_the_processor_is_no_hang(queued, kind, tmp_path, monkeypatch):
    monkeypatch.setattr(verdicts, "queued", queued)
    found = tried(tmp_path / "scratch", "dawdles", limits=verdicts.Limits(seconds=0.5), count=1)
    assert kind in {one.verdict.kind for one in found}
    assert all(one.verdict.kind in (kind, verdicts.READ) for one in found)


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not tell")
def test_two_processes_on_one_processor_wait_for_each_other():
    own, before = os.sched_getaffinity(0), verdicts.queued()
    os.sched_setaffinity(0, {min(own)})
    try:
        with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other:
            end = monotonic() + 1
            while monotonic() < end:
                pass
            assert verdicts.queued(other.pid) > 0.1
            other.kill()
    finally:
        os.sched_setaffinity(0, own)
    assert verdicts.queued() - before > 0.1
    assert verdicts.queued(other.pid) == 0


def test_memory_that_is_given_back_at_once_counts(tmp_path):
    (tmp_path / "sound.bin").write_bytes(broken_doors.SOUND[:-1])
    door, limits = broken_doors.DOORS["swelled"], broken_doors.LIMITS
    verdict = verdicts.judged(door, tmp_path, limits)
    assert verdict.kind == verdicts.FELL and "took 0.2 GB of memory" in verdict.reason
    assert verdicts.judged(door, tmp_path, verdicts.LIMITS).kind == verdicts.READ


def test_a_door_that_refuses_sound_inputs_ends_the_run(tmp_path):
    with pytest.raises(
        workers.Unsound, match=r"refuses-all, seed, undamaged: .* whatever it holds"
    ):
        tried(tmp_path / "scratch", "refuses-all", count=1)


def test_inputs_are_the_same_for_any_number_of_processes(outcomes, tmp_path):
    names = ("names-nothing", "stumbles")
    scratch = tmp_path / "scratch"
    one = tried(scratch, *names, count=1)
    other = [x for x in outcomes if x.door in names]
    assert [x.verdict.kind for x in one] == [x.verdict.kind for x in other]
    kept = [(x, y) for x, y in zip(one, other, strict=True) if x.verdict.kind == verdicts.FELL]
    assert len(kept) >= COUNT
    for x, y in kept:
        assert (x.folder / "sound.bin").read_bytes() == (y.folder / "sound.bin").read_bytes()


def test_blocks_follow_the_shares_up_to_the_count():
    few = {name: doors.DOORS[name] for name in ("photo", "run")}
    [photo, run] = (door.share for door in few.values())
    whole = list(itertools.islice(command.blocks(few, None), 4))
    assert [block.last - block.first for block in whole] == [5 * photo, 5 * run] * 2
    assert whole[2].first == whole[0].last and whole[3].first == whole[1].last
    counted = list(command.blocks(few, 5 * photo + 3))
    assert [block.last - block.first for block in counted] == [5 * photo, 3]


def test_an_interruption_prints_the_table_so_far_and_leaves_nobody(tmp_path):
    run = [sys.executable, "-m", "tests.fuzz", "--door", "mask", "--out", str(tmp_path / "kept")]
    child = subprocess.Popen(
        run,
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=ctrl_c.is_heard,
    )
    wait_for(lambda: [*tmp_path.glob("lime-fuzz-*/worker-0.txt")], 60)
    os.kill(child.pid, signal.SIGINT)
    output, _ = child.communicate(timeout=60)
    assert child.returncode == 130
    assert b"| mask" in output and b"| all" in output
    wait_for(lambda: not is_alive(child.pid), 10)  # Python's own helper ends a moment later
    assert not [*tmp_path.glob("lime-fuzz-*")]


def wait_for(is_so, seconds):
    """Wait until it is so; fail after so many seconds."""
    end = monotonic() + seconds
    while not is_so():
        assert monotonic() < end
        time.sleep(0.05)


def is_alive(group):
    """Whether any process of a group is left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


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
