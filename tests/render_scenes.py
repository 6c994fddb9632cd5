"""What the renderer's tests look at: a sphere, and a light like a photographed one."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import trimesh

from lime_keras.render import meshes


def sphere(subdivisions=5):
    """The unit sphere, as a mesh."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    return meshes.normalised(ball.vertices, ball.faces, ball.vertices)


def photographed(height=256, seed=0):
    """A dim, mottled surround `(H, 2 H)` with a window and three lamps of a few texels."""
    rng = np.random.default_rng(seed)
    coarse = rng.exponential(0.2, (height // 16, height // 8))
    radiance = np.kron(coarse, np.ones((16, 16))) + rng.uniform(0, 0.1, (height, 2 * height))
    window = slice(height // 3, height // 2), slice(height // 5, height // 3)
    radiance[window] += 8.0
    for row, column, strength in ((0.2, 0.7, 900.0), (0.3, 0.1, 3000.0), (0.55, 0.9, 400.0)):
        top, left = int(row * height), int(column * 2 * height)
        radiance[top : top + 2, left : left + 2] += strength
    return radiance


def write_inputs(folder: Path) -> Path:
    """Fill a folder with two meshes in `shapes/` and two maps in `environments/`.

    One file of each for either split.
    """
    (folder / "shapes").mkdir()
    (folder / "environments").mkdir()
    trimesh.creation.icosphere(subdivisions=3).export(folder / "shapes" / "ball.ply")
    trimesh.creation.capsule(count=[16, 16]).export(folder / "shapes" / "capsule.ply")
    for seed in range(2):
        image = oiio.ImageBuf(oiio.ImageSpec(128, 64, 1, oiio.HALF))
        image.set_pixels(oiio.ROI(), photographed(64, seed)[..., None].astype(np.float32))
        if not image.write(str(folder / "environments" / f"map{seed}.exr")):
            raise OSError(image.geterror())
    return folder
