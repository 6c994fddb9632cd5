"""The rendering of a bank: lights, textures and independent shards of G-buffers.

Everything is written atomically by worker processes. The bytes of a bank depend on its description
alone, not on the number of workers, nor on interruptions. What is finished is never rendered again.
"""

import dataclasses
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, locking
from lime_keras.synthesis import bank
from lime_keras.synthesis.lights import LISTED, RADIANCE

from ..corpus import claim, inputs
from ..corpus.processes import Workers
from ..mitsuba_setup import variants
from . import entries, lights, textures, worker
from .description import Description, Job

Tell = Callable[[int, int], None]
"""A function that is called with (done, total) as work goes on."""


def render_bank(
    out: Path,
    description: Description,
    choice: variants.Choice,
    *,
    workers: int,
    skip_unusable: bool,
    on_input: Tell,
    on_light: Tell,
    on_texture: Tell,
    on_entry: Tell,
) -> dict[str, Any]:
    """Render what is missing of a bank, and write its manifest.

    Args:
        out: folder of the bank.
        description: description of the bank.
        choice: variant and library of Mitsuba.
        workers: number of worker processes.
        skip_unusable: whether unusable input files are left out; else they are an error.
        on_input: called with (done, total) as input files are checked.
        on_light: called with (done, total) as lights are rendered or read.
        on_texture: called with (done, total) as textures are drawn.
        on_entry: called with (done, total) as entries are rendered; entries of finished shards
            count from the start.

    Returns:
        The manifest.

    Raises:
        ValueError: if the folder holds a bank of another description, or an input is unusable.
        RuntimeError: if a worker died. Finished shards are kept.
    """
    job = Job(out.absolute(), description, choice)
    held = claim.held(job.description_path)
    claim.refuse_another(out, "bank", held, job.recorded())
    pool = Workers(workers)

    def inspected(known: inputs.Findings | None) -> inputs.Findings:
        return inputs.inspect(
            job.files(), known, lambda task, items: pool.map(task, items, on_input)
        )

    findings = inspected(inputs.read(job.inputs_path) if held is not None else None)
    if held is None and not skip_unusable:
        inputs.refuse(findings)
    job = dataclasses.replace(job, usable=inputs.usable(findings))
    with locking.lock_folder(job.out, "lime-render is rendering"):
        claim.write_json(job.description_path, job.recorded())
        inputs.write(job.inputs_path, findings)
        claim.remove_partials(job.out, job.parts, job.parts / "rooms", job.shard_path(0).parent)
        renderers = Workers(workers, worker.start, job)
        _render_lights(job, renderers, on_light)
        _render_textures(job, renderers, on_texture)
        _render_shards(job, renderers, on_entry)
        inspected(findings)  # a file that changed meanwhile may be in some shards only: an error
        manifest = _manifest(job, findings)
        claim.write_json(job.out / bank.MANIFEST, manifest)
        atomic.remove(job.parts)
    return manifest


def _render_lights(job: Job, renderers: Workers, tell: Tell) -> None:
    if (job.out / RADIANCE).is_file() and (job.out / LISTED).is_file():
        return
    count = len(job.light_names())
    missing = [number for number in range(count) if not job.light_part(number).is_file()]
    renderers.run(worker.render_light, missing, count - len(missing), count, tell)
    lights.join(job)


def _render_textures(job: Job, renderers: Workers, tell: Tell) -> None:
    if (job.out / bank.TEXTURES).is_file():
        return
    missing = [n for n in textures.tasks() if not job.texture_part(n).is_file()]
    done = max(textures.COUNT - len(missing) * textures.A_TASK, 0)
    renderers.run(worker.render_textures, missing, done, textures.COUNT, tell)
    textures.join(job)


def _render_shards(job: Job, renderers: Workers, tell: Tell) -> None:
    description = job.description
    missing = [n for n in range(description.shards) if not _is_finished(job, n)]
    done = description.count - sum(len(description.indices(shard)) for shard in missing)
    tell(done, description.count)
    if missing:
        renderers.run(worker.render_shard, missing, done, description.count, tell)


def _is_finished(job: Job, shard: int) -> bool:
    """Return whether a shard, its index and its sidecar, which is written last, all exist."""
    path = job.shard_path(shard)
    return all(path.with_suffix(suffix).is_file() for suffix in (".bin", ".npy", ".json"))


def _manifest(job: Job, findings: inputs.Findings) -> dict[str, Any]:
    """Return the manifest of a complete bank, put together from the sidecars of its shards."""
    files: dict[str, str] = {}
    sidecars = []
    for shard in range(job.description.shards):
        path = job.shard_path(shard)
        sidecar = claim.sidecar(path.with_suffix(".json"))
        files |= {f"geometry/{name}": digest for name, digest in sidecar["sha256"].items()}
        sidecars.append(sidecar)
    for name in (RADIANCE, LISTED, bank.TEXTURES):
        with (job.out / name).open("rb") as file:
            files[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return {
        "format": bank.FORMAT,
        "version": bank.VERSION,
        "size": job.description.size,
        "count": job.description.count,
        "description": job.recorded(),
        "shards": job.description.shards,
        "files": files,
        "shapes": entries.Bodies(job).names,
        "failures": [failure for sidecar in sidecars for failure in sidecar["failures"]],
        # Shards may have different versions, if the software was changed in between.
        "packages": {
            name: ", ".join(sorted({sidecar["packages"][name] for sidecar in sidecars}))
            for name in sidecars[0]["packages"]
        },
        "inputs": inputs.digests(findings),
        "skipped": inputs.unusable(findings),
        "repaired": inputs.repairs(findings),
    }
