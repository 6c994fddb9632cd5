"""The course of every job: its inputs are checked, its folder is claimed, what is missing is made.

What is written depends on the job's description alone, not on the number of workers, nor on
interruptions. What is finished is never made again.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from lime_keras.io import locking

from . import cluster, inputs, resuming
from .description import Job
from .processes import Pool

OnProgress = Callable[[int, int], None]
"""A function that is called with (done, total) as work goes on."""


def begin(
    job: Job, pool: Pool, *, skip_unusable: bool, tell: OnProgress
) -> tuple[Job, inputs.Findings]:
    """Check a job's inputs before its folder is made, so that an unusable file leaves nothing.

    Args:
        job: the job.
        pool: processes that read the files.
        skip_unusable: whether unusable files are left out; else they are an error.
        tell: called as files are checked.

    Returns:
        The job with its usable files, and the findings.

    Raises:
        ValueError: if the folder was begun with another description, or an input is unusable.
    """
    begun = _refuse_another(job)
    known = None if begun is None else inputs.read(job.split.inputs_path)
    findings = _inspected(job, pool, known, tell)
    if begun is None and not skip_unusable:
        inputs.refuse(findings)
    return dataclasses.replace(job, usable=inputs.usable(findings)), findings


def complete(
    job: Job,
    findings: inputs.Findings,
    pool: Pool,
    render: Callable[[], dict[str, Any]],
    tell: OnProgress,
) -> dict[str, Any]:
    """Claim a job's folder, render what is missing, and write the manifest.

    Args:
        job: the job, from `begin`.
        findings: findings of its inputs, from `begin`.
        pool: processes that read the files.
        render: renders what is missing, and returns the manifest.
        tell: called as files are checked once more.

    Returns:
        The manifest.

    Raises:
        ValueError: if an input has changed meanwhile, or another command has begun the folder.
        RuntimeError: if another process renders into this folder.
    """
    with locking.lock_folder(job.split.folder, "lime-render is rendering"):
        _refuse_another(job)
        resuming.write_json(job.split.description_path, job.description.recorded())
        inputs.write(job.split.inputs_path, findings)
        manifest = render()
        # A file that changed meanwhile may be in some shards only.
        _inspected(job, pool, findings, tell)
        resuming.write_json(job.split.manifest_path, manifest)
    return manifest


def _refuse_another(job: Job) -> dict[str, Any] | None:
    """Return the description of the job's folder; ValueError is raised if it is of another job."""
    begun = resuming.read_description(job.split.description_path)
    resuming.refuse_another(job.split.folder, "split", begun, job.description.recorded())
    return begun


def render_shards(
    job: Job, renderers: Pool | cluster.Cluster, task: Callable[[Any, int], None], tell: OnProgress
) -> None:
    """Render the missing shards by a task; what finished shards hold counts from the start."""
    count, missing = job.description.count, job.missing()
    done = count - sum(len(job.description.indices(shard)) for shard in missing)
    tell(done, count)
    if missing:
        renderers.run(task, missing, done, count, tell)


def sidecars(job: Job) -> list[dict[str, Any]]:
    """Return the sidecars of all shards; ValueError is raised if one is damaged."""
    return [resuming.sidecar(job.split.sidecar_path(n)) for n in range(job.description.shards)]


def packages(vouched: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the versions of packages that shards were rendered with, by name.

    Shards may have different versions, if the software was changed in between.
    """
    return {
        name: ", ".join(sorted({sidecar["packages"][name] for sidecar in vouched}))
        for name in vouched[0]["packages"]
    }


def inputs_record(findings: inputs.Findings) -> dict[str, Any]:
    """Return what a manifest tells of the user's files."""
    return {
        "inputs": inputs.digests(findings),
        "skipped": inputs.unusable(findings),
        "repaired": inputs.repairs(findings),
    }


def _inspected(
    job: Job, pool: Pool, known: inputs.Findings | None, tell: OnProgress
) -> inputs.Findings:
    return inputs.inspect(
        job.description.files(), known, lambda task, items: pool.map(task, items, tell)
    )
