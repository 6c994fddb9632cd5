"""Processes that render: one thread each, ended with their parent, their progress seen."""

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
"""Processes are replaced after so many shards, as Mitsuba keeps memory of every scene it loaded."""
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Ticks(Protocol):
    """Where a task tells of progress."""

    def put(self, count: int, /) -> None:
        """Tell that so many more things are done."""


class Workers:
    """A pool of processes whose progress is seen and whose death is told.

    Args:
        count: of processes.
        start: called in each process with `arguments` and the ticks; what it returns, the process
            holds for the tasks of `run`. Nothing is set up by default.
        arguments: for `start`.
    """

    def __init__(self, count: int, start: Callable[..., Any] | None = None, *arguments: Any):
        self._count = count
        # One thread of linear algebra a worker: more would fight for the cores, and sum in an order
        # that depends on their number. Children inherit it; this process computes nothing.
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
            task: a function of a module, called with what its process holds and an item.
            items: to work on.
            done: how many things were there before.
            total: how many there will be.
            tell: called with (done, total) whenever a worker tells of progress.

        Raises:
            RuntimeError: if a process died. What a task raises is raised here.
        """
        share = self._count * TASKS_PER_PROCESS
        for first in range(0, len(items), share):
            # Closed at once on Ctrl-C, not when the traceback is let go; that ends the processes.
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
                    "a worker died: killed, out of memory, or a crash told above. Finished shards "
                    "are kept; the same command goes on, with --workers 1 if need be"
                ) from error
        tell(total, total)

    def map(self, task: Callable, items: list, tell: Callable[[int, int], None]) -> list:
        """What `task` gives for each item, in order.

        Args:
            task: a function of a module, called in a worker.
            items: what it is called with.
            tell: called with (done, total) as results come.

        Raises:
            RuntimeError: if a process died. What a task raises is raised here.
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
        """Run items in processes made for them; yield new results by number, if but empty."""
        if not items:
            return
        # Not `max_tasks_per_child`, with which Python 3.11's pool can wait for ever.
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
            # Workers ignore Ctrl-C; end them now, and with them only unfinished, partial files.
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_held: Any = None
"""What `start` returned in this process: a pool offers its tasks no other place."""


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
