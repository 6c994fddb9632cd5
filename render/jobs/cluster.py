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
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Any

from . import nodes
from .description import Job
from .processes import TASKS_PER_PROCESS, THREAD_VARIABLES, Ticks

_RETRIES = 3
"""How often a shard may lose its process, because a node is lost or memory runs out."""
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
        """Run `task` on each item, in any order, and wait for all; see `processes.Pool.run`.

        Raises:
            RuntimeError: if the cluster cannot be used, a task lost its process too often, or a
                task raised an OSError, ValueError or RuntimeError; the message names the node.
        """
        ray = self._ray
        with self._connected():
            work = self._work(task)
            pending = {work.remote(item): item for item in items}
            losses = Counter[Hashable]()
            while pending:
                for finished in ray.wait(list(pending))[0]:
                    item = pending.pop(finished)
                    try:
                        done += self._count(finished)
                    except ray.exceptions.RayError as error:
                        losses[item] += 1
                        if losses[item] > _RETRIES:
                            last = f"{type(error).__name__}: {error}".splitlines()[0].rstrip(".")
                            raise RuntimeError(
                                f"a shard lost its process {losses[item]} times, last as {last}. "
                                "Finished shards are kept; the same command goes on"
                            ) from error
                        pending[work.remote(item)] = item
                tell(done, total)
        tell(total, total)

    @contextlib.contextmanager
    def _connected(self) -> Iterator[None]:
        """Connect to the cluster as a driver, whose processes and tasks end with the context.

        Ray prints pages to standard output when a node is lost, and when it is shut down.
        """
        ray = self._ray
        with contextlib.redirect_stdout(io.StringIO()):
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
                ray.shutdown()

    def _work(self, task: Callable) -> Any:
        """Return a remote function that runs `task` on an item; its expected errors name the node.

        The function returns the node's address, whether the node's processor is like this
        machine's, and the number of things that are done.
        """
        ray = self._ray
        pickled = ray.cloudpickle.dumps((nodes.work, *self._arguments, task))

        # An inner function is sent as code, so that a node without this package can report that.
        def work(item: Hashable) -> tuple[str, bool, int]:
            node = ray.util.get_node_ip_address()
            try:
                run, *arguments = pickle.loads(pickled)
            except ImportError as error:
                raise RuntimeError(
                    f"node {node}: {error}: install lime-keras[cluster] there as here"
                ) from error
            try:
                return node, *run(*arguments, item)
            except (OSError, ValueError, RuntimeError) as error:
                raise RuntimeError(f"node {node}: {error}") from error

        return ray.remote(num_cpus=1, max_calls=TASKS_PER_PROCESS, max_retries=0)(work)

    def _count(self, finished: Any) -> int:
        """Return the number of things that a finished task has done.

        Raises:
            ray.exceptions.RayError: if the task lost its process. Errors of the task are raised
                too.
        """
        try:
            node, is_like, count = self._ray.get(finished)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from error
        if not is_like and node not in self._unlike:
            self._unlike.add(node)
            print(
                f"\nnode {node} has another kind of processor: what it renders may differ in the "
                "last digits from what is rendered here",
                file=sys.stderr,
            )
        return count


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
