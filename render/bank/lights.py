"""The lights of a bank, one by one and put together: photographs, rooms, skies."""

import json

import numpy as np

from lime_keras.io import atomic
from lime_keras.optics import environment
from lime_keras.synthesis.lights import LISTED, RADIANCE, SHAPE

from ..scene import environments
from ..scene.lights import Light, prepare
from ..scene.sources import generator
from .description import Job

_LARGEST = 2.0**15
"""Largest stored value; a half float holds 65,504."""


def reduced(radiance: np.ndarray) -> tuple[np.ndarray, float]:
    """Reduce a map to the size of a bank's lights, without losing light.

    A map with fewer rows is enlarged first by repeating its texels.

    Args:
        radiance: linear radiance `(H, W)`, at least 0.

    Returns:
        The map in half floats, `(256, 512)`, and the factor, a power of two, which makes its
        spherical mean 1.

    Raises:
        ValueError: if the map is black or not finite.
    """
    rows, columns = radiance.shape
    repeats = max(-(-SHAPE[0] // rows), -(-SHAPE[1] // columns))
    radiance = radiance.repeat(repeats, axis=0).repeat(repeats, axis=1)
    small = environments.resized(radiance, SHAPE[0]).astype(np.float64)
    mean = environment.spherical_mean(small)
    if not np.isfinite(mean) or mean <= 0:
        raise ValueError(f"the map's mean radiance is {mean}; a light must shine")
    small /= mean
    scale = 2.0 ** max(0, np.ceil(np.log2(small.max() / _LARGEST)))
    return (small / scale).astype(np.float16), float(scale)


def render(job: Job, number: int) -> None:
    """Render or read one light, and write it as a part.

    Raises:
        ValueError: if the file of the map cannot be used.
    """
    kind, name = job.light_names()[number]
    if kind == "sky":
        light = _sky(job, name)
    else:
        light = job.light_source(kind).load(name)
    radiance, scale = reduced(light.radiance)
    with atomic.replacing(job.light_part(number)) as partial:
        np.savez(partial, radiance=radiance, scale=scale, strong=light.strong_direction)


def _sky(job: Job, name: str) -> Light:
    # `skies` imports Mitsuba, which must wait until `variants.activate` chose its library.
    from . import skies

    index = int(name.removeprefix("sky-"))
    rng = generator(job.description.seed, job.description.split, "sky", index)
    return prepare(name, skies.sample(rng, SHAPE[0]))


def join(job: Job) -> None:
    """Put the parts together, and write the list of the lights last."""
    listed, maps = [], []
    for number, (kind, name) in enumerate(job.light_names()):
        with np.load(job.light_part(number), allow_pickle=False) as part:
            maps.append(part["radiance"])
            strong, scale = part["strong"].tolist(), float(part["scale"])
        entry = {"name": name, "kind": kind, "scale": scale, "strong_direction": strong}
        listed.append(entry)
    with atomic.replacing(job.out / RADIANCE) as partial, partial.open("wb") as file:
        np.save(file, np.stack(maps))
    atomic.write(job.out / LISTED, json.dumps(listed, indent=1) + "\n")
