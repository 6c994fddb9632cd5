"""The files of section 7: a photo's light, and its material on another shape (a clone)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lime_keras.io import normal_map, photo
from lime_keras.lighting import guessed_light, illumination
from lime_keras.material import Material
from lime_keras.optics import colour

Clone = Callable[..., np.ndarray]
"""A renderer of clones: puts another shape of the same material in the object's place.

It takes the photo `(H, W, 3)`, sRGB in [0, 1], the mask `(H, W, 1)` in [0, 1], the material, the
light `(h, 2 h)`, linear radiance; by name `alpha`, the photo's transparency `(H, W, 1)`, or None.
It returns the changed photo, `(H, W, 3)` or, with transparency, `(H, W, 4)`.
"""


def write(
    folder: Path,
    name: str,
    image_srgb: np.ndarray,
    material: Material,
    *,
    normals: Path | None,
    clone: Clone | None,
    alpha: np.ndarray | None = None,
) -> None:
    """Estimate a photo's light and write `NAME-environment.exr` and `.png`.

    With a renderer of clones, write `NAME-clone.png` as well.

    Args:
        folder: existing folder for the files.
        name: beginning of the files' names.
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        material: estimate from the photo, with all layers.
        normals: file of the object's normals at the photo's size (`normal_map.read`); None to guess
            the normals from the mask (`guessed_light.estimate`).
        clone: renderer of clones; None to write no clone.
        alpha: the photo's own transparency, `(H, W, 1)` in [0, 1]; None if it has none.

    Raises:
        OSError: if a file cannot be written.
        ValueError: if no object was found, a layer or the albedo is missing, the normals cannot be
            read or have another size than the photo, or the clone cannot be rendered.
    """
    mask = material.layers["mask"]
    if material.mask_coverage == 0:
        raise ValueError("no object was found that could show the light: pass --mask")
    if normals is None:
        light = guessed_light.estimate(image_srgb, material)
    else:
        normal = normal_map.read(normals)
        photo.check_fits(normals, "a normal map", normal.shape, *mask.shape[:2])
        light = illumination.estimate(illumination.from_material(material, normal))
    photo.write(folder / f"{name}-environment.exr", light[..., None])
    mapped = colour.linear_to_srgb(light / (1 + light))
    photo.write(folder / f"{name}-environment.png", mapped[..., None])
    if clone is not None:
        shown = clone(image_srgb, mask, material, light, alpha=alpha)
        photo.write(folder / f"{name}-clone.png", shown)
