"""Material cloning (paper, section 7): a photographed material on another shape, in the photo.

The photographed object is taken out of the picture, what was behind it guessed smoothly, and the
user's mesh put in its place: under the estimated light, by Eq. 4 and with the corpus' own renderer.
No shadow is cast, as the model of the scene has none.
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
"""About the mesh's vertical, to the right: a three-quarter view shows more than a front."""
_PITCH = math.radians(12)
"""The camera looks down at things that stand on a table."""
_MOST_PIXELS = 1024
"""Across what is rendered; larger objects are rendered at this size and enlarged."""
_FINE = (256, 512)
"""Texels of the light as it is rendered."""
_RIM = 0.03
"""Of the object's size: the mask is widened by it, so that no edge of the old object stays."""


def clone(
    photo_srgb: np.ndarray,
    mask: np.ndarray,
    material: Material,
    radiance: np.ndarray,
    mesh_path: str | Path,
    *,
    turn: float = TURN,
) -> np.ndarray:
    """Put a mesh of the estimated material, under the estimated light, in the object's place.

    The mesh stands upright (Y up) on the lower edge of the mask's box, in its middle, as large as
    fits. Exposure is the photo's: the light is in units of its linear radiance. Call
    `variants.activate` before TensorFlow is imported.

    Args:
        photo_srgb: `(H, W, 3)` sRGB in [0, 1].
        mask: `(H, W, 1)` of the photographed object, in [0, 1].
        material: m_d, m_s and s; furnace-normalised.
        radiance: the light `(h, 2 h)` in camera space, linear; of `illumination.estimate`.
        mesh_path: one of `meshes.EXTENSIONS`.
        turn: of the mesh about its vertical, in radians.

    Returns:
        `(H, W, 3)` float32 sRGB in [0, 1]; as the photo away from both objects.

    Raises:
        ValueError: if the shapes differ, the mask is empty, the material lacks a number, the light
            is black or unsound, or the mesh cannot be read.
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
    # As the corpus: the sensor clips what a pixel has gathered, object and background together.
    linear = np.clip(over[..., :3] + (1 - over[..., 3:]) * behind, 0, 1)
    touched = _widened(mask) | (over[..., 3] > 0)
    new = np.clip(colour.linear_to_srgb(linear), 0, 1)
    return np.where(touched[..., None], new, photo_srgb).astype(np.float32)


def without_object(photo_linear: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """A photo `(H, W, 3)` whose object `(H, W, 1)` is replaced by what surrounds it, smoothly.

    Where the object fills all of the photo nothing surrounds it, and black is behind it.
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
    """Refuse what cannot be cloned."""
    if photo.ndim != 3 or photo.shape[-1] != 3 or mask.shape != (*photo.shape[:2], 1):
        raise ValueError(
            f"a photo (H, W, 3) and its mask (H, W, 1) are expected, got {photo.shape} and "
            f"{mask.shape}"
        )
    if not np.any(mask >= 0.5):
        raise ValueError("the mask is empty: there is no object to replace; pass another mask")


def _light(radiance: np.ndarray) -> Light:
    """The estimated map at its own brightness, so fine that no sharp lobe tells its texels."""
    fine = environment.rotate(radiance, np.eye(3), *_FINE)
    return lights.prepare("the estimated light", fine, environment.spherical_mean(radiance))


def _box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Top, bottom, left and right edge of the object."""
    inside = mask[..., 0] >= 0.5
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    return rows[0], rows[-1] + 1, columns[0], columns[-1] + 1


def _square(mask: np.ndarray) -> Square:
    """What is rendered: the box and a pixel on each side."""
    top, bottom, left, right = _box(mask)
    side = max(bottom - top, right - left) + 2
    return Square((top + bottom - side) // 2, (left + right - side) // 2, side)


def _standing(mesh: Mesh, mask: np.ndarray, turn: float) -> Pose:
    """The mesh upright in the object's box; its camera is in pixels of the photo."""
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
    # Seen from there, the lens and where the photo is cut from are what makes it fit.
    focal = float(np.min(box / np.maximum(high - low, 1e-9)))
    middle = (left + right) / 2 - focal * (low[0] + high[0]) / 2
    return Pose(rotation, translation, np.array([focal, focal, middle, bottom + focal * low[1]]))


def _widened(mask: np.ndarray) -> np.ndarray:
    """Where the old object may show `(H, W)`: the mask and a rim."""
    top, bottom, left, right = _box(mask)
    rim = max(1, round(_RIM * max(bottom - top, right - left)))
    distance = ndimage.distance_transform_edt(mask[..., 0] < 0.02)
    return np.asarray(distance <= rim)
