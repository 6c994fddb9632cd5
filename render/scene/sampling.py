"""Random pose and light rotation of a scene (paper, section 5.1)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lime_keras.optics import environment

_ANGULAR_RADIUS = (math.radians(5), math.radians(16))
"""Range of the angular radius of the object's bounding sphere, in radians.

It reaches from the view of a long lens to the view from an arm's length.
"""
OFF_AXIS = math.radians(10)
"""Largest angle of the object, and so of the crop, from the photo's axis, across and up, in rad."""
_LIGHT_TRIES = 64


class Framing(NamedTuple):
    """A law of the crop around the object.

    Attributes:
        fill: range of the share of the crop that the object's longer side takes. An object that
            takes more than the crop is cut by its frame.
        cut: share of the crops that are moved further, so that the frame may cut the object: by up
            to a quarter of the longest fill, across and up.
    """

    fill: tuple[float, float]
    cut: float = 0.0


NARROW = Framing((0.55, 0.92))  # the crops of photos that are framed by the detector of the mask
WIDE = Framing((0.35, 1.05), cut=0.15)  # more widely drawn crops, to train on
_FARTHEST_CUT = 0.25


@dataclass(frozen=True)
class Pose:
    """The place of an object in camera space, and the camera of the crop around it.

    Attributes:
        rotation: rotation `(3, 3)` from object to camera space.
        translation: `(3,)`, the object's origin in camera space.
        camera: fx, fy, cx, cy in pixels of the crop.
    """

    rotation: np.ndarray
    translation: np.ndarray
    camera: np.ndarray


def turn(angle: float) -> np.ndarray:
    """Return the rotation `(3, 3)` about the vertical by an angle in radians, to the right."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])


def tilt(angle: float) -> np.ndarray:
    """Return the rotation `(3, 3)` by the angle in radians by which a camera looks down."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def sample_rotation(rng: np.random.Generator) -> np.ndarray:
    """Draw a rotation `(3, 3)`, uniform over all orientations, from a random unit quaternion."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def sample_pose(
    rng: np.random.Generator, vertices: np.ndarray, size: int, framing: Framing = NARROW
) -> Pose:
    """Draw the pose of an object before the camera, and the crop of the photo around it.

    Args:
        rng: source of all randomness.
        vertices: vertices of the object, `(V, 3)`, inside the unit sphere.
        size: height and width of the crop in pixels.
        framing: law of the crop.
    """
    rotation = sample_rotation(rng)
    distance = 1.0 / math.sin(rng.uniform(*_ANGULAR_RADIUS))
    across, up = np.tan(rng.uniform(-OFF_AXIS, OFF_AXIS, 2))
    translation = distance * np.array([across, up, -1.0])
    points = vertices @ rotation.T + translation
    projected = points[:, :2] / -points[:, 2:]
    low, high = projected.min(axis=0), projected.max(axis=0)
    share = rng.uniform(*framing.fill)
    focal = share * size / np.max(high - low)
    slack = abs(1 - share) / 2 * size
    shift = rng.uniform(-slack, slack, 2)
    if framing.cut and rng.random() < framing.cut:
        shift += rng.uniform(-_FARTHEST_CUT, _FARTHEST_CUT, 2) * size * framing.fill[1]
    centre = focal * (low + high) / 2
    camera = np.array(
        [focal, focal, size / 2 - centre[0] + shift[0], size / 2 + centre[1] + shift[1]]
    )
    return Pose(rotation, translation, camera)


def sample_light_rotation(rng: np.random.Generator, strong_direction: np.ndarray) -> np.ndarray:
    """Draw a rotation `(3, 3)` from the map's frame to camera space, the strongest light in front.

    The map is turned about its vertical and tilted as a camera is. A draw with the strongest light
    behind the object (z < 0 in camera space) is rejected. If too many draws are rejected, the last
    draw is taken.

    Args:
        rng: source of all randomness.
        strong_direction: direction `(3,)` of the strongest light, in the map's frame.
    """
    for _ in range(_LIGHT_TRIES):
        yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(*environment.CAMERA_PITCH)
        rotation = tilt(pitch) @ turn(yaw)
        if rotation[2] @ strong_direction > 0:
            break
    return rotation
