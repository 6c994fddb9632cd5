"""A corpus split: independent shards, written atomically by worker processes.

A shard's bytes depend on the corpus' description and the shard's number alone: not on the number of
workers, nor on interruptions. A finished shard is never written again.
"""

import contextlib
import dataclasses
import fcntl
import functools
import hashlib
import importlib.metadata
import json
import os
import uuid
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.data import corpus
from lime_keras.version import __version__

from ..mitsuba_setup import variants
from ..scene import environments
from ..scene import example as examples
from ..scene import sampling as scenes
from ..scene.quality import QUALITIES
from ..shapes import procedural
from . import cluster, inputs, sources
from .processes import Workers

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
    ray: str | None = None,
    skip_unusable: bool = False,
    on_input: Callable[[int, int], None],
    on_room: Callable[[int, int], None],
    on_example: Callable[[int, int], None],
) -> dict:
    """Render what is missing of a split and write its manifest.

    Args:
        out: folder of the corpus.
        description: of the split.
        choice: Mitsuba's variant and library.
        workers: processes.
        ray: address of a Ray cluster that renders instead of them.
        skip_unusable: leave out input files that cannot be used, instead of refusing to begin.
        on_input: called with (done, total) as input files are checked.
        on_room: called with (done, total) as the built-in rooms are rendered.
        on_example: called with (done, total) as examples are; finished shards count at once.

    Returns:
        The manifest.

    Raises:
        ValueError: if the folder holds a split of another description, or an input is unusable.
        RuntimeError: if a worker died, or the cluster cannot be used; finished shards stay.
    """
    folder = out / description.split
    job = _Job(out.absolute(), description, choice)
    held = _held(folder)
    if held is not None:
        _refuse_another(folder, held, job.recorded())
    # Checked now: an input that cannot be used should fail before the folder is claimed for it.
    pool = Workers(workers, _start_nothing)

    def inspected(known: inputs.Findings | None) -> inputs.Findings:
        return inputs.inspect(
            job.files(), known, lambda task, items: pool.map(task, items, on_input)
        )

    findings = inspected(inputs.read(folder / "inputs.json") if held is not None else None)
    if held is None and not skip_unusable:
        inputs.refuse(findings)
    job = dataclasses.replace(job, usable=_usable(findings, inputs.skip(findings)))
    _refuse_shared_inputs(job, findings)
    renderers: cluster.Cluster | Workers
    if ray:
        renderers = cluster.Cluster(ray, _PACKAGES, _start_worker, job)
    else:
        renderers = Workers(workers, _start_worker, job)
    folder.mkdir(parents=True, exist_ok=True)
    with _alone(folder):
        _write_json(folder / "description.json", job.recorded())
        inputs.write(folder / "inputs.json", findings)
        manifest = _render_missing(job, renderers, findings, on_room, on_example)
        inspected(findings)  # what changed meanwhile may be in some shards and not in others
        _write_json(corpus.manifest_path(out, description.split), manifest)
    return manifest


def _render_missing(
    job: "_Job",
    renderers: cluster.Cluster | Workers,
    findings: inputs.Findings,
    on_room: Callable[[int, int], None],
    on_example: Callable[[int, int], None],
) -> dict:
    """Render the rooms and shards that are not there yet; returns the manifest."""
    description, lights = job.description, job.lights.names()
    _remove_partials(job.folder)
    rooms = [] if description.environments else lights
    missing_rooms = [name for name in rooms if not (job.lights.cache / name).is_file()]
    missing = [n for n in range(description.shards) if not _is_finished(job, n)]
    done = description.count - sum(len(description.indices(shard)) for shard in missing)
    if missing and missing_rooms:
        finished = len(rooms) - len(missing_rooms)
        renderers.run(_render_room, missing_rooms, finished, len(rooms), on_room)
    on_example(done, description.count)
    if missing:
        renderers.run(_render_shard, missing, done, description.count, on_example)
    _remove_partials(job.folder)  # of a node that was lost
    return _manifest(job, findings)


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep a second process from rendering the same split; a killed one keeps nobody out.

    Raises:
        RuntimeError: if another one is at it.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise RuntimeError(f"another lime-render is rendering {folder}: wait for it") from error
    except OSError:  # some network file systems lock no folders
        pass
    try:
        yield
    finally:
        os.close(handle)


@dataclasses.dataclass(frozen=True)
class _Job:
    """What a worker needs to know."""

    out: Path
    description: Description
    choice: variants.Choice
    usable: Mapping[str, tuple[str, ...] | None] = dataclasses.field(
        default_factory=lambda: dict.fromkeys(inputs.KINDS)
    )

    def recorded(self) -> dict:
        """The description as it is written down.

        Folders are told by name: where they lie on this machine changes no byte.
        """
        record = dataclasses.asdict(self.description)
        for name in inputs.KINDS:
            record[name] = Path(record[name]).name if record[name] else None
        return record

    def files(self) -> dict[str, list[Path]]:
        """The user's files for this split, by kind; none where something built in serves."""
        extensions = {"shapes": procedural.EXTENSIONS, "environments": environments.EXTENSIONS}
        found = {
            kind: sources.files(folder, self.description.split, extensions[kind]) if folder else []
            for kind in extensions
            for folder in [self._folder(kind)]
        }
        backgrounds = sources.BackgroundSource(self._folder("backgrounds"))
        return found | {"backgrounds": backgrounds.pictures()}

    @property
    def folder(self) -> Path:
        return self.out / self.description.split

    def _folder(self, kind: str) -> Path | None:
        folder = getattr(self.description, kind)
        return Path(folder) if folder else None

    @property
    def shapes(self) -> sources.ShapeSource:
        description = self.description
        return sources.ShapeSource(
            self._folder("shapes"), description.split, description.seed, self.usable["shapes"]
        )

    @property
    def lights(self) -> sources.LightSource:
        return sources.LightSource(
            self._folder("environments"),
            self.description.split,
            self.description.seed,
            self.folder / "rooms",
            self.usable["environments"],
        )

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        return sources.BackgroundSource(self._folder("backgrounds"), self.usable["backgrounds"])


