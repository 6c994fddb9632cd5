"""Worker processes, with one thread each, that report progress and end with their parent."""

import contextlib
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Generator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol

TASKS_PER_PROCESS = 16
"""Number of tasks after which a process is replaced, as Mitsuba keeps memory of every scene."""
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Ticks(Protocol):
    """The object to which a task reports its progress."""

    def put(self, count: int, /) -> None:
        """Report that `count` more things are done."""


class Pool:
    """Processes that report their progress; the death of a process is an error.

    Args:
        count: number of processes.
        start: called in each process with `arguments` and the ticks; the process keeps the returned
            object for the tasks of `run`. By default, nothing is called.
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
        self._arguments = (*arguments, self._ticks)

    def run(
        self,
        task: Callable,
        items: list,
        done: int,
        total: int,
        tell: Callable[[int, int], None],
    ) -> None:
        """Run `task` on each item, in any order, and wait for all.

        Args:
            task: a function of a module, called with the object that `start` returned in its
                process and an item.
            items: items to work on.
            done: number of things that are done already.
            total: number of things that will be done in the end.
            tell: called with (done, total) whenever a worker reports progress.

        Raises:
            RuntimeError: if a process died. Errors of a task are raised too.
        """
        share = self._count * TASKS_PER_PROCESS
        for first in range(0, len(items), share):
            # `closing` ends the processes at once on Ctrl-C; otherwise they would live as long as
            # the traceback.
            try:
                with contextlib.closing(
                    self._finished(_run, [(task, item) for item in items[first : first + share]])
                ) as turns:
                    for _ in turns:
                        with contextlib.suppress(queue.Empty):
                            while True:
                                done += self._ticks.get_nowait()
                                tell(done, total)
            except BrokenProcessPool as error:
                raise RuntimeError(
                    "a worker died: killed, out of memory, or a crash (see above). Finished shards "
                    "are kept; the same command goes on, with --workers 1 if need be"
                ) from error
        tell(total, total)

    def map(self, task: Callable, items: list, tell: Callable[[int, int], None]) -> list:
        """Return the results of `task` for each item, in order.

        Args:
            task: a function of a module, called in a worker with an item.
            items: items to work on.
            tell: called with (done, total) whenever results arrive.

        Raises:
            RuntimeError: if a process died. Errors of a task are raised too.
        """
        results: dict[int, Any] = {}
        try:
            with contextlib.closing(self._finished(task, items)) as turns:
                for finished in turns:
                    results |= finished
                    tell(len(results), len(items))
        except BrokenProcessPool as error:
            left = [str(item) for number, item in enumerate(items) if number not in results]
            raise RuntimeError(
                f"a process died, killed or out of memory, at one of {', '.join(left[:5])}"
                f"{f' and {len(left) - 5} more' if len(left) > 5 else ''}"
            ) from error
        return [results[number] for number in range(len(items))]

    def _finished(self, task: Callable, items: list) -> Generator[dict[int, Any], None, None]:
        """Run `task` on each item in new processes; yield dicts, also empty ones, of new results.

        The keys are the numbers of the items.
        """
        if not items:
            return
        # Without `max_tasks_per_child`, with which the pool of Python 3.11 can hang.
        pool = ProcessPoolExecutor(
            min(self._count, len(items)),
            mp_context=self._context,
            initializer=_begin,
            initargs=(self._start, *self._arguments),
        )
        try:
            numbers: dict[Future, int] = {
                pool.submit(task, item): number for number, item in enumerate(items)
            }
            pending = set(numbers)
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                yield {numbers[future]: future.result() for future in finished}
        except BrokenProcessPool:
            raise
        except BaseException:
            # Workers ignore Ctrl-C, so they are ended here; only partial files are lost.
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_held: Any = None
"""The object that `start` returned in this process; a pool offers its tasks no better place."""


def _run(work: tuple[Callable[[Any, Any], None], Any]) -> None:
    task, item = work
    task(_held, item)


def _begin(start: Callable[..., Any] | None, *arguments: Any) -> None:
    """Set up a process that ignores Ctrl-C, which its parent handles, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    if start is not None:
        global _held
        _held = start(*arguments)


def _end_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)
