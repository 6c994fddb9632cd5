"""The textures of a bank, pictures to put behind objects."""

import numpy as np

from lime_keras.io import atomic
from lime_keras.synthesis import bank

from ..scene import backgrounds
from ..scene.sources import generator
from .description import Job

COUNT, A_TASK = 256, 32
"""Number of textures of a bank, and of those that a task draws."""


def tasks() -> range:
    """Return the numbers of the tasks."""
    return range(-(-COUNT // A_TASK))


def render(job: Job, number: int) -> int:
    """Draw some textures, or cut them out of the user's pictures, and write them as a part.

    A texture is half as large again as the images, so that crops vary. Each picture is used in
    turn, until there are textures enough.

    Returns:
        The number of textures.

    Raises:
        ValueError: if a picture cannot be read.
    """
    size = job.description.size * 3 // 2
    pictures = job.backgrounds.pictures()
    drawn = []
    for index in range(number * A_TASK, min((number + 1) * A_TASK, COUNT)):
        rng = generator(job.description.seed, job.description.split, "texture", index)
        if pictures:
            texture = backgrounds.photograph(pictures[index % len(pictures)], rng, size)
        else:
            texture = backgrounds.procedural(rng, size)
        drawn.append(np.round(texture * 255).astype(np.uint8))
    with atomic.replacing(job.texture_part(number)) as partial, partial.open("wb") as file:
        np.save(file, np.stack(drawn))
    return len(drawn)


def join(job: Job) -> None:
    """Put the parts together: `(K, T, T, 3)` uint8, sRGB."""
    parts = [np.load(job.texture_part(number)) for number in tasks()]
    with atomic.replacing(job.out / bank.TEXTURES) as partial, partial.open("wb") as file:
        np.save(file, np.concatenate(parts))