def _start_nothing(_: Any) -> None:
    """Files are checked without Mitsuba or TensorFlow."""


def _usable(
    findings: inputs.Findings, skipped: Mapping[str, frozenset[str]]
) -> dict[str, tuple[str, ...] | None]:
    """Names of the files to use, by kind; None where something built in serves."""
    return {
        kind: tuple(f.name for f in found if f.name not in skipped[kind]) or None
        for kind, found in findings.items()
    }


def _digests(findings: inputs.Findings) -> dict[str, dict[str, str]]:
    """Names and checksums of the user's files that are used, by kind."""
    return {
        kind: {finding.name: finding.sha256 for finding in found if finding.problem is None}
        for kind, found in findings.items()
    }


def _start_worker(job: _Job, ticks: Any) -> None:
    """Set up one worker process."""
    variants.activate(job.choice, threads=1)
    console.import_tensorflow()
    global _worker
    _worker = _Worker(job, ticks)


class _Worker:
    """A renderer with its caches."""

    def __init__(self, job: _Job, ticks: Any):
        self.job = job
        self.ticks = ticks
        self.quality = QUALITIES[job.description.quality]
        self.shape_names = job.shapes.names()
        self.light_names = job.lights.names()
        self.backgrounds = job.backgrounds
        self.mesh = functools.lru_cache(_SHAPES_PER_SHARD)(self._mesh)
        self.light = functools.lru_cache(_LIGHTS_PER_SHARD)(self._light)
        self.drawn = functools.lru_cache(1)(self._drawn)

    def _mesh(self, name: str):
        from ..scene.gbuffer import Tracer

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
        from lime_keras.data import records

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
                self.backgrounds.sample(rng, description.size),
            )
            names = {"shape": shape, "light": light_name}
            numbers = {"seed": description.seed, "index": index}
            try:
                features = examples.render(
                    tracer, light, *scene, literal=description.shading == "literal"
                )
                return records.encode(features | names | numbers), failures
            except ValueError as error:  # it shows too little, or is not finite
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
    partial = path.with_name(f"partial-{uuid.uuid4().hex}-{path.name}")
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
            "packages": _packages(),
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
    return (_held(out / split) or {}).get("variant")


def _refuse_shared_inputs(job: _Job, findings: inputs.Findings) -> None:
    """Keep training and test apart, by the files' contents: one may have two names."""
    other = next(split for split in corpus.SPLITS if split != job.description.split)
    theirs = inputs.read(job.out / other / "inputs.json")
    for kind in ("shapes", "environments") if theirs else ():
        names = {digest: name for name, digest in _digests(theirs)[kind].items()}
        for name, digest in _digests(findings)[kind].items():
            if digest in names:
                raise ValueError(
                    f"{getattr(job.description, kind)}: {name} has the contents of "
                    f"{names[digest]}, which the {other} split is rendered from: remove one of "
                    "them, or sort the files into subfolders train and test, and render "
                    f"{job.out / other} anew"
                )


def _held(folder: Path) -> dict | None:
    """The description that a split was begun with, None if it was not.

    Raises:
        ValueError: if it cannot be read.
    """
    path = folder / "description.json"
    if not path.is_file():
        return None
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} is broken ({error}): remove {folder} to render anew") from error


def _refuse_another(folder: Path, held: dict, wanted: dict) -> None:
    """Refuse a folder that was claimed for another split."""
    differing = sorted(key for key in wanted | held if wanted.get(key) != held.get(key))
    if differing:
        raise ValueError(
            f"{folder} holds another split: "
            + ", ".join(
                f"{key} {held.get(key)} there, {wanted.get(key)} asked" for key in differing
            )
            + ". Pass another folder, the same options, or remove it"
        )


def _remove_partials(folder: Path) -> None:
    for partial in [*folder.glob("partial-*"), *(folder / "rooms").glob("partial-*")]:
        partial.unlink(missing_ok=True)


def _manifest(job: _Job, findings: inputs.Findings) -> dict:
    """What the sidecars tell together: the split is complete."""
    sidecars = [
        json.loads(_sidecar(job, shard).read_text(encoding="utf-8"))
        for shard in range(job.description.shards)
    ]
    return {
        # Of one shard and another, if the software was changed in between.
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
        "inputs": _digests(findings),
        "skipped": inputs.unusable(findings),
        "repaired": inputs.repairs(findings),
    }


def _packages() -> dict[str, str]:
    versions = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return versions | {"lime-keras": __version__}


def _write_json(path: Path, value: dict) -> None:
    partial = path.with_name(f"partial-{uuid.uuid4().hex}-{path.name}")
    partial.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)
