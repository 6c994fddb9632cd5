"""The rendering of a split: independent shards, written atomically by worker processes.

Inputs are checked, the folder is claimed, and what is missing is rendered. The bytes of a shard
depend on the split's description and the shard's number alone, not on the number of workers, nor on
interruptions. A finished shard is never written again.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import SPLITS, Split
from lime_keras.io import locking

from ..jobs import inputs, resuming
from ..jobs.description import Description, Job
from ..jobs.processes import OnProgress, Pool
from ..mitsuba_setup import variants
from . import worker

_WORK = "lime-render is rendering"


def render_split(
    out: Path,
    description: Description,
    choice: variants.Choice,
    *,
    workers: int,
    part: tuple[int, int] = (1, 1),
    skip_unusable: bool = False,
    on_input: OnProgress,
    on_room: OnProgress,
    on_example: OnProgress,
) -> dict[str, Any] | None:
    """Render the missing shards of a split, or of a part of it, and write a whole split's manifest.

    Args:
        out: folder of the corpus.
        description: description of the split.
        choice: variant and library of Mitsuba.
        workers: number of worker processes.
        part: (K, N), of which each Nth shard is rendered, from the Kth on. Processes that share the
            folder may each render another part at once.
        skip_unusable: whether unusable input files are left out; else they are an error.
        on_input: called with (done, total) as input files are checked.
        on_room: called with (done, total) as the built-in rooms are rendered.
        on_example: called with (done, total) as examples are rendered; examples of finished shards
            count from the start.

    Returns:
        The manifest; None if shards of other parts are missing.

    Raises:
        ValueError: if the folder holds a split of another description, or an input is unusable.
        RuntimeError: if a worker died, or another process renders the same. Finished shards are
            kept.
    """
    number, parts = part
    shards = range(number - 1, description.shards, parts)
    readers, job = Pool(workers), Job(out.absolute(), description, choice)
    # Check the inputs before the folder is made, so that an unusable file leaves nothing.
    begun = _refuse_another(job)
    known = None if begun is None else inputs.read(job.split.inputs_path)
    files = description.files()
    findings = _inspect(files, readers, known, on_input)
    skip = skip_unusable or known is not None
    job = dataclasses.replace(job, usable=inputs.usable(files, findings, skip=skip))
    _refuse_clashes(job, findings)
    # Claim the folder, and render what is missing.
    folder = job.split.folder
    own = folder / f"part-{number}-of-{parts}"
    with (
        locking.lock_folder(folder, _WORK, shared=parts > 1),
        locking.lock_folder(own, _WORK) if parts > 1 else contextlib.nullcontext(),
    ):
        # Of parts that begin at once, one says what is rendered, and from which files.
        resuming.claim(job.split.description_path, description.recorded())
        _refuse_another(job)
        resuming.claim(job.split.inputs_path, inputs.recorded(findings))
        findings = _inspect(files, readers, inputs.read(job.split.inputs_path), on_input)
        job = dataclasses.replace(job, usable=inputs.usable(files, findings, skip=True))
        resuming.write_json(job.split.inputs_path, inputs.recorded(findings), shared=True)
        _render_missing(job, shards, Pool(workers, worker.Worker, job), on_room, on_example)
        # A file that changed meanwhile may be in some shards only.
        _inspect(description.files(), readers, findings, on_input)
        if job.missing(range(description.shards)):
            return None
        manifest = _manifest(job, findings)
        resuming.write_json(job.split.manifest_path, manifest, shared=True)
    return manifest


def _refuse_another(job: Job) -> dict[str, Any] | None:
    """Return the description of the job's folder; ValueError is raised if it is of another job."""
    begun = resuming.read_description(job.split.description_path)
    if begun is None:
        if any(job.split.folder.glob("*.tfrecord")):
            raise ValueError(
                f"{job.split.folder} holds shards and no {job.split.description_path.name}, which "
                "says what they are: restore it, or remove the folder"
            )
        return None
    asked = job.description.recorded()
    differing = [
        f"{key} {begun.get(key)} there, {asked.get(key)} asked"
        for key in sorted(asked | begun)
        if asked.get(key) != begun.get(key)
    ]
    if differing:
        raise ValueError(
            f"{job.split.folder} holds another split: {', '.join(differing)}. Pass another "
            "folder, the same options, or remove it"
        )
    return begun


