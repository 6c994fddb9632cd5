"""Processes of a pool: their death is told, their places are taken."""

import multiprocessing
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import worker_tasks

from lime_keras.render.jobs import processes

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def environment_kept(monkeypatch):
    """A pool sets these for its processes."""
    for name in processes.THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")


def nothing(done, total):
    """Follows no progress."""


def test_a_file_that_kills_its_checker_is_named():
    pool = processes.Pool(1)
    with pytest.raises(RuntimeError, match=r"a process died, .* at one of .*huge\.png"):
        pool.map(worker_tasks.die, [("backgrounds", "huge.png")], nothing)


def test_an_interruption_ends_the_processes(tmp_path):
    def interrupt(done, total):
        raise InterruptedError("in the middle")

    paths = [tmp_path / "one", tmp_path / "other"]
    pool = processes.Pool(2, worker_tasks.begin)
    with pytest.raises(InterruptedError):
        pool.run(worker_tasks.tell_and_wait, paths, 0, 2, interrupt)
    signed = [path.read_text() for path in paths if path.exists()]
    assert any(signed) and not multiprocessing.active_children()
    for number in filter(None, signed):
        with pytest.raises(ProcessLookupError):
            os.kill(int(number), 0)


KILLING = """
import os, signal, time
from multiprocessing import resource_tracker
import worker_tasks
from lime_keras.render.jobs.processes import Pool

def kill(done, total):
    tracker = resource_tracker._resource_tracker
    os.kill(tracker._pid, signal.SIGKILL)
    while tracker._check_alive():
        time.sleep(0.01)

if __name__ == "__main__":
    print(Pool(1).map(worker_tasks.same, ["one", "two"], kill))
"""


def test_pythons_own_helper_may_be_killed_without_a_word(tmp_path):
    (tmp_path / "killing.py").write_text(KILLING)
    folders = os.pathsep.join(map(str, (ROOT, ROOT / "tests" / "fixtures")))
    answer = subprocess.run(
        [sys.executable, tmp_path / "killing.py"],
        env=os.environ | {"PYTHONPATH": folders},
        capture_output=True,  # to the end of the last process that holds standard error
        text=True,
        timeout=120,
    )
    assert (answer.stdout, answer.stderr) == ("['one', 'two']\n", "")


def test_processes_are_replaced_without_waiting_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 2)
    paths = [tmp_path / str(number) for number in range(5)]
    processes.Pool(1).run(worker_tasks.sign, paths, 0, 5, nothing)
    signed = [path.read_text() for path in paths]
    assert sorted(Counter(signed).values()) == [1, 2, 2]
    assert str(os.getpid()) not in signed
