"""The shadow of a mesh on the ground that it stands on, under an environment map.

The ground is a plane through the mesh's lowest point. It is not seen itself; only the share of its
light that the mesh leaves to it is computed. Equally strong rays take the place of the light of
the map's upper half, the same at every pixel. So the shadow has no noise: each ray changes it by
one step of 1/256.
"""

import numpy as np

from lime_keras.optics import environment, shading

from ..shapes.meshes import Mesh
from .gbuffer import mitsuba_mesh
from .lights import Light
from .sampling import Pose

_RAYS, _SLOW_RAYS = 256, 48
"""Number of rays at each pixel, and the same where Mitsuba traces them one by one."""
_ROWS = 64  # rows of the light's level from which the rays are drawn, at most
_GAP = 1e-3
"""Height of the mesh above the plane; so a flat bottom lies between the ground and its light."""
_MOST_RAYS = 2**21  # largest number of rays that are traced at once; they take some 100 MB


def shade(mesh: Mesh, light: Light, pose: Pose, up: np.ndarray, size: int) -> np.ndarray:
    """Return the share of the ground's light that the mesh takes away.

    The light's frame is camera space. Where the camera sees no ground, and where no light comes
    from above, nothing is taken away.

    Args:
        mesh: surface in its own frame.
        light: environment map in camera space.
        pose: pose of the mesh, with the camera in pixels of the image.
        up: unit normal `(3,)` of the ground in camera space.
        size: height and width of the image in pixels.

    Returns:
        Shares `(size, size)` float32 in [0, 1], at the pixels' centres.
    """
    import mitsuba as mi

    scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mesh)})
    out = np.zeros(size * size, np.float32)
    rays = _drawn(light, up, _SLOW_RAYS if "scalar" in str(mi.variant()) else _RAYS)
    seen, points = _ground(mesh, pose, up, size)
    if not len(rays) or not len(points):
        return out.reshape(size, size)
    # `@ rotation` takes camera space to the mesh's frame.
    origins, towards = (points - pose.translation) @ pose.rotation, rays @ pose.rotation
    hit = np.zeros(len(points))
    step = max(1, _MOST_RAYS // len(points))
    for first in range(0, len(towards), step):
        some = towards[first : first + step]
        blocked = _blocked(
            scene, np.tile(origins, (len(some), 1)), np.repeat(some, len(origins), axis=0)
        )
        hit += blocked.reshape(len(some), len(origins)).sum(axis=0)
    out[seen] = hit / len(rays)
    return out.reshape(size, size)


def _drawn(light: Light, up: np.ndarray, count: int) -> np.ndarray:
    """Return directions `(count, 3)` from which the ground gets equal shares of its irradiance.

    The draws are stratified, over the texels and inside them. The result is empty `(0, 3)` if no
    light comes from above.
    """
    rows = min(_ROWS, max(light.levels))
    energy = light.levels[rows].energy.astype(np.float64)
    above = np.maximum(environment.directions(*energy.shape) @ up, 0)
    cumulative = np.cumsum(energy * above)
    if not cumulative[-1] > 0:
        return np.zeros((0, 3))
    rng = np.random.default_rng(0)
    wanted = (np.arange(count) + rng.uniform(size=count)) / count * cumulative[-1]
    row, column = np.divmod(np.searchsorted(cumulative, wanted, side="right"), energy.shape[1])
    row, column = row + rng.uniform(size=count), column + rng.uniform(size=count)
    theta, phi = np.pi * row / rows, np.pi * column / rows
    x, z = np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi)
    drawn = np.stack([x, np.cos(theta), z], axis=-1)
    # Inside a texel at the horizon a ray may point below it.
    return drawn[drawn @ up > 0]


def _ground(mesh: Mesh, pose: Pose, up: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the row-major indices `(P,)` of pixels that see ground, and its points `(P, 3)`."""
    height = float(np.min((mesh.vertices @ pose.rotation.T + pose.translation) @ up)) - _GAP
    towards = -shading.view_directions(pose.camera, size, size).reshape(-1, 3)
    falling = towards @ up
    pixels = np.flatnonzero((falling * np.sign(height) > 0) & (height != 0))
    return pixels, towards[pixels] * (height / falling[pixels])[:, None]


def _blocked(scene, origins: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Return whether each ray `(R,)` meets the mesh."""
    import mitsuba as mi

    if "scalar" in str(mi.variant()):
        pairs = zip(origins, towards, strict=True)
        return np.array([scene.ray_test(mi.Ray3f(start, way)) for start, way in pairs], bool)
    start, way = (mi.Vector3f(*map(mi.Float, values.T)) for values in (origins, towards))
    return np.array(scene.ray_test(mi.Ray3f(mi.Point3f(start), way)))
