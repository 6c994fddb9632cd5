"""What is in a scene: plain data, drawn from a random generator (paper, section 5.1)."""

import math
from dataclasses import dataclass

import numpy as np

from lime_keras.material import BlinnPhong
from lime_keras.optics import colour, shininess

_ANGULAR_RADIUS = (math.radians(5), math.radians(16))
"""Of the object's bounding sphere as the camera sees it: from a long lens to an arm's length."""
OFF_AXIS = math.radians(10)
"""How far from the photo's centre the object, and so the crop, may lie."""
FILL = (0.55, 0.92)
"""Share of the crop that the object's longer side takes."""
AMBIENT = (0.0, 0.05)
_LIGHT_PITCH = (math.radians(-10), math.radians(30))
"""The camera looks up or down: the light is tilted by as much."""
_LIGHT_TRIES = 64


@dataclass(frozen=True)
class Pose:
    """Where the object is and how it is cropped.

    Attributes:
        rotation: `(3, 3)`, object to camera space.
        translation: `(3,)`, the object's origin in camera space.
        camera: fx, fy, cx, cy in pixels of the crop.
    """

    rotation: np.ndarray
    translation: np.ndarray
    camera: np.ndarray


def sample_material(rng: np.random.Generator) -> BlinnPhong:
    """m_d uniform in YUV, m_s uniform, s uniform over the bins and log-uniform inside."""
    exponent_bin = rng.integers(shininess.BIN_COUNT)
    log = shininess.LOG_LOW + shininess.BIN_WIDTH * (exponent_bin + rng.uniform())
    return BlinnPhong(
        diffuse_albedo=sample_diffuse_albedo(rng),
        specular_albedo=float(rng.uniform()),
        exponent=float(10.0**log),
        ambient=float(rng.uniform(*AMBIENT)),
    )


def sample_diffuse_albedo(rng: np.random.Generator) -> np.ndarray:
    """Uniform over those YUV colours that are RGB colours: `(3,)` linear RGB in [0, 1].

    Others are rejected; clipping them would pile three quarters of all albedos onto the faces of
    the cube.
    """
    while True:
        rgb = colour.yuv_to_rgb(rng.uniform(colour.YUV_LOW, colour.YUV_HIGH))
        if rgb.min() >= 0 and rgb.max() <= 1:
            return rgb


def sample_rotation(rng: np.random.Generator) -> np.ndarray:
    """Rotation `(3, 3)` uniform over all orientations, from a random unit quaternion."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def sample_pose(rng: np.random.Generator, vertices: np.ndarray, size: int) -> Pose:
    """Put an object before the camera and crop the photo around it.

    Args:
        rng: source of all randomness.
        vertices: `(V, 3)`, inside the unit sphere.
        size: height and width of the crop in pixels.
    """
    rotation = sample_rotation(rng)
    distance = 1.0 / math.sin(rng.uniform(*_ANGULAR_RADIUS))
    across, up = np.tan(rng.uniform(-OFF_AXIS, OFF_AXIS, 2))
    translation = distance * np.array([across, up, -1.0])
    points = vertices @ rotation.T + translation
    projected = points[:, :2] / -points[:, 2:]
    low, high = projected.min(axis=0), projected.max(axis=0)
    fill = rng.uniform(*FILL)
    focal = fill * size / np.max(high - low)
    slack = (1 - fill) / 2 * size
    shift = rng.uniform(-slack, slack, 2)
    centre = focal * (low + high) / 2
    camera = np.array(
        [focal, focal, size / 2 - centre[0] + shift[0], size / 2 + centre[1] + shift[1]]
    )
    return Pose(rotation, translation, camera)


def sample_light_rotation(rng: np.random.Generator, strong_direction: np.ndarray) -> np.ndarray:
    """Rotation `(3, 3)` from the map's frame to camera space with the strong light in front.

    The map turns about its vertical and is tilted as a camera is; draws that leave the strong light
    behind the object (z < 0 in camera space) are rejected. For a light at the zenith or nadir,
    which no turn brings to the front, the last draw is taken.

    Args:
        rng: source of all randomness.
        strong_direction: `(3,)`, in the map's frame.
    """
    for _ in range(_LIGHT_TRIES):
        yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(*_LIGHT_PITCH)
        turn = np.array(
            [
                [math.cos(yaw), 0, math.sin(yaw)],
                [0, 1, 0],
                [-math.sin(yaw), 0, math.cos(yaw)],
            ]
        )
        tilt = np.array(
            [
                [1, 0, 0],
                [0, math.cos(pitch), -math.sin(pitch)],
                [0, math.sin(pitch), math.cos(pitch)],
            ]
        )
        rotation = tilt @ turn
        if rotation[2] @ strong_direction > 0:
            break
    return rotation
