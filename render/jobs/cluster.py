"""Rendering on a Ray cluster: each shard is a task, which runs on another node if its node is lost.

All nodes see the folders of the corpus and of the inputs under the same paths. A shard is written
by the node that renders it, and a room that one node rendered lights the scenes of all nodes.
"""

import contextlib
import io
import logging
import os
import pickle
import socket
import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Any, TextIO

from . import nodes, resuming
from .description import Job
from .processes import TASKS_PER_PROCESS, THREAD_VARIABLES, Ticks

_RETRIES = 3  # how often a shard may lose its process, because a node is lost or memory runs out
_SECONDS_TO_ANSWER = 5
_START = (
    "start one with `ray start --head --port 6379` on one machine and `ray start --address "
    "FIRST:6379` on the others, then run this on one of them with `--ray FIRST:6379`"
)
# Ray's servers speak gRPC, and so HTTP/2: to this greeting, with empty settings, such a server
# answers with its own settings.
_GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
_SETTINGS = 4


class Cluster:
    """A Ray cluster, to be used like `processes.Pool`.

    Args:
        address: address for `ray.init`: `host:port`, or `auto` for the cluster of this machine.
        packages: names of packages; a node with other versions of them is refused, because its
            bytes might differ.
        start: called in each process with the job and the ticks; the process keeps the returned
            object for its tasks.
        job: the job to render. Every node must see its folder and its input files, and must be able
            to run its variant of Mitsuba.

    Raises:
        RuntimeError: if Ray is not installed, or no Ray cluster answers at the address.
    """

    def __init__(
        self, address: str, packages: Iterable[str], start: Callable[[Any, Ticks], Any], job: Job
    ):
        # Ray reads this variable when it is imported.
        os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
        try:
            import ray
        except ImportError as error:
            raise RuntimeError(
                "Ray is not installed: pip install '.[cluster]', here and on all nodes"
            ) from error
        self._ray = ray
        self._address = address
        self._unlike: set[str] = set()
        self._arguments = (resuming.versions(packages), nodes.processor(), start, job)
        _refuse_silence(address)

    def run(
        self,
        task: Callable,
        items: list,
        done: int,
        total: int,
        tell: Callable[[int, int], None],
    ) -> None:
        """Run `task` on each item, in any order, and wait for all; see `processes.Pool.run`.

        Raises:
            RuntimeError: if the cluster cannot be used, a task lost its process too often, or a
                task raised an OSError, ValueError or RuntimeError; the message names the node.
        """
        ray = self._ray
        with self._connected():
            board = self._board()
            work = self._work(task)
            pending = {work.remote(board, item): item for item in items}
            counts, losses = Counter[Hashable](), Counter[Hashable]()
            where: dict[Hashable, str] = {}
            living: dict[str, str] | None = None
            while pending:
                finished, _ = ray.wait(list(pending), timeout=0.2)
                # Read before the news, so that the news holds all reports of nodes lost by now.
                living, before = self._living(), living
                news = ray.get(board.take.remote())
                for item, (node, count) in news.items():
                    where[item] = node
                    # A shard that is rendered again counts from 1 again: the larger count is kept.
                    counts[item] = max(count, counts[item])
                if news:
                    tell(done + counts.total(), total)
                failures = {ref: failure for ref in finished if (failure := self._failure(ref))}
                for ref in set(finished) - failures.keys():
                    del pending[ref]
                lost = _lost(before, living)
                # If a node was cut off, Ray itself waits for minutes before it reports a failure.
                for ref, item in pending.items():
                    if where.get(item) in lost:
                        failures.setdefault(ref, "its node was lost")
                for ref, failure in failures.items():
                    item = pending.pop(ref)
                    losses[item] += 1
                    if losses[item] > _RETRIES:
                        raise RuntimeError(
                            f"a shard lost its process {losses[item]} times, last as {failure}. "
                            "Finished shards are kept; the same command goes on"
                        )
                    pending[work.remote(board, item)] = item
        tell(total, total)

    @contextlib.contextmanager
    def _connected(self) -> Iterator[None]:
        """Connect to the cluster as a driver, whose processes and tasks end with the context."""
        ray = self._ray
        with contextlib.redirect_stdout(_OneThread(sys.stdout)):
            try:
                ray.init(
                    self._address,
                    runtime_env={"env_vars": dict.fromkeys(THREAD_VARIABLES, "1")},
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                )
            except (OSError, ValueError, RuntimeError, ray.exceptions.RayError) as error:
                raise RuntimeError(
                    f"the Ray cluster {self._address} cannot be used "
                    f"({type(error).__name__}: {error}). If there is none, {_START}"
                ) from error
            try:
                yield
            finally:
                # `shutdown` prints repeated messages that Ray held back.
                with contextlib.redirect_stdout(io.StringIO()):
                    ray.shutdown()

    def _work(self, task: Callable) -> Any:
        """Return a remote function that runs `task` on an item; its expected errors name the node.

        The function takes the board and the item. It returns the node's address and whether the
        node's processor is like this machine's.
        """
        ray = self._ray
        pickled = ray.cloudpickle.dumps((nodes.work, *self._arguments, task))

        # An inner function is sent as code, so that a node without this package can report that.
        def work(board: Any, item: Hashable) -> tuple[str, bool]:
            node = ray.util.get_node_ip_address()
            # Waiting here makes sure that the driver knows the item's node if the node is lost.
            ray.get(board.put.remote(item, ray.get_runtime_context().get_node_id(), 0))
            try:
                run, *arguments = pickle.loads(pickled)
            except ImportError as error:
                raise RuntimeError(
                    f"node {node}: {error}: install '.[cluster]' there as here"
                ) from error
            try:
                return node, run(*arguments, board, item)
            except (OSError, ValueError, RuntimeError) as error:
                raise RuntimeError(f"node {node}: {error}") from error

        return ray.remote(num_cpus=1, max_calls=TASKS_PER_PROCESS, max_retries=0)(work)

    def _living(self) -> dict[str, str]:
        """Return the addresses, by node name, of the nodes that are alive and have processors."""
        return {
            node["NodeID"]: node["NodeManagerAddress"]
            for node in self._ray.nodes()
            if node["Alive"] and node["Resources"].get("CPU")
        }

    def _board(self) -> Any:
        """Start a `_Board` on this node, so that it is lost only together with this process."""
        ray = self._ray
        here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
            ray.get_runtime_context().get_node_id(), soft=False
        )
        board = ray.remote(num_cpus=0, max_restarts=-1, max_task_retries=-1)(_Board)
        return board.options(scheduling_strategy=here).remote()

    def _failure(self, finished: Any) -> str | None:
        """Return the reason why a finished task lost its process; None if the task succeeded.

        Raises:
            RuntimeError: if the task raised one.
        """
        ray = self._ray
        try:
            node, is_like = ray.get(finished)
        except ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, RuntimeError):
                raise RuntimeError(str(error.cause)) from error
            raise
        except ray.exceptions.RayError as error:
            return f"{type(error).__name__}: {error}".splitlines()[0].rstrip(".")
        if not is_like and node not in self._unlike:
            self._unlike.add(node)
            print(
                f"\nnode {node} has another kind of processor: what it renders may differ in the "
                "last digits from what is rendered here",
                file=sys.stderr,
            )
        return None


