"""Worker processes, with one thread each, that report progress and end with their parent."""

import contextlib
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

TASKS_PER_PROCESS = 16
"""Number of tasks after which a process is replaced, as Mitsuba keeps memory of every scene."""
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

OnProgress = Callable[[int, int], None]
"""A function that is called with (done, total) as work goes on."""


class Pool:
    """Processes that report their progress; the death of a process is an error.

    Args:
        count: number of processes.
        start: called in each process with `arguments` and a function to report with how many more
            things are done; the process keeps the returned object for the tasks of `run`. Such
            processes are replaced after `TASKS_PER_PROCESS` tasks. By default, nothing is called.
        arguments: arguments for `start`.
    """

    def __init__(self, count: int, start: Callable[..., Any] | None = None, *arguments: Any):
        self._count = count
        # One thread of linear algebra in each worker: more threads would compete for the cores, and
        # the order of their sums would depend on their number. Child processes inherit the setting;
        # this process computes nothing.
        os.environ |= dict.fromkeys(THREAD_VARIABLES, "1")
        self._context = multiprocessing.get_context("spawn")
        self._ticks = self._context.Queue()
        self._start = start
        self._arguments = (*arguments, self._ticks.put)

    def run(self, task: Callable, items: Sequence, done: int, total: int, tell: OnProgress) -> list:
        """Run `task` on each item, in any order, and wait for all.

        Args:
            task: a function of a module. It is called in a process with the object that `start`
                returned there, and an item; without `start`, with an item alone.
            items: items to work on.
            done: number of things that are done already.
            total: number of things that will be done in the end.
            tell: called with (done, total) as work goes on. Things are what processes report;
                without `start`, they are the items.

        Returns:
            The results, in the order of the items.

        Raises:
            RuntimeError: if a process died. Errors of a task are raised too.
        """
        results: dict[int, Any] = {}
        share = self._count * TASKS_PER_PROCESS if self._start else max(1, len(items))
        for first in range(0, len(items), share):
            turn = range(len(items))[first : first + share]
            # Without `max_tasks_per_child`, with which the pool of Python 3.11 can hang.
            pool = ProcessPoolExecutor(
                min(self._count, len(turn)),
                mp_context=self._context,
                initializer=_begin,
                initargs=(self._start, *self._arguments),
            )
            try:
                numbers = {pool.submit(_run, task, items[number]): number for number in turn}
                pending = set(numbers)
                while pending:
                    finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                    results |= {numbers[future]: future.result() for future in finished}
                    if more := self._reported() if self._start else len(finished):
                        done += more
                        tell(done, total)
            except BrokenProcessPool as error:
                left = [str(item) for number, item in enumerate(items) if number not in results]
                others = f" and {len(left) - 5} more" if len(left) > 5 else ""
                raise RuntimeError(
                    "a worker died: killed, out of memory, or a crash (see above), at one of "
                    f"{', '.join(left[:5])}{others}. What is finished is kept; the same command "
                    "goes on, with --workers 1 if need be"
                ) from error
            except BaseException:
                # Workers ignore Ctrl-C, so they are ended here; only partial files are lost.
                for process in multiprocessing.active_children():
                    process.terminate()
                raise
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
        if items:
            tell(total, total)
        return [results[number] for number in range(len(items))]

    def _reported(self) -> int:
        """Return how many things processes have reported since the last call."""
        count = 0
        with contextlib.suppress(queue.Empty):
            while True:
                count += self._ticks.get_nowait()
        return count


_held: tuple[Any, ...] = ()
"""The object that `start` returned in this process; a pool offers its tasks no better place."""


def _run(task: Callable, item: Any) -> Any:
    return task(*_held, item)


def _begin(start: Callable[..., Any] | None, *arguments: Any) -> None:
    """Set up a process that ignores Ctrl-C, which its parent handles, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    if start is not None:
        global _held
        _held = (start(*arguments),)


def _end_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)
