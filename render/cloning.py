"""Material cloning (paper, section 7): a photographed material on another shape, in the photo.

The photographed object is removed, and the hole is filled smoothly from its surroundings. The
user's mesh is rendered in its place: under the estimated light, by Eq. 4, with the renderer of the
corpora. The mesh casts no shadow, as the paper's image model has none.
"""

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from scipy import ndimage

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square
from lime_keras.material import Material
from lime_keras.optics import colour, environment, shading
from lime_keras.optics.compositing import compose

from .scene import lights
from .scene.example import layers
from .scene.gbuffer import Tracer
from .scene.lights import Light
from .scene.sampling import Pose
from .shapes import meshes
from .shapes.meshes import Mesh

TURN = math.radians(30)
"""Default turn of the mesh about its vertical, to the right, in radians.

A three-quarter view shows more of the shape than a front view.
"""
_PITCH = math.radians(12)
"""Angle by which the camera looks down, in radians, as it does at things on a table."""
_MOST_PIXELS = 1024
"""Largest side of the rendered square in pixels; a larger object is rendered so and enlarged."""
_FINE = (256, 512)
"""Rows and columns to which the estimated light is resampled for rendering."""
_RIM = 0.03
"""Width by which the mask is grown, as a share of the object's size, to hide the old edges."""


def clone(
    photo_srgb: np.ndarray,
    mask: np.ndarray,
    material: Material,
    radiance: np.ndarray,
    mesh_path: str | Path,
    *,
    turn: float = TURN,
) -> np.ndarray:
    """Replace the object of a photo by a mesh of its material, under the estimated light.

    The mesh stands upright (Y up) on the lower edge of the mask's box, in the middle of this edge,
    as large as the box allows. The exposure is the photo's: the light is in units of the photo's
    linear radiance. Call `variants.activate` before TensorFlow is imported.

    Args:
        photo_srgb: the photo, `(H, W, 3)` sRGB in [0, 1].
        mask: mask of the photographed object, `(H, W, 1)` in [0, 1].
        material: m_d, m_s and s, furnace-normalised.
        radiance: environment map `(h, 2 h)` in camera space, linear (see `illumination.estimate`).
        mesh_path: mesh file, in one of the formats `meshes.EXTENSIONS`.
        turn: angle in radians by which the mesh is turned about its vertical.

    Returns:
        The new picture, `(H, W, 3)` float32 sRGB in [0, 1]; equal to the photo outside both
        objects.

    Raises:
        ValueError: if the shapes of photo and mask differ, the mask is empty, the material lacks a
            number, the light is black or not finite, or the mesh cannot be read.
    """
    _check(photo_srgb, mask)
    whole = material.whole()
    if whole is None:
        raise ValueError(
            "the material lacks an albedo or the exponent: estimate everything, without `only`"
        )
    light = _light(radiance)
    mesh = meshes.load(mesh_path)
    square = _square(mask)
    size = min(square.side, _MOST_PIXELS)
    pose = _standing(mesh, mask, turn)
    crop = (pose.camera - np.array([0, 0, square.left, square.top])) * (size / square.side)
    gbuffer = Tracer(mesh, size).trace(pose.rotation, pose.translation, crop)
    diffuse, specular, _ = layers(gbuffer, light, np.eye(3), whole.exponent)
    composed = compose(
        np.asarray(whole.diffuse_albedo),
        np.asarray(whole.specular_albedo),
        np.zeros(1),
        diffuse[None],
        specular[None],
    )[0]
    coverage = gbuffer.coverage[..., None]
    rendered = np.concatenate([coverage * composed, coverage], axis=-1)
    over = framing.paste(rendered, square, *mask.shape[:2])
    old = colour.srgb_to_linear(np.asarray(photo_srgb, np.float32))
    behind = without_object(old, mask)
    # As in the corpus, the sensor clips the sum of object and background in each pixel.
    linear = np.clip(over[..., :3] + (1 - over[..., 3:]) * behind, 0, 1)
    touched = _widened(mask) | (over[..., 3] > 0)
    new = np.clip(colour.linear_to_srgb(linear), 0, 1)
    return np.where(touched[..., None], new, photo_srgb).astype(np.float32)


