"""Machines that render: a Ray cluster, each shard a task, which goes elsewhere if a node is lost.

All nodes see the corpus' folder, and those of the inputs, under the same paths: shards are written
where they are rendered, and the rooms that one node rendered light the scenes of all.
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

from . import nodes
from .description import Job
from .processes import TASKS_PER_PROCESS, THREAD_VARIABLES, Ticks

_RETRIES = 3
"""How often a shard may lose its process, to a node's end or for want of memory."""
_SECONDS_TO_ANSWER = 5
_START = (
    "start one with `ray start --head --port 6379` on one machine and `ray start --address "
    "FIRST:6379` on the others, then run this on one of them with `--ray FIRST:6379`"
)
# A gRPC server, as Ray's are, answers HTTP/2's first bytes and empty settings with its settings.
_GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
_SETTINGS = 4


class Cluster:
    """A Ray cluster to use like `processes.Workers`.

    Args:
        address: what `ray.init` takes: `host:port`, or `auto` for the cluster of this machine.
        packages: nodes with other versions of them are refused, whose bytes might differ.
        start: called in each process with the job and the ticks; what it returns, the process holds
            for the tasks.
        job: to be rendered; every node must see its folder and the files that were found for it,
            and have its choice's variant.

    Raises:
        RuntimeError: if Ray is not installed, or nothing like it answers at the address.
    """

    def __init__(
        self, address: str, packages: Iterable[str], start: Callable[[Job, Ticks], Any], job: Job
    ):
        # Read by Ray as it is imported.
        os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
        try:
            import ray
        except ImportError as error:
            raise RuntimeError(
                "Ray is not installed: pip install 'lime-keras[cluster]', here and on all nodes"
            ) from error
        self._ray = ray
        self._address = address
        self._unlike: set[str] = set()
        self._arguments = (nodes.versions(packages), nodes.processor(), start, job)
        _refuse_silence(address)

    def run(
        self,
        task: Callable,
        items: list,
        done: int,
        total: int,
        tell: Callable[[int, int], None],
    ) -> None:
        """Run `task` on each item, in any order, and wait for all; see `processes.Workers.run`.

        Raises:
            RuntimeError: if the cluster cannot be used, or a task lost its process too often. What
                a task raises is raised as one that names the node.
        """
        ray = self._ray
        with self._connected():
            board = self._board()
            work = self._work(task)
            pending = {work.remote(board, item): item for item in items}
            progress, losses = _Progress(), Counter[Hashable]()
            living: dict[str, str] | None = None
            while pending:
                finished, _ = ray.wait(list(pending), timeout=0.2)
                # Before the news: who is lost now has told all that it will.
                living, before = self._living(), living
                if progress.learn(ray.get(board.take.remote())):
                    tell(done + progress.counts.total(), total)
                failures = {ref: failure for ref in finished if (failure := self._failure(ref))}
                for ref in set(finished) - failures.keys():
                    del pending[ref]
                lost = _lost(before, living)
                # Ray itself waits for minutes for a node that was cut off.
                for ref, item in pending.items():
                    if progress.nodes.get(item) in lost:
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
        """Be a driver of the cluster; its processes and tasks end with the context."""
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
                # It prints what it held back of what it was to repeat.
                with contextlib.redirect_stdout(io.StringIO()):
                    ray.shutdown()

    def _work(self, task: Callable) -> Any:
        """A remote function of the board and an item, whose expected errors name the node.

        It gives the node's address and whether its processor is like this one.
        """
        ray = self._ray
        pickled = ray.cloudpickle.dumps((nodes.work, *self._arguments, task))

        # Inside a function it travels as code, so that a node without this package can say so.
        def work(board: Any, item: Hashable) -> tuple[str, bool]:
            node = ray.util.get_node_ip_address()
            # Waited for: from now on it is known what is lost with this node.
            ray.get(board.put.remote(item, ray.get_runtime_context().get_node_id(), 0))
            try:
                run, *arguments = pickle.loads(pickled)
            except ImportError as error:
                raise RuntimeError(
                    f"node {node}: {error}: install lime-keras[cluster] there as here"
                ) from error
            try:
                return node, run(*arguments, board, item)
            except (OSError, ValueError, RuntimeError) as error:
                raise RuntimeError(f"node {node}: {error}") from error

        return ray.remote(num_cpus=1, max_calls=TASKS_PER_PROCESS, max_retries=0)(work)

    def _living(self) -> dict[str, str]:
        """Addresses of the nodes that live and have processors, by their names."""
        return {
            node["NodeID"]: node["NodeManagerAddress"]
            for node in self._ray.nodes()
            if node["Alive"] and node["Resources"].get("CPU")
        }

    def _board(self) -> Any:
        """A board on this node, which is lost only with this process."""
        ray = self._ray
        here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
            ray.get_runtime_context().get_node_id(), soft=False
        )
        board = ray.remote(num_cpus=0, max_restarts=-1, max_task_retries=-1)(_Board)
        return board.options(scheduling_strategy=here).remote()

    def _failure(self, finished: Any) -> str | None:
        """How a task lost its process; None if it succeeded."""
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
    """Names of the nodes that are no more, which is told."""
    known = before or {}
    lost = known.keys() - living.keys()
    for name in lost:
        print(f"\nnode {known[name]} is lost: its shards go to the others", file=sys.stderr)
    if not living and before != living:
        print("\nno node of the cluster has a processor: waiting for one to join", file=sys.stderr)
    return lost


class _OneThread(io.TextIOBase):
    """Standard output for this thread alone; Ray's would print pages there when a node is lost."""

    def __init__(self, stream: TextIO):
        self._stream, self._thread = stream, threading.get_ident()

    def write(self, text: str) -> int:
        return self._stream.write(text) if threading.get_ident() == self._thread else len(text)

    def flush(self) -> None:
        self._stream.flush()


class _Progress:
    """Where the items' tasks are, and how far."""

    def __init__(self) -> None:
        self.nodes: dict[Hashable, str] = {}
        self.counts: Counter[Hashable] = Counter()

    def learn(self, news: dict[Hashable, tuple[str, int]]) -> bool:
        """Take up what is new; tell if anything is."""
        for item, (node, count) in news.items():
            self.nodes[item] = node
            # A shard that is rendered again counts from one again: what was seen stays.
            self.counts[item] = max(count, self.counts[item])
        return bool(news)


class _Board:
    """An actor: what is new of nodes and counts of the items since it was last asked."""

    def __init__(self) -> None:
        self._news: dict[Hashable, tuple[str, int]] = {}

    def put(self, item: Hashable, node: str, count: int) -> None:
        self._news[item] = node, count

    def take(self) -> dict[Hashable, tuple[str, int]]:
        news, self._news = self._news, {}
        return news


def _refuse_silence(address: str) -> None:
    """Find out now what Ray itself would take minutes to: that nobody answers, or not Ray."""
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
