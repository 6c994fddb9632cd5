"""Processes that render: one thread each, ended with their parent, their progress seen."""

import multiprocessing
import os
import queue
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

_TASKS_PER_PROCESS = 64
"""A process is replaced after so many, because Mitsuba keeps memory of every scene it loaded."""
_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Workers:
    """A pool of processes whose progress is seen and whose death is told.

    Args:
        count: of processes; 0 if there is nothing to run.
        start: called in each process with `arguments` and the queue on which it tells of progress
            by putting the number of things done.
        arguments: for `start`.
    """

    def __init__(self, count: int, start: Callable[..., None], *arguments: Any):
        self._count = count
        if not count:
            return
        # One thread of linear algebra a worker: more would fight for the cores, and sum in an order
        # that depends on their number. Children inherit it; this process computes nothing.
        os.environ |= dict.fromkeys(_THREAD_VARIABLES, "1")
        context = multiprocessing.get_context("spawn")
        self._ticks = context.Queue()
        self._pool = ProcessPoolExecutor(
            count,
            mp_context=context,
            initializer=start,
            initargs=(*arguments, self._ticks),
            max_tasks_per_child=_TASKS_PER_PROCESS,
        )

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        if not self._count:
            return
        if kind:
            # Workers ignore Ctrl-C; end them now, and with them only unfinished, partial files.
            for process in multiprocessing.active_children():
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)

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
            task: a function of a module, called in a worker.
            items: what it is called with.
            done: how many things were there before.
            total: how many there will be.
            tell: called with (done, total) whenever a worker tells of progress.

        Raises:
            RuntimeError: if a process died. What a task raises is raised here.
        """
        pending: set[Future] = {self._pool.submit(task, item) for item in items}
        while pending:
            finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
            try:
                while True:
                    done += self._ticks.get_nowait()
                    tell(done, total)
            except queue.Empty:
                pass
            for future in finished:
                try:
                    future.result()
                except BrokenProcessPool as error:
                    raise RuntimeError(
                        "a worker died: killed, out of memory, or a crash told above. Finished "
                        "shards are kept; the same command goes on, with --workers 1 if need be"
                    ) from error
        tell(total, total)