def _lost(before: dict[str, str] | None, living: dict[str, str]) -> set[str]:
    """Return the names of the nodes that were lost since `before`, and print a line for each."""
    known = before or {}
    lost = known.keys() - living.keys()
    for name in lost:
        print(f"\nnode {known[name]} is lost: its shards go to the others", file=sys.stderr)
    if not living and before != living:
        print("\nno node of the cluster has a processor: waiting for one to join", file=sys.stderr)
    return lost


class _OneThread(io.TextIOBase):
    """A standard output for this thread alone: Ray's threads print pages when a node is lost."""

    def __init__(self, stream: TextIO):
        self._stream, self._thread = stream, threading.get_ident()

    def write(self, text: str) -> int:
        return self._stream.write(text) if threading.get_ident() == self._thread else len(text)

    def flush(self) -> None:
        self._stream.flush()


class _Board:
    """A Ray actor that gathers each item's node and count until the driver takes them."""

    def __init__(self) -> None:
        self._news: dict[Hashable, tuple[str, int]] = {}

    def put(self, item: Hashable, node: str, count: int) -> None:
        self._news[item] = node, count

    def take(self) -> dict[Hashable, tuple[str, int]]:
        news, self._news = self._news, {}
        return news


def _refuse_silence(address: str) -> None:
    """Raise RuntimeError at once if no Ray cluster answers at the address; Ray takes minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdecimal():
        return
    reason = "nothing like Ray does"
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _SECONDS_TO_ANSWER) as peer:
            if os.environ.get("RAY_USE_TLS") == "1":
                return
            peer.sendall(_GREETING)
            answer = peer.recv(9)
            if len(answer) == 9 and answer[3] == _SETTINGS:
                return
    except (OSError, OverflowError) as error:
        reason = str(error)
    raise RuntimeError(f"no Ray cluster answers at {address} ({reason}): {_START}")
