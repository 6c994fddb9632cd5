"""One example of a corpus: a scene drawn at random from seed and index, and rendered."""

import functools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.io import photo
from lime_keras.optics.material_law import UNIFORM, sample_material

from ..jobs import inputs
from ..rooms import random_room
from ..scene import backgrounds, environments, example, light_law, mixing
from ..scene.gbuffer import Tracer
from ..scene.lights import Light, prepare
from ..scene.quality import FAST, Quality
from ..scene.sampling import NARROW, WIDE, sample_light_rotation, sample_pose
from ..scene.sources import MAPS, MIXED, ROOMS, generator, random_subset
from ..shapes import endless, meshes

SHAPES = {"train": 400, "test": 100}
SKIES = 48  # number of skies, which mixed lights have beside rooms
MOST = 64
"""Largest number of bodies, and of lights, that a shard draws from.

A worker can hold so many in memory, so each is made once in a shard.
"""
EXAMPLES = 8
"""Examples that share a body or a mixed light: to make one takes as long as to render three."""
_SKY_ROWS = 512
_LARGEST_MAP = 512
"""Largest number of rows of a light; larger maps are averaged down, as they light no better."""
_TRIES = 20


class Sources:
    """The shapes, lights and backgrounds of a split: the user's files, or built-in ones.

    What is built in follows from the seed and the split, and from the numbers in its name. The
    meshes and lights that were used last stay in memory, and so do all maps that are mixed.

    Args:
        split: `train` or `test`; the two share no built-in shape and no room.
        seed: seed of the corpus.
        rooms: folder that keeps the maps of the rooms, which are rendered when first drawn; in a
            corpus it is `CORPUS/SPLIT/rooms`.
        files: the user's files by kind of `inputs.KINDS`; a kind without files is built in.
        shape_count: number of built-in shapes; None for that of `SHAPES`.
        light_count: number of rooms; None for that of `ROOMS`.
        light_split: split whose lights are used; None for `split`.
        law: one of `LIGHT_LAWS`. Single maps are the files, or rooms. Mixed lights are made of all
            files, rooms and skies; crops and backgrounds are then drawn more widely, too
            (`sampling.WIDE`, `backgrounds.varied`).
        endless: share of the bodies that no other shard has.

    Attributes:
        shape_names: names of the listed shapes, in a fixed order.
        light_names: names of the maps, in a fixed order.
        room_names: names of the rooms among these maps.
    """

    def __init__(
        self,
        split: str,
        seed: int,
        rooms: Path,
        files: Mapping[str, Sequence[Path]] | None = None,
        *,
        shape_count: int | None = None,
        light_count: int | None = None,
        light_split: str | None = None,
        law: str = MAPS,
        endless: float = 0.0,
    ):
        self._shapes, self._maps, self._pictures = (
            {path.name: path for path in (files or {}).get(kind, ())} for kind in inputs.KINDS
        )
        self.split, self.seed, self.rooms = split, seed, rooms
        self._light_split, self._endless = light_split or split, endless
        self.is_mixed = law == MIXED
        count = shape_count or SHAPES[split]
        self.shape_names = list(self._shapes) or [f"{split}-{k:04d}" for k in range(count)]
        count = light_count or ROOMS[self._light_split]
        has_rooms = self.is_mixed or not self._maps
        self.room_names = [f"room-{k:04d}.exr" for k in range(count if has_rooms else 0)]
        skies = [f"sky-{k:04d}" for k in range(SKIES if self.is_mixed else 0)]
        self.light_names = list(dict.fromkeys([*self._maps, *self.room_names, *skies]))
        self.mesh = functools.lru_cache(MOST)(self._mesh)
        self.light = functools.lru_cache(MOST)(self._light)
        self._map = functools.cache(lambda name: mixing.as_map(self._radiance(name)))

    def names_in_shard(self, shard: int, shard_size: int) -> tuple[list[str], list[str]]:
        """Return the names of the bodies and of the lights that a shard draws from.

        Where some bodies are endless, each listed shape comes as often as the others.
        """
        rng, names = generator(self.seed, self.split, "shard", shard), self.shape_names
        number = min(MOST, math.ceil(shard_size / EXAMPLES))
        if self._endless:
            rounds = math.ceil(number / len(names))
            order = np.concatenate([rng.permutation(len(names)) for _ in range(rounds)])
            bodies = [
                f"endless-{shard:05d}-{k:02d}" if lot < self._endless else names[order[k]]
                for k, lot in enumerate(rng.random(number))
            ]
        else:
            bodies = random_subset(rng, names, MOST)
        if self.is_mixed:
            return bodies, [f"mixed-{shard:05d}-{k:02d}" for k in range(number)]
        return bodies, random_subset(rng, self.light_names, MOST)

    def maps_in_shard(self, shard: int, shard_size: int) -> set[str]:
        """Return the names of the maps that the lights of a shard are made of."""
        lights = self.names_in_shard(shard, shard_size)[1]
        if not self.is_mixed:
            return set(lights)
        return {name for light in lights for name in self._draw(light)[1]}

    def _mesh(self, name: str, size: int, quality: Quality = FAST) -> tuple[meshes.Mesh, Tracer]:
        """Load or make the mesh of that name; ValueError is raised if its file is unusable."""
        if name in self._shapes:
            mesh = meshes.load(self._shapes[name])
        elif name.startswith("endless-"):
            mesh = endless.endless(_generator(self.seed, self.split, "body", name))
        else:
            mesh = endless.procedural(_generator(self.seed, self.split, "shape", name))
        # Test splits keep what they show, and so the rays one by one.
        return mesh, Tracer(mesh, size, quality, packets=self.split != "test")

    def _light(self, name: str, quality: Quality = FAST) -> Light:
        """Load the map of that name, or mix the light of that name, under its strongest map's."""
        if name in self._maps or not name.startswith("mixed-"):
            return prepare(name, self._radiance(name), quality=quality)
        drawn, names = self._draw(name)
        radiance = mixing.mixed([self._map(name) for name in names], drawn)
        return prepare(names[drawn.powers.argmax()], radiance, quality=quality)

    def _draw(self, name: str) -> tuple[light_law.LightDraw, list[str]]:
        """Return the mixed light of that name, and the names of its maps."""
        rng = _generator(self.seed, self._light_split, "light", name)
        drawn = light_law.draw(rng, len(self.light_names))
        return drawn, [self.light_names[index] for index in drawn.maps]

    def _radiance(self, name: str) -> np.ndarray:
        """Return the radiance `(H, W)` of the map of that name, H at most 512."""
        if name.startswith("sky-") and name not in self._maps:
            # `skies` imports Mitsuba, which must wait until `variants.activate` chose its library.
            from ..scene import skies

            return skies.sample(_generator(self.seed, self._light_split, "sky", name), _SKY_ROWS)
        path = self._maps.get(name, self.rooms / name)
        if name not in self._maps and not path.is_file():
            self.render_room(name)
        radiance = environments.read(path)[0]
        if len(radiance) > _LARGEST_MAP:
            height = min(_LARGEST_MAP, radiance.shape[1] // 2)
            radiance = environments.resized(radiance, height).astype(np.float32, "C")
        return radiance

    def render_room(self, name: str) -> None:
        """Render one room into its folder; Mitsuba's variant must be set before."""
        # `renderer` imports Mitsuba, which must wait until `variants.activate` chose its library.
        from ..rooms import renderer

        rng = _generator(self.seed, self._light_split, "room", name)
        radiance = renderer.render(random_room.sample(rng), seed=int(rng.integers(2**31)))
        photo.write(self.rooms / name, np.minimum(radiance, 65504)[..., None], shared=True)

    def background(self, rng: np.random.Generator, size: int) -> np.ndarray:
        """Draw a texture, or a crop of one of the pictures: `(size, size, 3)`, sRGB in [0, 1].

        Raises:
            ValueError: if the picture cannot be read.
        """
        if not self._pictures:
            return backgrounds.procedural(rng, size)
        pictures = list(self._pictures.values())
        return backgrounds.photograph(pictures[rng.integers(len(pictures))], rng, size)


def _generator(seed: int, split: str, kind: str, name: str) -> np.random.Generator:
    """Return the generator of a thing by the numbers in its name."""
    return generator(seed, split, kind, *map(int, re.findall(r"\d+", name)))


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

    A corpus of the same sources and options has the same example at this index. Mitsuba must
    be active (`mitsuba_setup.variants.activate`) before TensorFlow is imported.

    Args:
        index: index of the example in its split.
        sources: sources of the scene, which have the seed of the corpus.
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

    bodies, lights = sources.names_in_shard(index // shard_size, shard_size)
    failures: list[dict[str, Any]] = []
    for attempt in range(_TRIES):
        rng = generator(sources.seed, sources.split, "example", index, attempt)
        # Where none of a shard's few bodies may do, another shape does.
        some = bodies if attempt < _TRIES // 2 else sources.shape_names
        body = some[rng.integers(len(some))]
        light = sources.light(lights[rng.integers(len(lights))], quality)
        mesh, tracer = sources.mesh(body, size, quality)
        pose = sample_pose(rng, mesh.vertices, size, WIDE if sources.is_mixed else NARROW)
        rotation = sample_light_rotation(rng, light.strong_direction)
        material = sample_material(rng, materials)
        picture = functools.partial(sources.background, rng, size)
        seen = functools.partial(backgrounds.surroundings, rng, light, rotation, pose.camera, size)
        background = backgrounds.varied(rng, size, picture, seen) if sources.is_mixed else picture()
        scene = pose, rotation, material, background
        names = {"shape": body, "light": light.name}
        try:
            rendered = example.render(tracer, light, *scene, lobe=lobe)
            features = rendered | names | {"seed": sources.seed, "index": index}
            return Example(features, records.encode(features), failures)
        except ValueError as error:  # the object is too small, or a value is not finite
            failures.append({"index": index, "attempt": attempt, "error": str(error)} | names)
    raise RuntimeError(
        f"example {index} of seed {sources.seed} failed {_TRIES} times, last of "
        f"{failures[-1]['shape']} under {failures[-1]['light']}: {failures[-1]['error']}; look at "
        "these files"
    )
