"""One example of a corpus: a scene drawn at random from seed and index, and rendered."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.optics.material_law import UNIFORM, sample_material

from ..scene import example
from ..scene.gbuffer import Tracer
from ..scene.quality import FAST, Quality
from ..scene.sampling import sample_light_rotation, sample_pose
from ..scene.sources import (
    BackgroundSource,
    LightSource,
    ShapeSource,
    generator,
    random_subset,
)
from ..shapes.meshes import Mesh

_TRIES = 20
_SHAPES_PER_SHARD, _LIGHTS_PER_SHARD = 64, 64
"""Largest numbers of shapes and lights that a shard draws from.

A worker can hold so many in memory, so each is read once in a shard.
"""


class Sources:
    """The sources that the scenes of a split are drawn from.

    The meshes and maps that were used last stay in memory.

    Args:
        shapes: source of the split's shapes.
        lights: source of the split's lights.
        backgrounds: source of the split's backgrounds.
    """

    def __init__(self, shapes: ShapeSource, lights: LightSource, backgrounds: BackgroundSource):
        self.split = shapes.split
        self.shape_names = shapes.names()
        self.light_names = lights.names()
        self.backgrounds = backgrounds
        self._shapes, self._lights = shapes, lights
        self.mesh = functools.lru_cache(_SHAPES_PER_SHARD)(self._mesh)
        self.light = functools.lru_cache(_LIGHTS_PER_SHARD)(self._lights.load)

    @classmethod
    def built_in(cls, split: str, seed: int, rooms: Path) -> "Sources":
        """Return the built-in sources: procedural shapes, procedural rooms, random textures.

        Args:
            split: `train` or `test`; the two share no shape and no room.
            seed: seed of the corpus.
            rooms: folder that keeps the maps of the rooms, which are rendered when first drawn; in
                a corpus it is `CORPUS/SPLIT/rooms`.
        """
        return cls(
            ShapeSource(None, split, seed),
            LightSource(None, split, seed, rooms),
            BackgroundSource(None),
        )

    def of_shard(self, seed: int, shard: int) -> tuple[list[str], list[str]]:
        """Return the names of the shapes and the names of the lights that a shard draws from."""
        rng = generator(seed, self.split, "shard", shard)
        return (
            random_subset(rng, self.shape_names, _SHAPES_PER_SHARD),
            random_subset(rng, self.light_names, _LIGHTS_PER_SHARD),
        )

    def _mesh(self, name: str, size: int, quality: Quality) -> tuple[Mesh, Tracer]:
        mesh = self._shapes.load(name)
        return mesh, Tracer(mesh, size, quality)


@dataclass(frozen=True)
class Example:
    """A rendered example.

    Attributes:
        features: value of each of `lime_keras.data.records.FEATURES`, before quantisation.
        record: these features, serialised as in a shard.
        failures: one entry for each earlier attempt that could not be used: index, attempt, shape,
            light and error.
    """

    features: dict[str, Any]
    record: bytes
    failures: list[dict[str, Any]]


def render_example(
    seed: int,
    index: int,
    sources: Sources,
    *,
    size: int = 256,
    quality: Quality = FAST,
    shard_size: int = 512,
    materials: str = UNIFORM,
    lobe: str = "furnace",
) -> Example:
    """Draw shape, light, pose, material and background of an example, and render it.

    A corpus of the same seed, sources and options has the same example at this index. Mitsuba must
    be active (`mitsuba_setup.variants.activate`) before TensorFlow is imported.

    Args:
        seed: seed of the corpus.
        index: index of the example in its split.
        sources: sources of the scene; built-in sources must be made with the same seed.
        size: height and width of the images in pixels.
        quality: quality of the layers.
        shard_size: number of examples in a shard; these draw from the same 64 shapes and 64 lights.
        materials: name of the law of the materials, one of `material_law.LAWS`.
        lobe: one of `corpus.LOBES`.

    Raises:
        ValueError: if an input file cannot be used.
        RuntimeError: if no attempt gave a usable scene.
    """
    # `records` imports TensorFlow, which must come after Mitsuba.
    from lime_keras.data import records

    shapes, light_names = sources.of_shard(seed, index // shard_size)
    failures: list[dict[str, Any]] = []
    for attempt in range(_TRIES):
        rng = generator(seed, sources.split, "example", index, attempt)
        shape = shapes[rng.integers(len(shapes))]
        light = sources.light(light_names[rng.integers(len(light_names))], quality)
        mesh, tracer = sources.mesh(shape, size, quality)
        scene = (
            sample_pose(rng, mesh.vertices, size),
            sample_light_rotation(rng, light.strong_direction),
            sample_material(rng, materials),
            sources.backgrounds.sample(rng, size),
        )
        names = {"shape": shape, "light": light.name}
        try:
            rendered = example.render(tracer, light, *scene, lobe=lobe)
            features = rendered | names | {"seed": seed, "index": index}
            return Example(features, records.encode(features), failures)
        except ValueError as error:  # the object is too small, or a value is not finite
            failures.append({"index": index, "attempt": attempt, "error": str(error)} | names)
    raise RuntimeError(
        f"example {index} of seed {seed} failed {_TRIES} times, last of {failures[-1]['shape']} "
        f"under {failures[-1]['light']}: {failures[-1]['error']}; look at these files"
    )
