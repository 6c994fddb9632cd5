"""What each pixel sees: coverage, normals and view directions, traced by Mitsuba.

Every pixel is sampled on a regular grid (`Quality.subsamples` across). Its coverage is the share of
samples that hit the object. For what varies slowly, a pixel is divided into cells
(`Quality.lobe_samples` across), each represented by its covered sample nearest the cell's centre.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from .meshes import Mesh
from .quality import FAST, Quality

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
        central: `(P,)` the sample nearest the centre of each covered pixel, pixels ascending.
        cells: `(Q,)` the sample standing for each covered cell, pixels ascending.
        cell_weights: `(Q,)` how many covered samples it stands for.
    """

    coverage: np.ndarray
    normal: np.ndarray
    view: np.ndarray
    pixel: np.ndarray
    central: np.ndarray
    cells: np.ndarray
    cell_weights: np.ndarray

    @property
    def covered_pixels(self) -> np.ndarray:
        """`(P,)` row-major indices of the pixels with any coverage."""
        return self.pixel[self.central]

    def pixel_means(self, values: np.ndarray) -> np.ndarray:
        """Mean of per-sample `values` `(N,)` over each covered pixel's samples, `(P,)`."""
        return self._means(self.pixel, values, np.ones(len(values)))

    def cell_means(self, values: np.ndarray) -> np.ndarray:
        """Mean of per-cell `values` `(Q,)` over each covered pixel's samples, `(P,)`."""
        return self._means(self.pixel[self.cells], values, self.cell_weights)

    def _means(self, pixel: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        size = self.coverage.size
        total = np.bincount(pixel, weights=values * weights, minlength=size)
        weight = np.bincount(pixel, weights=weights, minlength=size)
        return (total[self.covered_pixels] / weight[self.covered_pixels]).astype(np.float32)

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
        quality: how finely pixels are sampled.
    """

    def __init__(self, mesh: Mesh, size: int, quality: Quality = FAST):
        import mitsuba as mi

        self._size = size
        self._quality = quality
        self._scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mesh)})

    def trace(self, rotation: np.ndarray, translation: np.ndarray, camera: np.ndarray) -> GBuffer:
        """Look at the mesh.

        Args:
            rotation: `(3, 3)`, object to camera space.
            translation: `(3,)`, the object's origin in camera space; its z is negative.
            camera: (fx, fy, cx, cy) in pixels, with fx = fy.
        """
        camera_of_that_size = _camera(self._size, self._quality.subsamples)
        layers = camera_of_that_size.take(self._scene, rotation, translation, camera)
        grid = _Grid(self._size, self._quality)
        hit = grid.hits(np.sum(layers[:, 6:9] * layers[:, 6:9], axis=-1) > 0.5)
        seen = layers[grid.samples(hit)]
        position, shading_normal, geometric = seen[:, 0:3], seen[:, 3:6], seen[:, 6:9]
        # To camera space; there the viewer is the origin, so o = −p / |p|.
        to_camera = rotation.T.astype(np.float32)
        position = position @ to_camera + translation.astype(np.float32)
        view = -position / np.linalg.norm(position, axis=-1, keepdims=True)
        normal = _facing(shading_normal @ to_camera, geometric @ to_camera, view)
        return grid.gather(hit, normal, view)


@functools.cache
def _camera(size: int, subsamples: int) -> "_Camera":
    """The process' one camera of that size: a film for every mesh would fill the memory."""
    return _Camera(size, subsamples)


class _Camera:
    """A perspective sensor that can be moved, with the integrator that reads the surface off."""

    def __init__(self, size: int, subsamples: int):
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
                    "width": size * subsamples,
                    "height": size * subsamples,
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
        """Position, shading normal and geometric normal of each sample, `(N, 9)`, row-major."""
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
        image = self._mi.render(scene, sensor=self._sensor, integrator=self._integrator, spp=1)
        return np.array(image).reshape(-1, 9)


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


class _Grid:
    """The samples of an image, ordered by pixel, then by cell, then by distance from its centre."""

    def __init__(self, size: int, quality: Quality):
        self._size, self._across, self._cells = size, quality.subsamples, quality.lobe_samples
        row, column = np.divmod(np.arange(self._across**2), self._across)
        width = self._across // self._cells
        cell = row // width * self._cells + column // width
        self._order = np.lexsort((_squared_distance(row % width, column % width, width), cell))
        self._cell = cell[self._order]
        self._central = np.argsort(
            _squared_distance(row, column, self._across)[self._order], kind="stable"
        )

    def hits(self, hit: np.ndarray) -> np.ndarray:
        """Row-major samples `(N,)` of an image to `(pixels, samples a pixel)` in this order."""
        size, across = self._size, self._across
        blocks = hit.reshape(size, across, size, across).swapaxes(1, 2)
        return blocks.reshape(size * size, across * across)[:, self._order]

    def samples(self, hit: np.ndarray) -> np.ndarray:
        """Row-major indices of those samples that hit, in this order."""
        pixel, sample = np.nonzero(hit)
        (row, column), across = np.divmod(pixel, self._size), self._across
        down, right = np.divmod(self._order[sample], across)
        return (row * across + down) * (self._size * across) + column * across + right

    def gather(self, hit: np.ndarray, normal: np.ndarray, view: np.ndarray) -> GBuffer:
        """Find out which samples stand for others."""
        pixel, sample = np.nonzero(hit)
        coverage = hit.mean(axis=1, dtype=np.float32).reshape(self._size, self._size)
        place = np.full(hit.shape, -1)
        place[pixel, sample] = np.arange(len(pixel))
        by_distance = hit[:, self._central]
        nearest = self._central[np.argmax(by_distance, axis=1)]
        covered = np.flatnonzero(by_distance.any(axis=1))
        cell = pixel * self._cells**2 + self._cell[sample]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        return GBuffer(
            coverage=coverage,
            normal=normal,
            view=view,
            pixel=pixel,
            central=place[covered, nearest[covered]],
            cells=first,
            cell_weights=np.diff(first, append=len(cell)),
        )


def _squared_distance(row: np.ndarray, column: np.ndarray, across: int) -> np.ndarray:
    """Of grid points from the grid's middle."""
    middle = (across - 1) / 2
    return (row - middle) ** 2 + (column - middle) ** 2
