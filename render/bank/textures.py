"""The textures of a bank, pictures to put behind objects."""

import numpy as np

from lime_keras.io import atomic
from lime_keras.synthesis import bank

from ..corpus.sources import generator
from ..scene import backgrounds
from .description import TEXTURE_SIZE, TEXTURES, TEXTURES_A_TASK, Job

TASKS = TEXTURES // TEXTURES_A_TASK


def render(job: Job, number: int) -> None:
    """Draw some textures, or cut them out of the user's pictures, and write them as a part.

    Each picture is used in turn, until there are textures enough.

    Raises:
        ValueError: if a picture cannot be read.
    """
    pictures = job.backgrounds.pictures()
    drawn = []
    for index in range(number * TEXTURES_A_TASK, (number + 1) * TEXTURES_A_TASK):
        rng = generator(job.description.seed, job.description.split, "texture", index)
        if pictures:
            path = pictures[index % len(pictures)]
            texture = backgrounds.photograph(path, rng, TEXTURE_SIZE)
        else:
            texture = backgrounds.procedural(rng, TEXTURE_SIZE)
        drawn.append(np.round(texture * 255).astype(np.uint8))
    with atomic.replacing(job.texture_part(number)) as partial, partial.open("wb") as file:
        np.save(file, np.stack(drawn))


def join(job: Job) -> None:
    """Put the parts together: `(K, 192, 192, 3)` uint8, sRGB."""
    parts = [np.load(job.texture_part(number)) for number in range(TASKS)]
    with atomic.replacing(job.out / bank.TEXTURES) as partial, partial.open("wb") as file:
        np.save(file, np.concatenate(parts))
