"""Pictures that calibrate eight-bit networks: domes of random materials in random rooms.

The ranges of a network's activations are taken from pictures like those that it was trained on. A
corpus takes the renderer, and minutes; these pictures take NumPy, and seconds.
"""

import math

import numpy as np

from lime_keras.optics import colour, environment, shading

COUNT = 24
"""Number of pictures."""
_ROOM = (8, 16)
"""Rows and columns of a room's light."""
_LAMPS = 4
_EXPONENTS = (0.0, 3.0)
"""Range of log10 s."""
_EXPOSURES = (-0.7, 0.3)
"""Range of log10 of the camera's exposure over the usual one."""


def pictures(size: int) -> np.ndarray:
    """Return pictures `(COUNT, size, size, 3)` float32, sRGB in [0, 1], the same each time.

    Args:
        size: height and width of the pictures in pixels.
    """
    rng = np.random.default_rng(0)
    return np.stack([_picture(rng, size) for _ in range(COUNT)]).astype(np.float32)


def _picture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return one picture `(size, size, 3)`, sRGB in [0, 1]."""
    normal, inside = _dome(rng, size)
    view = np.broadcast_to(np.array([0, 0, 1], np.float32), normal.shape)
    light, energy = shading.texels(_room(rng).astype(np.float32))
    exponent = 10.0 ** rng.uniform(*_EXPONENTS)
    diffuse = shading.diffuse(normal, light, energy)
    specular = shading.specular(normal, view, exponent, light, energy)
    picture = _backdrop(rng, size)
    picture[inside] = rng.uniform(size=3) * diffuse[:, None] + rng.uniform() * specular[:, None]
    exposed = picture * 10.0 ** rng.uniform(*_EXPOSURES)
    return colour.linear_to_srgb(np.clip(exposed, 0, 1))


def _dome(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals `(N, 3)` of an ellipsoid with a wavy surface, and its pixels `(S, S)`."""
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    turn = rng.uniform(0, 2 * math.pi)
    wide, high = rng.uniform(0.45, 0.92, 2)
    across = (x * math.cos(turn) + y * math.sin(turn)) / wide
    along = (y * math.cos(turn) - x * math.sin(turn)) / high
    inside = across**2 + along**2 < 1
    # Normals of the ellipsoid, bent by waves.
    normal = np.stack(
        [across / wide, along / high, np.sqrt(np.maximum(1 - across**2 - along**2, 0))]
    )
    waves = rng.uniform(0, 12, (2, 2, 1, 1))
    strength = rng.uniform(0, 0.5)
    normal[:2] += strength * np.sin(waves[:, 0] * across + waves[:, 1] * along)
    normal = normal[:, inside] / np.linalg.norm(normal[:, inside], axis=0)
    turned = [
        normal[0] * math.cos(turn) - normal[1] * math.sin(turn),
        normal[0] * math.sin(turn) + normal[1] * math.cos(turn),
        normal[2],
    ]
    return np.stack(turned, axis=-1).astype(np.float32), inside


def _room(rng: np.random.Generator) -> np.ndarray:
    """Return the light of a dim room with some lamps, linear radiance, of usual exposure."""
    towards = environment.directions(*_ROOM)
    room = rng.uniform(0.02, 1) * (1 + 0.5 * towards @ rng.uniform(-1, 1, 3))
    for _ in range(_LAMPS):
        direction = rng.normal(size=3)
        cosine = towards @ (direction / np.linalg.norm(direction))
        lit = cosine > math.cos(rng.uniform(0.1, 0.5))
        room[lit] += 10.0 ** rng.uniform(0, 2)
    room = np.maximum(room, 0)
    return room * environment.MEAN_RADIANCE / environment.spherical_mean(room)


def _backdrop(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return linear RGB `(size, size, 3)`: coarse and fine noise of random strength."""
    out = np.broadcast_to(rng.uniform(0, 0.7, 3), (size, size, 3)).copy()
    for cells in (3, 9, 40):
        at = np.arange(size) * cells // size
        out += rng.uniform(0, 0.3) * rng.normal(size=(cells, cells, 3))[at[:, None], at]
    return out
