"""The work of a process on a cluster node: check that it renders the same bytes, then render."""

import dataclasses
import platform
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

from lime_keras.io import untrusted

from ..mitsuba_setup import variants
from . import inputs, resuming
from .description import Job
from .processes import Ticks


class _Ticks:
    """The ticks of this process (see `processes.Ticks`), which send counts to the board."""

    def __init__(self, board: Any):
        import ray

        self._board, self._node = board, ray.get_runtime_context().get_node_id()

    def begin(self, item: Hashable) -> None:
        self._item, self._count = item, 0

    def put(self, count: int) -> None:
        self._count += count
        self._board.put.remote(self._item, self._node, self._count)


_begun: tuple[_Ticks, Any] | None = None
"""The ticks of this process and the object that `start` returned; Ray offers no better place."""


def work(
    wanted: dict[str, str],
    like: list[str],
    start: Callable[[Any, Ticks], Any],
    job: Job,
    task: Callable,
    board: Any,
    item: Hashable,
) -> bool:
    """Run one task in this process; before its first task, check and set up the process.

    Args:
        wanted: `resuming.versions` of the machine that started the rendering.
        like: `processor` of that machine.
        start: called once with the job, whose library is then this node's, and the ticks; the
            process keeps the returned object for its tasks.
        job: the job to render (see `cluster.Cluster`).
        task: called with the object that `start` returned and the item.
        board: actor that gathers the progress.
        item: item that the task works on.

    Returns:
        Whether this node's processor is like that of the machine that started the rendering.

    Raises:
        RuntimeError: if this node would render other bytes. Errors of the task are raised too.
    """
    global _begun
    if _begun is None:
        _refuse_other_versions(wanted)
        _refuse_other_files(job)
        ticks = _Ticks(board)
        own = dataclasses.replace(job, choice=_own_choice(job.choice))
        _begun = ticks, start(own, ticks)
    ticks, state = _begun
    ticks.begin(item)
    task(state, item)
    return processor() == like


def processor() -> list[str]:
    """Return the architecture and the SIMD extensions by which NumPy chooses its loops here."""
    extensions = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    return [platform.machine(), *extensions]


def _refuse_other_versions(wanted: dict[str, str]) -> None:
    held = resuming.versions(wanted.keys() - {"lime-keras"})
    differing = [name for name in wanted if held[name] != wanted[name]]
    if differing:
        raise RuntimeError(
            ", ".join(f"{name} {held[name]} there, {wanted[name]} here" for name in differing)
            + ": the bytes may depend on them, so install the same on all nodes"
        )


def _refuse_other_files(job: Job) -> None:
    path = job.split.description_path
    if not path.is_file():
        raise RuntimeError(
            f"{path} is not seen there: the corpus must be in a folder that all nodes share, under "
            "the same path"
        )
    if untrusted.read_json(path) != job.description.recorded():
        raise RuntimeError(
            f"{path} is another split's there: all nodes must share the corpus' folder, under the "
            "same path"
        )
    try:
        inputs.inspect(
            job.description.files(),
            inputs.read(job.split.inputs_path),
            lambda check, files: [check(file) for file in files],
        )
    except ValueError as error:
        raise RuntimeError(
            f"{error}; all nodes must share the folders of inputs, under the same paths"
        ) from error


def _own_choice(wanted: variants.Choice) -> variants.Choice:
    """Return the wanted variant, with the libLLVM of this node where it needs one.

    Raises:
        RuntimeError: if this node cannot run the variant.
    """
    if wanted.variant == variants.SLOW:
        return wanted
    own = variants.choose(variants.device_of(wanted.variant))
    if own.variant != wanted.variant:
        raise RuntimeError(
            f"{wanted.variant} cannot run there for want of a usable libLLVM: `python -m "
            "lime_keras.render.mitsuba_setup.fetch_llvm` there, with the Python that runs Ray, may "
            "mend it"
        )
    return own
