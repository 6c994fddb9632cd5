"""Material cloning (paper, section 7): a photographed material on another shape, in the photo.

The photographed object is removed, and the hole is filled smoothly from its surroundings. The
user's mesh is rendered in its place: under the estimated light, by Eq. 4, with the renderer of the
corpora. The mesh shades itself no more than the paper's image model does; if asked, it casts a
shadow on the ground that it stands on. The old object's own shadow stays.
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
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.compositing import compose_image

from .scene import contact_shadow, lights
from .scene.example import layers
from .scene.gbuffer import Tracer
from .scene.lights import Light
from .scene.sampling import Pose, tilt, turn
from .shapes import meshes
from .shapes.meshes import Mesh

_TURN = math.radians(30)
"""Turn of the mesh about its vertical, to the right, in radians.

A three-quarter view shows more of the shape than a front view.
"""
_TILT = tilt(math.radians(12))
"""Rotation from upright to camera space, which looks down as one does at things on a table."""
_GROUND = _TILT[:, 1]  # unit normal of the ground in camera space
_MOST_PIXELS = 1024
"""Largest side of the rendered square in pixels; a larger object is rendered so and enlarged."""
_FINE = (256, 512)  # rows and columns to which the estimated light is resampled for rendering
_RIM = 0.03
"""Width by which the mask is grown, as a share of the object's size, to hide the old edges."""
UPRIGHT = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
"""Rotations that stand a mesh upright, by the axis that points up in its file."""
_SHADOW_REACH = 3  # side of the square that may be shadowed, in sides of the rendered square
_SHADOW_PIXELS = 384
"""Largest side of the shadow in pixels; it is soft, so a larger one is enlarged."""
_SHADOW_FADE = 0.15
"""Share of the shadow's square, at each edge, over which a long shadow fades out."""
_VISIBLE = 1 / 512  # least share of light taken that changes a pixel of 8 bits


def clone(
    photo_srgb: np.ndarray,
    mask: np.ndarray,
    material: Material,
    radiance: np.ndarray,
    mesh_path: str | Path,
    *,
    up: str = "y",
    shadow: bool = False,
    alpha: np.ndarray | None = None,
) -> np.ndarray:
    """Replace the object of a photo by a mesh of its material, under the estimated light.

    The mesh stands upright on the lower edge of the mask's box, in the middle of this edge, as
    large as the box allows. The exposure is the photo's: the light is in units of the photo's
    linear radiance. Call `variants.activate` before TensorFlow is imported.

    Args:
        photo_srgb: the photo, `(H, W, 3)` sRGB in [0, 1].
        mask: mask of the photographed object, `(H, W, 1)` in [0, 1], somewhere 0.5 or more.
        material: m_d, m_s and s, furnace-normalised.
        radiance: environment map `(h, 2 h)` in camera space, linear (see `illumination.estimate`).
        mesh_path: mesh file, in one of the formats `meshes.EXTENSIONS`.
        up: axis that points up in the mesh file, one of `UPRIGHT`.
        shadow: whether the mesh casts a shadow on the ground that it stands on, a plane.
        alpha: the photo's own transparency, `(H, W, 1)` in [0, 1], as `photo.read` gives it with
            the photo; None if nothing of the photo is transparent.

    Returns:
        The new picture, float32 sRGB in [0, 1]; equal to the photo where neither object nor shadow
        is. `(H, W, 3)`, or with `alpha` `(H, W, 4)`, whose colour is multiplied by its alpha, as
        `photo.write` takes it: what was transparent behind the object stays so, and a shadow on it
        is black of the shadow's opacity.

    Raises:
        ValueError: if the material lacks a number, the light is black or not finite, or the mesh
            cannot be read.
    """
    whole = material.whole()
    if whole is None:
        raise ValueError(
            "the material lacks an albedo or the exponent: estimate everything, without `only`"
        )
    # Render the mesh and its shadow; at the light's own brightness, so fine that no texel shows.
    fine = environment.rotate(radiance, np.eye(3), *_FINE)
    light = lights.prepare("the estimated light", fine, environment.spherical_mean(radiance))
    mesh = meshes.load(mesh_path)
    pose = _upright_pose(mesh, mask, UPRIGHT[up])
    over = _rendered(mesh, light, pose, mask, whole)
    shade = _shadow(mesh, light, pose, mask) if shadow else np.zeros_like(mask)
    shade = np.where(shade < _VISIBLE, 0, shade)

    # Composite them over what lies behind the old object, in linear light.
    opaque = np.ones_like(mask) if alpha is None else alpha
    # The photo's colours come multiplied by alpha. Linear light is made of the colours themselves.
    old = opaque * colour.srgb_to_linear(_divided(np.asarray(photo_srgb, np.float32), opaque))
    behind = (1 - shade) * without_object(old, mask)
    # As in the corpus, the sensor clips the sum of object and background in each pixel.
    linear = np.clip(over[..., :3] + (1 - over[..., 3:]) * behind, 0, 1)
    touched = _widened(mask)[..., None] | (over[..., 3:] > 0) | (shade > 0)

    # Encode; keep the bytes of the photo elsewhere.
    if alpha is None:
        new = np.clip(colour.linear_to_srgb(linear), 0, 1)
        return np.where(touched, new, photo_srgb).astype(np.float32)
    left = without_object(np.repeat(alpha, 3, axis=-1).astype(np.float32), mask)[..., :1]
    covered = np.clip(1 - (1 - over[..., 3:]) * (1 - shade) * (1 - left), 0, 1)
    straight = np.clip(colour.linear_to_srgb(_divided(linear, covered)), 0, 1)
    new = np.concatenate([straight * covered, covered], axis=-1)
    kept = np.concatenate([photo_srgb, alpha], axis=-1)
    return np.where(touched, new, kept).astype(np.float32)


