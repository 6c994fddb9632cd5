"""Path tracing of rooms to environment maps with the dynamic range of photographed maps.

One Mitsuba scene serves all rooms of a process: its meshes have a fixed number of faces, and each
room only fills their buffers. So nothing is compiled twice, and the memory that Mitsuba keeps for
every loaded scene (its issue 1890) is spent only once.
"""

from functools import lru_cache

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from ..shapes.parts import joined
from .panels import MATTE, Piece, area, panel_piece
from .random_room import LIGHTS, Light, Room

FACES = {"matte": 16384, "glossy": 8192, "light": 640}  # number of faces of each mesh
BOUNCES = 4  # depth of the path tracer: enough to lift the shadows, too short for caustics
SUBDIVISION = 8  # directions across a texel, and down it, that are looked up in the views
VIEWS = (
    ((0, 0, -1), (0, 1, 0)),
    ((1, 0, 0), (0, 1, 0)),
    ((0, 0, 1), (0, 1, 0)),
    ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, -1)),
)  # forward and up direction of each view


def render(room: Room, *, height: int = 128, samples: int = 32, seed: int) -> np.ndarray:
    """Path trace a room from its viewpoint, in the variant of Mitsuba that is active.

    Paths end after `BOUNCES` segments. The map is put together from six square views. In a view, a
    pixel that sees no light directly is limited to twice the brightness of its brightest neighbour,
    so that rare paths leave no speckles.

    Args:
        room: The room to render.
        height: Rows of the map.
        samples: Paths for each pixel of the six views.
        seed: Seed of the sampler. The same seed gives the same map, bit for bit if Dr.Jit has one
            thread.

    Returns:
        `(height, 2 * height)` float32 radiance, non-negative, one channel: equirectangular,
        direction(u, v) = (sin(pi v) sin(2 pi u), cos(pi v), -sin(pi v) cos(2 pi u)).
    """
    side = 3 * height // 4  # pixels in the middle of a view are then about as wide as texels
    scene = _scene(mi.variant(), side)
    _furnish(scene[1], room)
    views = _views(scene, "path", side, samples, seed)
    lights = _views(scene, "lights", side, samples, seed)
    padded = np.pad(views, ((0, 0), (1, 1), (1, 1)), mode="reflect")
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.max([padded[:, i : i + side, j : j + side] for i, j in shifts], axis=0)
    views = np.where(lights > 0, views, np.minimum(views, 2 * around))
    pixels, weights = _lookup(height, side)
    values = (views.ravel()[pixels] * weights).reshape(height, SUBDIVISION, 2 * height, -1)
    return values.sum(axis=(1, 3)).astype(np.float32)


@lru_cache(maxsize=2)
def _scene(variant: str, side: int) -> tuple["mi.Scene", "mi.SceneParameters", dict]:
    """Build the scene that all rooms share; return it with its parameters and integrators.

    A scene cannot be used in another variant of Mitsuba. `side` is that of the six views in pixels.
    """
    albedo = {"type": "mesh_attribute", "name": "face_albedo"}
    rough = {"type": "mesh_attribute", "name": "face_roughness"}
    matte = {"type": "diffuse", "reflectance": albedo}
    glossy = {"type": "principled", "base_color": albedo, "roughness": rough, "specular": 0.5}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    light = {"type": "area", "radiance": {"type": "uniform", "value": 1.0}}
    meshes = {"matte": _mesh("matte", matte), "glossy": _mesh("glossy", glossy)}
    meshes |= {f"light{k}": _mesh("light", black, light) for k in range(LIGHTS)}
    film = {"type": "hdrfilm", "pixel_format": "luminance", "rfilter": {"type": "box"}}
    cameras = {
        f"view{k}": {
            "type": "perspective",
            "fov": 90.0,
            "near_clip": 0.001,
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], forward, up),
            "film": film | {"width": side, "height": side},
        }
        for k, (forward, up) in enumerate(VIEWS)
    }
    sensor = {"type": "batch", "film": film | {"width": 6 * side, "height": side}} | cameras
    scene = mi.load_dict({"type": "scene", "sensor": sensor} | meshes)
    depths = {"path": BOUNCES, "lights": 1}
    integrators = {k: mi.load_dict({"type": "path", "max_depth": n}) for k, n in depths.items()}
    return scene, mi.traverse(scene), integrators


