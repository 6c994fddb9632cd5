"""Pictures taken inside environment maps: real, cluttered rooms for `lime-render --backgrounds`.

    lime-render views hdris/ views/

Only those maps are used that `lime-render --environments hdris/` assigns to the train split. Each
picture has its own exposure: its geometric mean becomes 18 % grey, up to one stop more or less.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import photo
from lime_keras.optics import colour, environment, shading

from . import backgrounds, environments, sampling, sources

HEIGHT, WIDTH = 288, 384
GREY, LARGEST = 0.18, 1e4


def view(maps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a picture `(HEIGHT, WIDTH, 3)`, sRGB in [0, 1], by a camera in a map `(H, W, 3)`."""
    focal = WIDTH * rng.uniform(0.5, 1.5)  # 90 to 37 degrees across
    heading, pitch = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-35, 15))
    rays = -shading.view_directions(
        np.array([focal, focal, WIDTH / 2, HEIGHT / 2]), HEIGHT, WIDTH
    ).reshape(-1, 3)
    rays = rays @ (sampling.turn(heading) @ sampling.tilt(pitch)).T
    channels = [environment.lookup(maps[..., band], rays) for band in range(3)]
    radiance = np.clip(np.stack(channels, -1), 1e-6, LARGEST).reshape(HEIGHT, WIDTH, 3)
    exposure = GREY / np.exp(np.log(radiance).mean()) * 2.0 ** rng.uniform(-1, 1)
    return colour.linear_to_srgb(np.clip(radiance * exposure, 0, 1))


def write_views(
    folder: Path, out: Path, count: int, on_picture: Callable[[int, int], None]
) -> None:
    """Write `count` pictures of each map of the train split, `NAME-00.png` and so on.

    Raises:
        OSError: if a picture cannot be written.
        ValueError: if the folder holds too few maps, or a map cannot be read.
    """
    out.mkdir(parents=True, exist_ok=True)
    paths = sources.files(folder, "train", environments.EXTENSIONS)
    stems = [path.stem for path in paths]
    if alike := [path.name for path in paths if stems.count(path.stem) > 1]:
        raise ValueError(
            f"the pictures of {' and '.join(alike)} would have the same names: rename a map"
        )
    for number, path in enumerate(paths):
        maps = np.asarray(backgrounds.read(path)[0].get_pixels(oiio.FLOAT))
        maps = maps[..., :3] if maps.shape[2] >= 3 else np.repeat(maps[..., :1], 3, axis=2)
        rng = np.random.default_rng((0, number))
        for index in range(count):
            photo.write(out / f"{path.stem}-{index:02d}.png", view(maps, rng))
            on_picture(number * count + index + 1, len(paths) * count)
