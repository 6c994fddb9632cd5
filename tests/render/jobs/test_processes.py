"""Processes of a pool: their death is told, their places are taken."""

import multiprocessing
import os
from collections import Counter

import pytest
import worker_tasks
from no_progress import nothing

from lime_keras.render.jobs import processes


@pytest.fixture(autouse=True)
def environment_kept(monkeypatch):
    """A pool sets these for its processes."""
    for name in processes.THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")


def test_a_file_that_kills_its_checker_is_named():
    pool = processes.Pool(1)
    with pytest.raises(RuntimeError, match=r"a worker died: .* at one of .*huge\.png"):
        pool.run(worker_tasks.die, [("backgrounds", "huge.png")], 0, 1, nothing)


def test_results_come_in_the_order_of_the_items_and_each_is_counted():
    told = []
    pool, items = processes.Pool(2), list(range(5))
    assert pool.run(worker_tasks.same, items, 0, 5, lambda *done: told.append(done)) == items
    assert told == sorted(told) and told[-1] == (5, 5)
    assert pool.run(worker_tasks.same, [], 0, 0, pytest.fail) == []


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


def test_processes_are_replaced_without_waiting_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 2)
    paths = [tmp_path / str(number) for number in range(5)]
    processes.Pool(1, worker_tasks.begin).run(worker_tasks.sign, paths, 0, 5, nothing)
    signed = [path.read_text() for path in paths]
    assert sorted(Counter(signed).values()) == [1, 2, 2]
    assert str(os.getpid()) not in signed
