"""The rendering of a bank: lights, textures and independent shards of G-buffers.

Everything is written atomically by worker processes. The bytes of a bank depend on its description
alone, not on the number of workers, nor on interruptions. What is finished is never rendered again.
"""

from pathlib import Path
from typing import Any

from lime_keras.io import atomic, untrusted
from lime_keras.synthesis import bank
from lime_keras.synthesis.lights import LISTED, RADIANCE

from ..jobs import inputs, rendering, resuming
from ..jobs.processes import Pool
from ..jobs.rendering import Tell
from ..mitsuba_setup import variants
from . import entries, lights, textures, worker
from .description import Description, Job


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
    readers = Pool(workers)
    job, findings = rendering.begin(
        Job(out.absolute(), description, choice),
        readers,
        skip_unusable=skip_unusable,
        tell=on_input,
    )

    def render() -> dict[str, Any]:
        renderers = Pool(workers, worker.start, job)
        geometry = job.shard_files(0)[0].parent
        resuming.remove_partials(job.out, job.parts, job.parts / "rooms", geometry)
        _render_lights(job, renderers, on_light)
        _render_textures(job, renderers, on_texture)
        rendering.render_shards(job, renderers, worker.render_shard, on_entry)
        return _manifest(job, findings)

    manifest = rendering.complete(job, findings, readers, render, on_input)
    atomic.remove(job.parts)
    return manifest


def _render_lights(job: Job, renderers: Pool, tell: Tell) -> None:
    if (job.out / RADIANCE).is_file() and (job.out / LISTED).is_file():
        return
    count = len(job.light_names())
    missing = [number for number in range(count) if not job.light_part(number).is_file()]
    renderers.run(worker.render_light, missing, count - len(missing), count, tell)
    lights.join(job)


def _render_textures(job: Job, renderers: Pool, tell: Tell) -> None:
    if (job.out / bank.TEXTURES).is_file():
        return
    missing = [n for n in textures.tasks() if not job.texture_part(n).is_file()]
    done = max(textures.COUNT - len(missing) * textures.A_TASK, 0)
    renderers.run(worker.render_textures, missing, done, textures.COUNT, tell)
    textures.join(job)


def _manifest(job: Job, findings: inputs.Findings) -> dict[str, Any]:
    """Return the manifest of a complete bank, put together from the sidecars of its shards."""
    sidecars = rendering.sidecars(job)
    files: dict[str, str] = {}
    for sidecar in sidecars:
        files |= {f"geometry/{name}": digest for name, digest in sidecar["sha256"].items()}
    for name in (RADIANCE, LISTED, bank.TEXTURES):
        files[name] = untrusted.sha256(job.out / name)
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
        "packages": rendering.packages(sidecars),
        **rendering.of_inputs(findings),
    }