def _rendered(
    mesh: Mesh, light: Light, pose: Pose, mask: np.ndarray, material: BlinnPhong
) -> np.ndarray:
    """Return the mesh in the photo's pixels: linear RGB times coverage, and coverage, `(H, W, 4)`.

    The mesh casts no light and no shadow on itself.
    """
    square = _square(mask)
    size = min(square.side, _MOST_PIXELS)
    crop = _cropped(pose, square, size)
    gbuffer = Tracer(mesh, size).trace(crop.rotation, crop.translation, crop.camera)
    diffuse, specular, _ = layers(gbuffer, light, np.eye(3), material.exponent)
    composed = compose_image(material, diffuse, specular)
    coverage = gbuffer.coverage[..., None]
    rendered = np.concatenate([coverage * composed, coverage], axis=-1)
    return framing.paste(rendered, square, *mask.shape[:2])


def _shadow(mesh: Mesh, light: Light, pose: Pose, mask: np.ndarray) -> np.ndarray:
    """Return the share of its light that the ground loses to the mesh, `(H, W, 1)` in [0, 1]."""
    shown = _square(mask)
    side = _SHADOW_REACH * shown.side
    more = (side - shown.side) // 2
    square = Square(shown.top - more, shown.left - more, side)
    size = min(side, _SHADOW_PIXELS)
    shade = contact_shadow.shade(mesh, light, _cropped(pose, square, size), _GROUND, size)
    middle = (np.arange(size) + 0.5) / size
    fade = np.clip(np.minimum(middle, 1 - middle) / _SHADOW_FADE, 0, 1)
    fade = fade * fade * (3 - 2 * fade)
    return framing.paste((shade * fade * fade[:, None])[..., None], square, *mask.shape[:2])


def _cropped(pose: Pose, square: Square, size: int) -> Pose:
    """Return a pose whose camera is in pixels of a square of the photo, resampled to `size`."""
    camera = (pose.camera - np.array([0, 0, square.left, square.top])) * (size / square.side)
    return Pose(pose.rotation, pose.translation, camera)


def _divided(colours: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Return colours `(H, W, 3)` divided by alpha `(H, W, 1)`, at most 1; 0 where alpha is 0."""
    return np.where(alpha > 0, np.minimum(colours / np.maximum(alpha, 1e-30), 1), 0)


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
    holed = np.ascontiguousarray(np.concatenate([photo_linear * kept, kept], axis=-1), np.float32)
    filled = oiio.ImageBufAlgo.fillholes_pushpull(oiio.ImageBuf(holed))
    colours = np.asarray(filled.get_pixels(oiio.FLOAT))[..., :3]
    return np.where(kept > 0, photo_linear, np.maximum(colours, 0))


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


def _upright_pose(mesh: Mesh, mask: np.ndarray, upright: np.ndarray) -> Pose:
    """Return the pose of the mesh, upright in the object's box; its camera is in photo pixels."""
    top, bottom, left, right = _box(mask)
    focal, _, centre_x, centre_y = shading.assumed_camera(*mask.shape[:2])
    rotation = _TILT @ turn(_TURN) @ upright
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
