"""A corpus split: independent shards, written atomically by worker processes.

A shard's bytes depend on the corpus' description and the shard's number alone: not on the number of
workers, nor on interruptions. A finished shard is never written again.
"""

import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import multiprocessing
import os
from collections.abc import Callable
from pathlib import Path

from lime_keras import console, corpus
from lime_keras.version import __version__

from . import examples, scenes, sources, variants
from .quality import QUALITIES
from .workers import Workers

_TRIES = 20
_SHAPES_PER_SHARD, _LIGHTS_PER_SHARD = 64, 64
"""A shard draws from so many at most: what a worker can hold, so each is read once a shard."""
_PACKAGES = ("mitsuba", "drjit", "numpy", "OpenImageIO", "tensorflow")


@dataclasses.dataclass(frozen=True)
class Description:
    """Everything that a split's bytes depend on, apart from the software.

    Attributes:
        split: `train` or `test`.
        count: number of examples.
        seed: of everything random; 0 is a seed.
        size: height and width of the images in pixels.
        shard_size: examples in a shard.
        quality: name of one of `QUALITIES`.
        shading: `furnace` or `literal`.
        shapes: folder of meshes, or None for the built-in ones.
        environments: folder of maps, or None for the built-in rooms.
        backgrounds: folder of pictures, or None for random textures.
        variant: Mitsuba's.
    """

    split: str
    count: int
    seed: int
    size: int
    shard_size: int
    quality: str
    shading: str
    shapes: str | None
    environments: str | None
    backgrounds: str | None
    variant: str

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Indices of the examples in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))


def render_split(
    out: Path,
    description: Description,
    choice: variants.Choice,
    *,
    workers: int,
    on_room: Callable[[int, int], None],
    on_example: Callable[[int, int], None],
) -> dict:
    """Render what is missing of a split and write its manifest.

    Args:
        out: folder of the corpus.
        description: of the split.
        choice: Mitsuba's variant and library.
        workers: processes.
        on_room: called with (done, total) as the built-in rooms are rendered.
        on_example: called with (done, total) as examples are; finished shards count at once.

    Returns:
        The manifest.

    Raises:
        ValueError: if the folder holds a split of another description, or an input is unusable.
        RuntimeError: if a worker died; finished shards stay.
    """
    folder = out / description.split
    # Read now: an input that cannot be used should fail before the folder is claimed for it, and
    # before a worker is started.
    job = _Job(out, description, choice)
    lights = job.lights.names()
    recorded = job.recorded()
    _refuse_shared_inputs(job)
    folder.mkdir(parents=True, exist_ok=True)
    _claim(folder, recorded)
    for partial in [*folder.glob("partial-*"), *(folder / "rooms").glob("partial-*")]:
        partial.unlink()
    rooms = [] if description.environments else lights
    missing_rooms = [name for name in rooms if not (job.lights.cache / name).is_file()]
    missing = [n for n in range(description.shards) if not _is_finished(job, n)]
    done = description.count - sum(len(description.indices(shard)) for shard in missing)
    if not missing and corpus.manifest_path(out, description.split).is_file():
        on_example(done, description.count)
        return corpus.read_manifest(out, description.split)
    pool = Workers(workers, _start_worker, job)
    if missing and missing_rooms:
        finished = len(rooms) - len(missing_rooms)
        pool.run(_render_room, missing_rooms, finished, len(rooms), on_room)
    on_example(done, description.count)
    pool.run(_render_shard, missing, done, description.count, on_example)
    return _write_manifest(job)