def _mesh(kind: str, bsdf: dict, emitter: dict | None = None) -> "mi.Mesh":
    """Return a mesh with the number of faces in `FACES`, all but one of them without area."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    if emitter:
        properties["emitter"] = mi.load_dict(emitter)
    faces = FACES[kind]
    mesh = mi.Mesh(kind, 2 * faces, faces, has_vertex_normals=True, props=properties)
    mesh.add_attribute("face_albedo", 1, [0.5] * faces)
    mesh.add_attribute("face_roughness", 1, [0.5] * faces)
    mi.traverse(mesh).update(_buffers(kind, [], np.zeros(3)))
    return mesh


def _furnish(parameters: "mi.SceneParameters", room: Room) -> None:
    """Write a room into the scene's buffers, with the viewpoint at the origin."""
    meshes: dict[str, list[Piece]] = {"matte": [*map(panel_piece, room.panels)], "glossy": []}
    for solid in room.solids:
        meshes["matte" if solid.roughness[0] == MATTE else "glossy"].append(solid)
    for k in range(LIGHTS):
        light = room.lights[k] if k < len(room.lights) else Light(0.0)
        pieces = [*map(panel_piece, light.panels), *light.solids]
        meshes[f"light{k}"] = pieces
        parameters[f"light{k}.emitter.radiance.value"] = light.radiance
        flux = light.radiance * sum(map(area, pieces))
        # The last weight is never 0: in a room without light, Mitsuba could choose no emitter.
        parameters[f"light{k}.emitter.sampling_weight"] = float(flux) or 1e-6 * (k == LIGHTS - 1)
    for name, pieces in meshes.items():
        for key, values in _buffers(name.rstrip("0123456789"), pieces, room.viewpoint).items():
            parameters[f"{name}.{key}"] = values
        # Mitsuba takes equal normals for unchanged, and would compute its own for new positions.
        parameters.set_dirty(f"{name}.vertex_normals")
    parameters.update()


def _buffers(kind: str, pieces: list[Piece], origin: np.ndarray) -> dict[str, np.ndarray]:
    """Return Mitsuba's flat buffers of some pieces, filled up to the mesh's number of faces.

    The buffers begin with a tiny triangle far below the room, and end with faces without area.
    """
    room = FACES[kind]
    far = np.array([[0, 0, 0], [0, 0, 1e-3], [1e-3, 0, 0]]) - (0, 100, 0)
    tiny = (far + origin, np.arange(3)[None], np.tile([0.0, 1.0, 0.0], (3, 1)), *np.ones((2, 1)))
    vertices, faces, normals, albedo, roughness = joined([tiny, *pieces])
    return {
        "vertex_positions": _filled(vertices - origin, far[0], 2 * room),
        "vertex_normals": _filled(normals, (0, 1, 0), 2 * room),
        "faces": _filled(faces, (0, 0, 0), room).astype(np.uint32),
        "face_albedo": _filled(albedo, 0, room),
        "face_roughness": _filled(roughness, 1, room),
    }


def _filled(values: np.ndarray, filler: ArrayLike, count: int) -> np.ndarray:
    out = np.empty((count, *values.shape[1:]), np.float32)
    out[: len(values)], out[len(values) :] = values, filler
    return out.ravel()


def _views(scene: tuple, kind: str, side: int, samples: int, seed: int) -> np.ndarray:
    """Render the six views `(6, side, side)`; pixels that are not finite become black."""
    # Mitsuba's stub wants a UInt32 for a seed; a plain number does.
    rendered = mi.render(scene[0], integrator=scene[2][kind], seed=seed, spp=samples)  # type: ignore[arg-type]
    image = np.array(rendered, np.float32).reshape(side, 6, side).swapaxes(0, 1)
    return np.where(np.isfinite(image), np.maximum(image, 0), 0)


@lru_cache(maxsize=2)
def _lookup(height: int, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixel in the views and the share of the texel's solid angle of each sub-texel."""
    rows = SUBDIVISION * height
    theta = np.pi * (np.arange(rows, dtype=np.float32)[:, None] + 0.5) / rows
    phi = np.pi * (np.arange(2 * rows, dtype=np.float32) + 0.5) / rows
    x, y, z = np.broadcast_arrays(
        np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)
    )
    pixels = np.zeros((rows, 2 * rows), np.int32)
    for k, (forward, up) in enumerate(VIEWS):
        right = np.cross(forward, up)
        ahead, aside, above = (a[0] * x + a[1] * y + a[2] * z for a in (forward, right, up))
        inside = ahead >= np.maximum(np.abs(aside), np.abs(above)) * np.float32(1 - 1e-6)
        column, row = (
            np.clip((1 + slope[inside] / ahead[inside]) / 2 * side, 0, side - 1).astype(np.int32)
            for slope in (aside, -above)
        )
        pixels[inside] = (k * side + row) * side + column
    weights = np.sin(theta).reshape(height, SUBDIVISION)
    weights = weights / weights.sum(1, keepdims=True) / SUBDIVISION
    return pixels, weights.reshape(-1, 1).astype(np.float32)
