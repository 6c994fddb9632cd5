"""The work of a rendering process: its sources, the rendering of one room or one shard."""

from collections.abc import Callable
from typing import Any

from lime_keras import console
from lime_keras.io import atomic, untrusted
from lime_keras.version import __version__, installed

from ..jobs import resuming
from ..jobs.description import Job
from ..mitsuba_setup import variants
from ..scene.quality import QUALITIES
from .random_example import Sources, render_example

PACKAGES = ("mitsuba", "drjit", "numpy", "OpenImageIO", "tensorflow")
"""Packages on whose versions the bytes of a shard may depend."""


def sources_of(job: Job) -> Sources:
    """Return the sources that a job's scenes are drawn from."""
    asked = job.description
    return Sources(
        asked.split,
        asked.seed,
        job.split.folder / "rooms",
        job.usable,
        shape_count=asked.shape_count,
        light_count=asked.light_count,
        light_split=asked.light_split,
        law=asked.light_law,
        endless=asked.endless,
    )


class Worker:
    """A process that renders, and its tasks; `tick` is told how many more things are done."""

    def __init__(self, job: Job, tick: Callable[[int], None]):
        variants.activate(job.choice, threads=1)
        console.import_tensorflow()
        self.job, self.sources, self.tick = job, sources_of(job), tick

    def render_room(self, name: str) -> None:
        """Render one built-in room into the split's folder."""
        self.sources.render_room(name)
        self.tick(1)

    def render_shard(self, shard: int) -> None:
        """Render and write one shard, and last its sidecar, which marks it as complete.

        Raises:
            RuntimeError: if the shard cannot be written, for example because the disk is full.
        """
        import tensorflow as tf  # must come after Mitsuba

        split, asked = self.job.split, self.job.description
        failures: list[dict[str, Any]] = []
        path = split.shard_path(shard)
        try:
            # `shared`: where a folder cannot be locked, another process may write the same shard.
            with atomic.replacing(path, shared=True) as partial:
                with tf.io.TFRecordWriter(str(partial)) as writer:
                    for index in asked.indices(shard):
                        example = render_example(
                            index,
                            self.sources,
                            size=asked.size,
                            quality=QUALITIES[asked.quality],
                            shard_size=asked.shard_size,
                            materials=asked.materials,
                            lobe=asked.shading,
                        )
                        writer.write(example.record)
                        failures += example.failures
                        self.tick(1)
                digest = untrusted.sha256(partial)
            found = installed(PACKAGES) | {"lime-keras": __version__}
            sidecar = {
                "examples": len(asked.indices(shard)),
                "sha256": digest,
                "failures": failures,
                "packages": {name: version or "not installed" for name, version in found.items()},
            }
            resuming.write_json(split.sidecar_path(shard), sidecar, shared=True)
        except (tf.errors.OpError, OSError) as error:
            raise RuntimeError(
                f"{path} cannot be written ({error}): make room or mend the folder. Finished "
                "shards are kept, and the same command goes on"
            ) from error