@dataclasses.dataclass(frozen=True)
class _Job:
    """What a worker needs to know."""

    out: Path
    description: Description
    choice: variants.Choice

    def recorded(self) -> dict:
        """The description as it is written down, with a hash of the names of all files used.

        Folders are told by name: where they lie on this machine changes no byte.
        """
        record = dataclasses.asdict(self.description)
        for name in ("shapes", "environments", "backgrounds"):
            record[name] = Path(record[name]).name if record[name] else None
        pictures = [path.name for path in self.backgrounds.pictures()]
        names = [self.shapes.names(), self.lights.names(), pictures]
        record["inputs_sha256"] = hashlib.sha256(json.dumps(names).encode()).hexdigest()
        return record

    @property
    def folder(self) -> Path:
        return self.out / self.description.split

    @property
    def shapes(self) -> sources.ShapeSource:
        folder = self.description.shapes
        return sources.ShapeSource(
            Path(folder) if folder else None, self.description.split, self.description.seed
        )

    @property
    def lights(self) -> sources.LightSource:
        folder = self.description.environments
        return sources.LightSource(
            Path(folder) if folder else None,
            self.description.split,
            self.description.seed,
            self.folder / "rooms",
        )

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        folder = self.description.backgrounds
        return sources.BackgroundSource(Path(folder) if folder else None)


def _start_worker(job: _Job, ticks: multiprocessing.Queue) -> None:
    """Set up one worker process."""
    variants.activate(job.choice, threads=1)
    console.import_tensorflow()
    global _worker
    _worker = _Worker(job, ticks)


