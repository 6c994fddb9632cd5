"""The work of a rendering process: its sources, the rendering of one room or one shard."""

from dataclasses import dataclass
from typing import Any

from lime_keras import console
from lime_keras.io import atomic, untrusted

from ..jobs import resuming
from ..jobs.description import Job
from ..jobs.processes import Ticks
from ..mitsuba_setup import variants
from ..scene.quality import QUALITIES
from .random_example import Sources, render_example

PACKAGES = ("mitsuba", "drjit", "numpy", "OpenImageIO", "tensorflow")
"""Packages on whose versions the bytes of a shard may depend."""


@dataclass(frozen=True)
class Worker:
    """The state of a process that renders.

    Attributes:
        job: the job to render.
        sources: sources of the scenes.
        ticks: object to which progress is reported.
    """

    job: Job
    sources: Sources
    ticks: Ticks


def start(job: Job, ticks: Ticks) -> Worker:
    """Set up this process for rendering, and return its state."""
    variants.activate(job.choice, threads=1)
    console.import_tensorflow()
    sources = Sources(job.shapes, job.lights, job.backgrounds, job.description.endless)
    return Worker(job, sources, ticks)


def render_room(worker: Worker, name: str) -> None:
    """Render one built-in room into the split's folder."""
    worker.job.lights.render_room(name)
    worker.ticks.put(1)


def render_shard(worker: Worker, shard: int) -> None:
    """Render and write one shard, and last its sidecar, which marks it as complete.

    Raises:
        RuntimeError: if the shard cannot be written, for example because the disk is full.
    """
    import tensorflow as tf  # must come after Mitsuba

    split, asked = worker.job.split, worker.job.description
    failures: list[dict[str, Any]] = []
    path = split.shard_path(shard)
    try:
        # `shared`: where a folder cannot be locked, another process may write the same shard.
        with atomic.replacing(path, shared=True) as partial:
            with tf.io.TFRecordWriter(str(partial)) as writer:
                for index in asked.indices(shard):
                    example = render_example(
                        asked.seed,
                        index,
                        worker.sources,
                        size=asked.size,
                        quality=QUALITIES[asked.quality],
                        shard_size=asked.shard_size,
                        materials=asked.materials,
                        lobe=asked.shading,
                    )
                    writer.write(example.record)
                    failures += example.failures
                    worker.ticks.put(1)
            digest = untrusted.sha256(partial)
        sidecar = {
            "examples": len(asked.indices(shard)),
            "sha256": digest,
            "failures": failures,
            "packages": resuming.versions(PACKAGES),
        }
        resuming.write_json(split.sidecar_path(shard), sidecar, shared=True)
    except (tf.errors.OpError, OSError) as error:
        raise RuntimeError(
            f"{path} cannot be written ({error}): make room or mend the folder. Finished shards "
            "are kept, and the same command goes on"
        ) from error
