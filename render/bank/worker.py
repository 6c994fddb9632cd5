"""The work of a process that renders a bank: one light, some textures, or one shard."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras.io import atomic, untrusted
from lime_keras.synthesis import geometry

from ..jobs import nodes, resuming
from ..jobs.processes import Ticks
from ..mitsuba_setup import variants
from . import entries, lights, textures
from .description import Job

PACKAGES = ("mitsuba", "drjit", "numpy", "OpenImageIO", "scikit-image", "trimesh")
"""Packages on whose versions the bytes of a bank may depend."""


@dataclass(frozen=True)
class Worker:
    """The state of a process that renders.

    Attributes:
        job: the job to render.
        bodies: bodies of the entries.
        ticks: object to which progress is reported.
    """

    job: Job
    bodies: entries.Bodies
    ticks: Ticks


def start(job: Job, ticks: Ticks) -> Worker:
    """Set up this process for rendering, and return its state."""
    variants.activate(job.choice, threads=1)
    return Worker(job, entries.Bodies(job), ticks)


def render_light(worker: Worker, number: int) -> None:
    """Render one light into the bank's parts."""
    lights.render(worker.job, number)
    worker.ticks.put(1)


def render_textures(worker: Worker, number: int) -> None:
    """Draw some textures into the bank's parts."""
    worker.ticks.put(textures.render(worker.job, number))


def render_shard(worker: Worker, shard: int) -> None:
    """Render and write one shard and its index, and last its sidecar, which marks it as complete.

    Raises:
        RuntimeError: if the shard cannot be written, for example because the disk is full.
    """
    path, beside, sidecar_path = worker.job.shard_files(shard)
    failures: list[dict[str, Any]] = []
    data: list[bytes] = []
    table = np.zeros(len(worker.job.description.indices(shard)), geometry.INDEX)
    offset = 0
    for row, index in enumerate(worker.job.description.indices(shard)):
        entry = entries.render(worker.bodies, worker.job, index)
        table[row] = offset, len(entry.data), entry.shape, entry.camera
        offset += len(entry.data)
        data.append(entry.data)
        failures += entry.failures
        worker.ticks.put(1)
    try:
        atomic.write(path, b"".join(data))
        with atomic.replacing(beside) as partial, partial.open("wb") as file:
            np.save(file, table)
        sidecar = {
            "entries": len(table),
            "sha256": {written.name: untrusted.sha256(written) for written in (path, beside)},
            "shapes": sorted({worker.bodies.names[shape] for shape in table["shape"]}),
            "failures": failures,
            "packages": nodes.versions(PACKAGES),
        }
        resuming.write_json(sidecar_path, sidecar)
    except OSError as error:
        raise RuntimeError(
            f"{path} cannot be written ({error}): make room or mend the folder. Finished shards "
            "are kept, and the same command goes on"
        ) from error