class _Worker:
    """A renderer with its caches."""

    def __init__(self, job: _Job, ticks: multiprocessing.Queue):
        self.job = job
        self.ticks = ticks
        self.quality = QUALITIES[job.description.quality]
        self.shape_names = job.shapes.names()
        self.light_names = job.lights.names()
        self.mesh = functools.lru_cache(_SHAPES_PER_SHARD)(self._mesh)
        self.light = functools.lru_cache(_LIGHTS_PER_SHARD)(self._light)
        self.drawn = functools.lru_cache(1)(self._drawn)

    def _mesh(self, name: str):
        from .gbuffer import Tracer

        mesh = self.job.shapes.load(name)
        return mesh, Tracer(mesh, self.job.description.size, self.quality)

    def _light(self, name: str):
        return self.job.lights.load(name, self.quality)

    def _drawn(self, shard: int) -> tuple[list[str], list[str]]:
        """Names of the shapes and of the lights that a shard draws from."""
        description = self.job.description
        rng = sources.generator(description.seed, description.split, "shard", shard)
        return (
            sources.some(rng, self.shape_names, _SHAPES_PER_SHARD),
            sources.some(rng, self.light_names, _LIGHTS_PER_SHARD),
        )

    def record(self, index: int) -> tuple[bytes, list[dict]]:
        """The serialised example of that index, and what failed before it came out.

        Raises:
            RuntimeError: if no scene of many was usable.
        """
        from lime_keras import records

        description = self.job.description
        shapes, lights = self.drawn(index // description.shard_size)
        failures: list[dict] = []
        for attempt in range(_TRIES):
            rng = sources.generator(description.seed, description.split, "example", index, attempt)
            shape, light_name = shapes[rng.integers(len(shapes))], lights[rng.integers(len(lights))]
            mesh, tracer = self.mesh(shape)
            light = self.light(light_name)
            scene = (
                scenes.sample_pose(rng, mesh.vertices, description.size),
                scenes.sample_light_rotation(rng, light.strong_direction),
                scenes.sample_material(rng),
                self.job.backgrounds.sample(rng, description.size),
            )
            names = {"shape": shape, "light": light_name}
            numbers = {"seed": description.seed, "index": index}
            try:
                features = examples.render(
                    tracer, light, *scene, literal=description.shading == "literal"
                )
                return records.encode(features | names | numbers), failures
            except ValueError as error:  # a scene that shows too little, or is not finite
                failures.append({"index": index, "attempt": attempt, "error": str(error)} | names)
        raise RuntimeError(
            f"example {index} of seed {description.seed} failed {_TRIES} times, last of "
            f"{failures[-1]['shape']} under {failures[-1]['light']}: {failures[-1]['error']}; look "
            "at these files"
        )


def _render_room(name: str) -> None:
    _worker.job.lights.render_room(name)
    _worker.ticks.put(1)


def _render_shard(shard: int) -> None:
    """Write one shard and, last, the sidecar that says it is whole.

    Raises:
        RuntimeError: if it cannot be written, as on a full disk.
    """
    import tensorflow as tf

    job = _worker.job
    path = corpus.shard_path(job.out, job.description.split, shard)
    partial = path.with_name(f"partial-{os.getpid()}-{path.name}")
    failures: list[dict] = []
    try:
        with tf.io.TFRecordWriter(str(partial)) as writer:
            for index in job.description.indices(shard):
                serialized, failed = _worker.record(index)
                writer.write(serialized)
                failures += failed
                _worker.ticks.put(1)
        digest = hashlib.sha256(partial.read_bytes()).hexdigest()
        os.replace(partial, path)
        sidecar = {
            "examples": len(job.description.indices(shard)),
            "sha256": digest,
            "failures": failures,
        }
        _write_json(_sidecar(job, shard), sidecar)
    except (tf.errors.OpError, OSError) as error:
        partial.unlink(missing_ok=True)  # it may fill the disk
        raise RuntimeError(
            f"{path} cannot be written ({error}): make room or mend the folder. Finished shards "
            "are kept, and the same command goes on"
        ) from error


def _is_finished(job: _Job, shard: int) -> bool:
    """Whether a shard and the sidecar that vouches for it are both there."""
    path = corpus.shard_path(job.out, job.description.split, shard)
    return path.is_file() and _sidecar(job, shard).is_file()


def _sidecar(job: _Job, shard: int) -> Path:
    return corpus.shard_path(job.out, job.description.split, shard).with_suffix(".json")


def held_variant(out: Path, split: str) -> str | None:
    """The variant with which a split was begun, None if it was not."""
    path = out / split / "description.json"
    return json.loads(path.read_text(encoding="utf-8"))["variant"] if path.is_file() else None


def _refuse_shared_inputs(job: _Job) -> None:
    """Keep training and test apart even if files came or went between their rendering."""
    other = next(split for split in corpus.SPLITS if split != job.description.split)
    if not corpus.manifest_path(job.out, other).is_file():
        return
    manifest = corpus.read_manifest(job.out, other)
    for kind, folder, names in (
        ("shapes", job.description.shapes, job.shapes.names()),
        ("lights", job.description.environments, job.lights.names()),
    ):
        shared = sorted(set(names) & set(manifest[kind])) if folder else []
        if shared:
            raise ValueError(
                f"{folder}: {', '.join(shared[:5])} {'is' if len(shared) == 1 else 'are'} in the "
                f"{other} split already, because files came or went since it was rendered: render "
                "both splits anew, or sort the files into subfolders train and test"
            )


def _claim(folder: Path, wanted: dict) -> None:
    """Record what the folder is for; refuse one that is for something else."""
    path = folder / "description.json"
    if path.is_file():
        held = json.loads(path.read_text(encoding="utf-8"))
        differing = sorted(key for key in wanted | held if wanted.get(key) != held.get(key))
        if differing:
            raise ValueError(
                f"{folder} holds another split: "
                + ", ".join(
                    f"{key} {held.get(key)} there, {wanted.get(key)} asked" for key in differing
                )
                + ". Pass another folder, the same options, or remove it"
            )
    else:
        _write_json(path, wanted)


def _write_manifest(job: _Job) -> dict:
    """Gather the sidecars: the split is complete."""
    sidecars = [
        json.loads(_sidecar(job, shard).read_text(encoding="utf-8"))
        for shard in range(job.description.shards)
    ]
    manifest = {
        "version": __version__,
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "description": job.recorded(),
        "shards": job.description.shards,
        "examples": job.description.count,
        "sha256": [sidecar["sha256"] for sidecar in sidecars],
        "failures": [failure for sidecar in sidecars for failure in sidecar["failures"]],
        "shapes": job.shapes.names(),
        "lights": job.lights.names(),
    }
    _write_json(corpus.manifest_path(job.out, job.description.split), manifest)
    return manifest


def _write_json(path: Path, value: dict) -> None:
    partial = path.with_name(f"partial-{path.name}")
    partial.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)