def _inspect(
    files: dict[str, list[Path]], pool: Pool, known: inputs.Findings | None, tell: OnProgress
) -> inputs.Findings:
    return inputs.inspect(
        files, known, lambda task, items: pool.run(task, items, 0, len(items), tell)
    )


def _render_missing(
    job: Job, shards: range, renderers: Pool, on_room: OnProgress, on_example: OnProgress
) -> None:
    """Render what is missing of some shards, and of the rooms that light these."""
    _remove_partials(job, shards)
    unfinished = job.missing(shards)
    rooms = _rooms(job, unfinished)
    missing = [name for name in rooms if not (job.split.folder / "rooms" / name).is_file()]
    if missing:
        finished = len(rooms) - len(missing)
        renderers.run(worker.Worker.render_room, missing, finished, len(rooms), on_room)
    count, left = (
        sum(len(job.description.indices(shard)) for shard in some) for some in (shards, unfinished)
    )
    on_example(count - left, count)
    if unfinished:
        renderers.run(worker.Worker.render_shard, unfinished, count - left, count, on_example)
    _remove_partials(job, shards)


def _remove_partials(job: Job, shards: range) -> None:
    """Remove what killed processes left of some shards, and the rest once no shard is missing."""
    split = job.split
    own = {path(shard).name for shard in shards for path in (split.shard_path, split.sidecar_path)}
    for partial in split.folder.glob("partial-*"):
        # Beside a part, others may be writing.
        if shards.step == 1 or partial.name.rpartition("-")[2] in own:
            partial.unlink(missing_ok=True)
    if not job.missing(range(job.description.shards)):
        # Another part may be writing the manifest.
        stale = split.folder.glob("partial-*.tfrecord"), split.folder.glob("rooms/partial-*")
        for partial in itertools.chain(*stale):
            partial.unlink(missing_ok=True)
        for claim in split.folder.glob("part-*-of-*"):
            with contextlib.suppress(OSError):
                claim.rmdir()


def _refuse_clashes(job: Job, findings: inputs.Findings) -> None:
    """Raise ValueError if the split may not stand beside the other one, where that was begun."""
    other = Split(job.out, next(name for name in SPLITS if name != job.description.split))
    theirs = inputs.read(other.inputs_path)
    beside = resuming.read_description(other.description_path)
    if theirs is None or beside is None:
        return
    used = inputs.digests(findings), inputs.digests(theirs)
    for clash in inputs.clashes((job.description.recorded(), beside), used):
        raise ValueError(f"{job.split.folder}: {clash}")


def _manifest(job: Job, findings: inputs.Findings) -> dict[str, Any]:
    """Return the manifest of a complete split, put together from the sidecars of its shards."""
    paths = map(job.split.sidecar_path, range(job.description.shards))
    sidecars = [resuming.sidecar(path) for path in paths]
    sources, size = worker.sources_of(job), job.description.shard_size
    # The bodies drawn are listed shapes, and endless ones.
    drawn = [sources.names_in_shard(shard, size)[0] for shard in range(job.description.shards)]
    return {
        # Shards may have different versions, if the software was changed in between.
        "packages": {
            name: ", ".join(sorted({sidecar["packages"][name] for sidecar in sidecars}))
            for name in sidecars[0]["packages"]
        },
        "description": job.description.recorded(),
        "shards": job.description.shards,
        "examples": job.description.count,
        "sha256": [sidecar["sha256"] for sidecar in sidecars],
        "failures": [failure for sidecar in sidecars for failure in sidecar["failures"]],
        "shapes": list(dict.fromkeys(itertools.chain(sources.shape_names, *drawn))),
        "lights": sources.light_names,
        "inputs": inputs.digests(findings),
        "skipped": inputs.unusable(findings),
        "repaired": inputs.repairs(findings),
    }


def _rooms(job: Job, shards: Sequence[int]) -> list[str]:
    """Return the names of the built-in rooms that light some shards."""
    sources, drawn = worker.sources_of(job), set[str]()
    for shard in shards if sources.room_names else []:
        drawn |= sources.maps_in_shard(shard, job.description.shard_size)
    return [name for name in sources.room_names if name in drawn]