def without_object(photo_linear: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Fill the place of the object smoothly from its surroundings.

    If the object fills the whole photo there are no surroundings, and the filling is black.

    Args:
        photo_linear: the photo, `(H, W, 3)` linear RGB.
        mask: mask of the object, `(H, W, 1)` in [0, 1].

    Returns:
        The photo without its object, `(H, W, 3)` linear RGB.
    """
    kept = (~_widened(mask))[..., None].astype(np.float32)
    height, width, _ = photo_linear.shape
    source = oiio.ImageBuf(oiio.ImageSpec(width, height, 4, oiio.FLOAT))
    holed = np.concatenate([photo_linear * kept, kept], axis=-1).astype(np.float32)
    source.set_pixels(oiio.ROI(), np.ascontiguousarray(holed))
    filled = oiio.ImageBufAlgo.fillholes_pushpull(source)
    colours = np.asarray(filled.get_pixels(oiio.FLOAT))[..., :3]
    return np.where(kept > 0, photo_linear, np.maximum(colours, 0))


def _check(photo: np.ndarray, mask: np.ndarray) -> None:
    """Raise ValueError if photo and mask do not fit each other, or if the mask is empty."""
    if photo.ndim != 3 or photo.shape[-1] != 3 or mask.shape != (*photo.shape[:2], 1):
        raise ValueError(
            f"a photo (H, W, 3) and its mask (H, W, 1) are expected, got {photo.shape} and "
            f"{mask.shape}"
        )
    if not np.any(mask >= 0.5):
        raise ValueError("the mask is empty: there is no object to replace; pass another mask")


def _light(radiance: np.ndarray) -> Light:
    """Prepare the estimated map at its own brightness, so fine that a lobe shows no texels."""
    fine = environment.rotate(radiance, np.eye(3), *_FINE)
    return lights.prepare("the estimated light", fine, environment.spherical_mean(radiance))


def _box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Return the top, bottom, left and right edge of the object, in pixels."""
    inside = mask[..., 0] >= 0.5
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    return rows[0], rows[-1] + 1, columns[0], columns[-1] + 1


def _square(mask: np.ndarray) -> Square:
    """Return the square that is rendered: it holds the object's box and a pixel on each side."""
    top, bottom, left, right = _box(mask)
    side = max(bottom - top, right - left) + 2
    return Square((top + bottom - side) // 2, (left + right - side) // 2, side)


def _standing(mesh: Mesh, mask: np.ndarray, turn: float) -> Pose:
    """Return the pose of the mesh, upright in the object's box; its camera is in photo pixels."""
    top, bottom, left, right = _box(mask)
    focal, _, centre_x, centre_y = shading.assumed_camera(*mask.shape[:2])
    cosine, sine = math.cos(turn), math.sin(turn)
    turned = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    cosine, sine = math.cos(_PITCH), math.sin(_PITCH)
    rotation = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]) @ turned
    points = mesh.vertices @ rotation.T
    box = np.array([right - left, bottom - top])
    distance = max(np.max(focal * np.ptp(points[:, :2], axis=0) / box), 1.5)
    across, up = ((left + right) / 2 - centre_x) / focal, (centre_y - (top + bottom) / 2) / focal
    translation = distance * np.array([across, up, -1.0])
    points = points + translation
    projected = points[:, :2] / -points[:, 2:]
    low, high = projected.min(axis=0), projected.max(axis=0)
    # The distance is now fixed: focal length and principal point make the mesh fit the box.
    focal = float(np.min(box / np.maximum(high - low, 1e-9)))
    middle = (left + right) / 2 - focal * (low[0] + high[0]) / 2
    return Pose(rotation, translation, np.array([focal, focal, middle, bottom + focal * low[1]]))


def _widened(mask: np.ndarray) -> np.ndarray:
    """Return the pixels `(H, W)` in which the old object may show: the mask and a rim around it."""
    top, bottom, left, right = _box(mask)
    rim = max(1, round(_RIM * max(bottom - top, right - left)))
    distance = ndimage.distance_transform_edt(mask[..., 0] < 0.02)
    return np.asarray(distance <= rim)
