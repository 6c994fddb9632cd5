"""What each pixel sees: coverage, normals and view directions, traced by Mitsuba.

Every pixel is sampled on a regular `SUBSAMPLES` × `SUBSAMPLES` grid. Its coverage is the share of
samples that hit the object; its representative is the covered sample nearest its centre.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from .meshes import Mesh

SUBSAMPLES = 3
_LEAST_COSINE = 0.02
"""Smooth shading can turn a normal away from the viewer; it is bent back to this o·n."""


@dataclass(frozen=True)
class GBuffer:
    """Samples of one image, all directions in camera space.

    Attributes:
        coverage: `(S, S)` in [0, 1].
        normal: `(N, 3)` unit normals of all samples that hit the object.
        view: `(N, 3)` unit directions from them to the viewer.
        pixel: `(N,)` row-major pixel of each sample, ascending.
        representative: `(P,)` the sample standing for each covered pixel, pixels ascending.
    """

    coverage: np.ndarray
    normal: np.ndarray
    view: np.ndarray
    pixel: np.ndarray
    representative: np.ndarray

    @property
    def covered_pixels(self) -> np.ndarray:
        """`(P,)` row-major indices of the pixels with any coverage."""
        return self.pixel[self.representative]

    def pixel_means(self, values: np.ndarray) -> np.ndarray:
        """Mean of per-sample `values` `(N,)` over each covered pixel's samples, `(P,)`."""
        size = self.coverage.size
        total = np.bincount(self.pixel, weights=values, minlength=size)
        count = np.bincount(self.pixel, minlength=size)
        return (total[self.covered_pixels] / count[self.covered_pixels]).astype(np.float32)

    def image(self, pixel_values: np.ndarray) -> np.ndarray:
        """Put values `(P,)` or `(P, C)` of the covered pixels into an `(S, S, C)` image."""
        values = pixel_values.reshape(len(pixel_values), -1)
        flat = np.zeros((self.coverage.size, values.shape[1]), np.float32)
        flat[self.covered_pixels] = values
        return flat.reshape(*self.coverage.shape, -1)


class Tracer:
    """One mesh, ready to be looked at from anywhere.

    The mesh stays in its own frame and the camera moves: one Mitsuba scene and one acceleration
    structure serve every image of a mesh, and no kernel is compiled twice.

    Args:
        mesh: closed surface in its own frame.
        size: height and width of the images in pixels.
    """

    def __init__(self, mesh: Mesh, size: int):
        import mitsuba as mi

        self._size = size
        self._scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mesh)})

    def trace(self, rotation: np.ndarray, translation: np.ndarray, camera: np.ndarray) -> GBuffer:
        """Look at the mesh.

        Args:
            rotation: `(3, 3)`, object to camera space.
            translation: `(3,)`, the object's origin in camera space; its z is negative.
            camera: (fx, fy, cx, cy) in pixels, with fx = fy.
        """
        layers = _camera(self._size).take(self._scene, rotation, translation, camera)
        position, shading_normal, geometric = (layers[..., k : k + 3] for k in (0, 3, 6))
        hit = np.sum(geometric * geometric, axis=-1) > 0.5
        # To camera space; there the viewer is the origin, so o = −p / |p|.
        position = position[hit] @ rotation.T.astype(np.float32) + translation.astype(np.float32)
        view = -position / np.linalg.norm(position, axis=-1, keepdims=True)
        to_camera = rotation.T.astype(np.float32)
        normal = _facing(shading_normal[hit] @ to_camera, geometric[hit] @ to_camera, view)
        return _gather(hit, normal, view, self._size)


@functools.cache
def _camera(size: int) -> "_Camera":
    """The process' one camera of that size: a film for every mesh would fill the memory."""
    return _Camera(size)


class _Camera:
    """A perspective sensor that can be moved, with the integrator that reads the surface off."""

    def __init__(self, size: int):
        import mitsuba as mi

        self._mi = mi
        self._size = size
        self._integrator = mi.load_dict(
            {"type": "aov", "aovs": "p:position,n:sh_normal,g:geo_normal"}
        )
        self._sensor = mi.load_dict(
            {
                "type": "perspective",
                "near_clip": 0.01,
                "far_clip": 1000.0,
                "film": {
                    "type": "hdrfilm",
                    "width": size * SUBSAMPLES,
                    "height": size * SUBSAMPLES,
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgb",
                    "component_format": "float32",
                },
                # Without jitter, one sample falls on each pixel's centre.
                "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
            }
        )
        self._parameters = mi.traverse(self._sensor)

    def take(
        self, scene, rotation: np.ndarray, translation: np.ndarray, camera: np.ndarray
    ) -> np.ndarray:
        """Position, shading normal and geometric normal of each sample, `(H, W, 9)`."""
        fx, _, cx, cy = (float(value) for value in camera)
        to_world = np.eye(4)
        # Mitsuba's camera looks along +z with x to the left: ours turned by half a turn about y.
        to_world[:3, :3] = rotation.T @ np.diag([-1.0, 1.0, -1.0])
        to_world[:3, 3] = -rotation.T @ translation
        parameters = self._parameters
        parameters["to_world"] = self._mi.Transform4f(self._mi.ScalarTransform4f(to_world))
        parameters["x_fov"] = 2 * math.degrees(math.atan(self._size / 2 / fx))
        parameters["principal_point_offset_x"] = 0.5 - cx / self._size
        parameters["principal_point_offset_y"] = 0.5 - cy / self._size
        parameters.update()
        return np.array(
            self._mi.render(scene, sensor=self._sensor, integrator=self._integrator, spp=1)
        )


def mitsuba_mesh(mesh: Mesh):
    """A Mitsuba shape with the mesh's vertices, faces and normals."""
    import mitsuba as mi

    shape = mi.Mesh("mesh", len(mesh.vertices), len(mesh.faces), has_vertex_normals=True)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(mesh.vertices, np.float32).ravel()
    parameters["vertex_normals"] = np.ascontiguousarray(mesh.normals, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(mesh.faces, np.uint32).ravel()
    parameters.update()
    return shape


def _facing(normal: np.ndarray, geometric: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Unit normals on the viewer's side of the surface, at least `_LEAST_COSINE` towards it."""
    behind = np.sum(geometric * view, axis=-1, keepdims=True) < 0
    normal = np.where(behind, -normal, normal)
    cosine = np.sum(normal * view, axis=-1, keepdims=True)
    normal = normal + np.maximum(_LEAST_COSINE - cosine, 0) * view
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _gather(hit: np.ndarray, normal: np.ndarray, view: np.ndarray, size: int) -> GBuffer:
    """Sort samples by pixel and choose each covered pixel's representative."""
    rows, columns = np.nonzero(hit)
    pixel = rows // SUBSAMPLES * size + columns // SUBSAMPLES
    middle = (SUBSAMPLES - 1) / 2
    distance = (rows % SUBSAMPLES - middle) ** 2 + (columns % SUBSAMPLES - middle) ** 2
    order = np.lexsort((distance, pixel))
    pixel = pixel[order]
    # The first sample of each pixel is the one nearest its centre.
    representative = np.flatnonzero(np.diff(pixel, prepend=-1))
    blocks = hit.reshape(size, SUBSAMPLES, size, SUBSAMPLES)
    coverage = blocks.mean(axis=(1, 3), dtype=np.float32)
    return GBuffer(coverage, normal[order], view[order], pixel, representative)
