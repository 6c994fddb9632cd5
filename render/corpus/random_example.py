"""One example of a corpus: a scene drawn at random from seed and index, and rendered."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.optics.material_law import UNIFORM, sample_material

from ..scene import backgrounds as pictures
from ..scene import example, light_law, mixing
from ..scene.gbuffer import Tracer
from ..scene.lights import Light, prepare
from ..scene.quality import FAST, Quality
from ..scene.sampling import NARROW, WIDE, sample_light_rotation, sample_pose
from ..scene.sources import (
    MIXED,
    BackgroundSource,
    LightSource,
    ShapeSource,
    generator,
    random_subset,
)
from ..shapes.endless import endless
from ..shapes.meshes import Mesh
from . import bodies
from .bodies import Body

_TRIES = 20

Lamp = str | tuple[int, int]
"""What lights a scene: the name of a map, or the numbers of a shard and of a mixed light in it."""


class Sources:
    """The sources that the scenes of a split are drawn from.

    The meshes and lights that were used last stay in memory, and so do all maps that are mixed.

    Args:
        shapes: source of the split's shapes.
        lights: source of the split's lights. Under the law of mixed lights, crops and backgrounds
            are drawn more widely, too (`sampling.WIDE`, `backgrounds.varied`).
        backgrounds: source of the split's backgrounds.
        endless: share of the bodies that no other shard has (`bodies`).
    """

    def __init__(
        self,
        shapes: ShapeSource,
        lights: LightSource,
        backgrounds: BackgroundSource,
        endless: float = 0.0,
    ):
        self.split = shapes.split
        self.shape_names = shapes.names()
        self.light_names = lights.names()
        self.backgrounds = backgrounds
        self.is_mixed = lights.law == MIXED
        self._shapes, self._lights, self._endless = shapes, lights, endless
        self.mesh = functools.lru_cache(bodies.MOST)(self._mesh)
        self.light = functools.lru_cache(bodies.MOST)(self._light)
        self._map = functools.cache(lambda name: mixing.as_map(lights.radiance(name)))

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
            ShapeSource((), split, seed),
            LightSource((), split, seed, rooms),
            BackgroundSource(()),
        )

    def names_in_shard(
        self, seed: int, shard: int, shard_size: int
    ) -> tuple[list[Body], list[Lamp]]:
        """Return the bodies and the lights that a shard draws from."""
        rng = generator(seed, self.split, "shard", shard)
        if self._endless:
            drawn = bodies.draw(rng, self.shape_names, self._endless, shard, shard_size)
        else:
            drawn = [Body(name) for name in random_subset(rng, self.shape_names, bodies.MOST)]
        if self.is_mixed:
            return drawn, [(shard, number) for number in range(bodies.count(shard_size))]
        return drawn, [*random_subset(rng, self.light_names, bodies.MOST)]

    def maps_in_shard(self, seed: int, shard: int, shard_size: int) -> set[str]:
        """Return the names of the maps that the lights of a shard are made of."""
        lamps = self.names_in_shard(seed, shard, shard_size)[1]
        return {
            name
            for lamp in lamps
            for name in ([lamp] if isinstance(lamp, str) else self._draw(lamp)[1])
        }

    def _mesh(self, body: Body, size: int, quality: Quality) -> tuple[Mesh, Tracer]:
        if body.place is None:
            mesh = self._shapes.load(body.name)
        else:
            mesh = endless(generator(self._shapes.seed, self.split, "body", *body.place))
        # Test splits keep what they show, and so the rays one by one.
        return mesh, Tracer(mesh, size, quality, packets=self.split != "test")

    def _light(self, lamp: Lamp, quality: Quality) -> Light:
        """Load the map of that name, or mix the light of that number, under its strongest map's."""
        if isinstance(lamp, str):
            return self._lights.load(lamp, quality)
        drawn, names = self._draw(lamp)
        radiance = mixing.mixed([self._map(name) for name in names], drawn)
        return prepare(names[drawn.powers.argmax()], radiance, quality=quality)

    def _draw(self, place: tuple[int, int]) -> tuple[light_law.LightDraw, list[str]]:
        """Return the mixed light of a shard's number and a number in it, and its maps' names."""
        rng = generator(self._lights.seed, self.split, "light", *place)
        drawn = light_law.draw(rng, len(self.light_names))
        return drawn, [self.light_names[index] for index in drawn.maps]


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
        shard_size: number of examples in a shard; these share at most 64 bodies and 64 lights.
        materials: name of the law of the materials, one of `material_law.LAWS`.
        lobe: one of `corpus.LOBES`.

    Raises:
        ValueError: if an input file cannot be used.
        RuntimeError: if no attempt gave a usable scene.
    """
    # `records` imports TensorFlow, which must come after Mitsuba.
    from lime_keras.data import records

    drawn, lamps = sources.names_in_shard(seed, index // shard_size, shard_size)
    failures: list[dict[str, Any]] = []
    for attempt in range(_TRIES):
        rng = generator(seed, sources.split, "example", index, attempt)
        body = drawn[rng.integers(len(drawn))]
        light = sources.light(lamps[rng.integers(len(lamps))], quality)
        mesh, tracer = sources.mesh(body, size, quality)
        pose = sample_pose(rng, mesh.vertices, size, WIDE if sources.is_mixed else NARROW)
        rotation = sample_light_rotation(rng, light.strong_direction)
        material = sample_material(rng, materials)
        background = _background(rng, sources, light, rotation, pose.camera, size)
        scene = pose, rotation, material, background
        names = {"shape": body.name, "light": light.name}
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


def _background(
    rng: np.random.Generator,
    sources: Sources,
    light: Light,
    rotation: np.ndarray,
    camera: np.ndarray,
    size: int,
) -> np.ndarray:
    """Draw a background `(size, size, 3)`, sRGB; a varied one under the law of mixed lights."""
    if not sources.is_mixed:
        return sources.backgrounds.sample(rng, size)
    return pictures.varied(
        rng,
        size,
        lambda: sources.backgrounds.sample(rng, size),
        lambda: pictures.surroundings(rng, light, rotation, camera, size),
    )
