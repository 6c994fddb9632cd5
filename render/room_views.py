"""Views into environment maps, as pictures for `lime-render --backgrounds`: real rooms, cluttered.

    python -m lime_keras.render.room_views hdris/ views/ [views of each map, by default 16]

Only the maps that `lime-render --environments hdris/` deals to the train split are looked into.
Each view is exposed for itself: its geometric mean becomes 18 % grey, or up to a stop more or less.
"""

import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras import colour, environment, shading

from . import environments, sources

HEIGHT, WIDTH = 288, 384
GREY, LARGEST = 0.18, 1e4


def view(maps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A camera's picture `(HEIGHT, WIDTH, 3)`, sRGB in [0, 1], from inside a map `(H, W, 3)`."""
    focal = WIDTH * rng.uniform(0.5, 1.5)  # 90 to 37 degrees across
    heading, pitch = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-35, 15))
    seen = -shading.view_directions(
        np.array([focal, focal, WIDTH / 2, HEIGHT / 2]), HEIGHT, WIDTH
    ).reshape(-1, 3)
    up, forward = seen[:, 1], seen[:, 2]
    seen[:, 1] = np.cos(pitch) * up - np.sin(pitch) * forward
    seen[:, 2] = np.sin(pitch) * up + np.cos(pitch) * forward
    across, forward = seen[:, 0].copy(), seen[:, 2].copy()
    seen[:, 0] = np.cos(heading) * across + np.sin(heading) * forward
    seen[:, 2] = np.cos(heading) * forward - np.sin(heading) * across
    channels = [environment.lookup(maps[..., band], seen) for band in range(3)]
    radiance = np.clip(np.stack(channels, -1), 1e-6, LARGEST).reshape(HEIGHT, WIDTH, 3)
    exposure = GREY / np.exp(np.log(radiance).mean()) * 2.0 ** rng.uniform(-1, 1)
    return colour.linear_to_srgb(np.clip(radiance * exposure, 0, 1))


def main(folder: Path, out: Path, count: int) -> None:
    """Write the views, `NAME-00.png` and so on."""
    out.mkdir(parents=True, exist_ok=True)
    for number, path in enumerate(sources.files(folder, "train", environments.EXTENSIONS)):
        maps = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[..., :3]
        rng = np.random.default_rng((0, number))
        for index in range(count):
            picture = oiio.ImageBuf(np.ascontiguousarray(view(maps, rng), np.float32))
            if not picture.write(str(out / f"{path.stem}-{index:02d}.png"), oiio.UINT8):
                raise OSError(picture.geterror())


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 16)
