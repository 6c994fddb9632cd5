"""What a process of a cluster's node does: makes sure it renders the same bytes, then renders."""

import dataclasses
import importlib.metadata
import json
import platform
from collections.abc import Callable, Hashable, Iterable
from typing import Any

import numpy as np

from lime_keras.version import __version__

from ..mitsuba_setup import variants
from . import inputs
from .description import Job
from .processes import Ticks


class _Ticks:
    """What a task tells of progress to, as to a queue."""

    def __init__(self, board: Any):
        import ray

        self._board, self._node = board, ray.get_runtime_context().get_node_id()

    def begin(self, item: Hashable) -> None:
        self._item, self._count = item, 0

    def put(self, count: int) -> None:
        self._count += count
        self._board.put.remote(self._item, self._node, self._count)


_begun: tuple[_Ticks, Any] | None = None
"""The ticks of this process and what `start` returned: Ray offers its tasks no other place."""


def work(
    wanted: dict[str, str],
    like: list[str],
    start: Callable[[Job, Ticks], Any],
    job: Job,
    task: Callable,
    board: Any,
    item: Hashable,
) -> bool:
    """Run one task in this process, which is set up for the first.

    Args:
        wanted: `versions` of the machine that asks.
        like: its `processor`.
        start: called once with the job, whose library is now this node's, and the ticks; what it
            returns is held for the tasks.
        job: as `cluster.Cluster` takes it.
        task: called with what is held and the item.
        board: actor that gathers the progress.
        item: what the task works on.

    Returns:
        Whether the processors are alike.

    Raises:
        RuntimeError: if this node would render other bytes. What the task raises is raised here.
    """
    global _begun
    if _begun is None:
        _refuse_other_versions(wanted)
        _refuse_other_files(job)
        ticks = _Ticks(board)
        own = dataclasses.replace(job, choice=_own_choice(job.choice))
        _begun = ticks, start(own, ticks)
    ticks, held = _begun
    ticks.begin(item)
    task(held, item)
    return processor() == like


def processor() -> list[str]:
    """What NumPy sees of this machine's processor, and chooses its loops by."""
    found = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    return [platform.machine(), *found]


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Versions of packages and of this one, by name."""
    return {name: _version(name) for name in packages} | {"lime-keras": __version__}


def _refuse_other_versions(wanted: dict[str, str]) -> None:
    held = versions(wanted.keys() - {"lime-keras"})
    differing = [name for name in wanted if held[name] != wanted[name]]
    if differing:
        raise RuntimeError(
            ", ".join(f"{name} {held[name]} there, {wanted[name]} here" for name in differing)
            + ": the bytes may depend on them, so install the same on all nodes"
        )


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _refuse_other_files(job: Job) -> None:
    path = job.split.description_path
    if not path.is_file():
        raise RuntimeError(
            f"{path} is not seen there: the corpus must be in a folder that all nodes share, under "
            "the same path"
        )
    if json.loads(path.read_text(encoding="utf-8")) != job.recorded():
        raise RuntimeError(
            f"{path} is another split's there: all nodes must share the corpus' folder, under the "
            "same path"
        )
    try:
        inputs.inspect(
            job.files(),
            inputs.read(job.split.inputs_path),
            lambda check, files: [check(file) for file in files],
        )
    except ValueError as error:
        raise RuntimeError(
            f"{error}; all nodes must share the folders of inputs, under the same paths"
        ) from error


def _own_choice(wanted: variants.Choice) -> variants.Choice:
    """The same variant with this node's library, wherever it lies."""
    if wanted.library is None:
        return wanted
    own = variants.choose()
    if own.variant != wanted.variant:
        raise RuntimeError(
            f"{wanted.variant} cannot run there for want of a usable libLLVM: `python -m "
            "lime_keras.render.mitsuba_setup.fetch_llvm` there, with the Python that runs Ray, may "
            "mend it"
        )
    return own
