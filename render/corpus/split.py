"""The rendering of a split: independent shards, written atomically by worker processes.

The bytes of a shard depend on the split's description and the shard's number alone, not on the
number of workers, nor on interruptions. A finished shard is never written again.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import SPLITS, Split
from lime_keras.io import locking

from ..mitsuba_setup import variants
from . import claim, cluster, inputs, worker
from .description import Description, Job
from .processes import Workers


def render_split(
    out: Path,
    description: Description,
    choice: variants.Choice,
    *,
    workers: int,
    ray: str | None = None,
    skip_unusable: bool = False,
    on_input: Callable[[int, int], None],
    on_room: Callable[[int, int], None],
    on_example: Callable[[int, int], None],
) -> dict[str, Any]:
    """Render the missing shards of a split and write its manifest.

    Args:
        out: folder of the corpus.
        description: description of the split.
        choice: variant and library of Mitsuba.
        workers: number of worker processes.
        ray: address of a Ray cluster, which then renders instead of the worker processes.
        skip_unusable: whether unusable input files are left out; else they are an error.
        on_input: called with (done, total) as input files are checked.
        on_room: called with (done, total) as the built-in rooms are rendered.
        on_example: called with (done, total) as examples are rendered; examples of finished shards
            count from the start.

    Returns:
        The manifest.

    Raises:
        ValueError: if the folder holds a split of another description, or an input is unusable.
        RuntimeError: if a worker died, or the cluster cannot be used. Finished shards are kept.
    """
    job = Job(out.absolute(), description, choice)
    split = Split(out, description.split)
    held = claim.held(split.description_path)
    claim.refuse_another(split.folder, "split", held, job.recorded())
    # Inputs are checked first, so that an unusable file fails before the split's folder is made.
    pool = Workers(workers)

    def inspected(known: inputs.Findings | None) -> inputs.Findings:
        return inputs.inspect(
            job.files(), known, lambda task, items: pool.map(task, items, on_input)
        )

    findings = inspected(inputs.read(split.inputs_path) if held is not None else None)
    if held is None and not skip_unusable:
        inputs.refuse(findings)
    job = dataclasses.replace(job, usable=inputs.usable(findings))
    _refuse_shared_inputs(job, findings)
    renderers: cluster.Cluster | Workers
    if ray:
        renderers = cluster.Cluster(ray, worker.PACKAGES, worker.start, job)
    else:
        renderers = Workers(workers, worker.start, job)
    with locking.lock_folder(split.folder, "lime-render is rendering"):
        claim.write_json(split.description_path, job.recorded())
        inputs.write(split.inputs_path, findings)
        manifest = _render_missing(job, renderers, findings, on_room, on_example)
        inspected(findings)  # a file that changed meanwhile may be in some shards only: an error
        claim.write_json(split.manifest_path, manifest)
    return manifest


def _render_missing(
    job: Job,
    renderers: cluster.Cluster | Workers,
    findings: inputs.Findings,
    on_room: Callable[[int, int], None],
    on_example: Callable[[int, int], None],
) -> dict[str, Any]:
    """Render the rooms and shards that are missing, and return the manifest."""
    description, lights = job.description, job.lights.names()
    claim.remove_partials(job.split.folder, job.split.folder / "rooms")
    rooms = [] if description.environments else lights
    missing_rooms = [name for name in rooms if not (job.lights.cache / name).is_file()]
    missing = [n for n in range(description.shards) if not _is_finished(job.split, n)]
    done = description.count - sum(len(description.indices(shard)) for shard in missing)
    if missing and missing_rooms:
        finished = len(rooms) - len(missing_rooms)
        renderers.run(worker.render_room, missing_rooms, finished, len(rooms), on_room)
    on_example(done, description.count)
    if missing:
        renderers.run(worker.render_shard, missing, done, description.count, on_example)
    # A lost node may have left some.
    claim.remove_partials(job.split.folder, job.split.folder / "rooms")
    return _manifest(job, findings)


def _is_finished(split: Split, shard: int) -> bool:
    """Return whether a shard and its sidecar, which is written last, both exist."""
    return split.shard_path(shard).is_file() and split.sidecar_path(shard).is_file()


def held_variant(split: Split) -> str | None:
    """Return the variant of Mitsuba with which a split was begun; None for a new split."""
    return (claim.held(split.description_path) or {}).get("variant")


def _refuse_shared_inputs(job: Job, findings: inputs.Findings) -> None:
    """Raise ValueError if both splits use a shape or a map with the same contents."""
    other = Split(job.out, next(name for name in SPLITS if name != job.description.split))
    theirs = inputs.read(other.inputs_path)
    if theirs is None:
        return
    for kind in ("shapes", "environments"):
        names = {digest: name for name, digest in inputs.digests(theirs)[kind].items()}
        for name, digest in inputs.digests(findings)[kind].items():
            if digest in names:
                raise ValueError(
                    f"{getattr(job.description, kind)}: {name} has the contents of "
                    f"{names[digest]}, which the {other.name} split is rendered from: remove one "
                    "of them, or sort the files into subfolders train and test, and render "
                    f"{other.folder} anew"
                )


def _manifest(job: Job, findings: inputs.Findings) -> dict[str, Any]:
    """Return the manifest of a complete split, put together from the sidecars of its shards."""
    sidecars = [
        claim.sidecar(job.split.sidecar_path(shard)) for shard in range(job.description.shards)
    ]
    return {
        # Shards may have different versions, if the software was changed in between.
        "packages": {
            name: ", ".join(sorted({sidecar["packages"][name] for sidecar in sidecars}))
            for name in sidecars[0]["packages"]
        },
        "description": job.recorded(),
        "shards": job.description.shards,
        "examples": job.description.count,
        "sha256": [sidecar["sha256"] for sidecar in sidecars],
        "failures": [failure for sidecar in sidecars for failure in sidecar["failures"]],
        "shapes": job.shapes.names(),
        "lights": job.lights.names(),
        "inputs": inputs.digests(findings),
        "skipped": inputs.unusable(findings),
        "repaired": inputs.repairs(findings),
    }
