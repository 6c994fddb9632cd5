"""The G-buffer of an image: coverage, normals and view directions, traced by Mitsuba.

Every pixel is sampled on a regular grid. A pixel is rough if it sees an edge, or a surface that
bends so much that its mirror directions spread. Rough pixels are sampled again on a finer grid.
S needs fewer samples, because the specular lobe blurs it: for S, a pixel is divided into cells, and
the covered sample nearest the middle of a cell represents the cell.
"""

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lime_keras.optics.shading import reflect

from ..shapes.meshes import Mesh
from .quality import FAST, Quality

_MOST_RAYS = 2**22  # largest number of rays that are traced at once; they take some 500 MB
_LEAST_COSINE = 0.02  # least o·n of a normal; smooth shading can turn normals away from the viewer


@dataclass(frozen=True)
class GBuffer:
    """The samples of one image, with all directions in camera space.

    Attributes:
        coverage: `(S, S)`, share of each pixel that the object covers, in [0, 1].
        normal: `(N, 3)`, unit normals of all samples that hit the object.
        view: `(N, 3)`, unit directions from these samples to the viewer.
        pixel: `(N,)`, row-major index of each sample's pixel.
        central: `(P,)`, index of the sample nearest the centre of each covered pixel.
        spread: `(P,)`, variance of the mirror directions in each covered pixel, 0 … 1.
        cells: `(Q,)`, index of the sample that represents each covered cell.
        cell_weights: `(Q,)`, covered share of each covered cell, in samples: all cells of a covered
            pixel have the same.
    """

    coverage: np.ndarray
    normal: np.ndarray
    view: np.ndarray
    pixel: np.ndarray
    central: np.ndarray
    spread: np.ndarray
    cells: np.ndarray
    cell_weights: np.ndarray

    @property
    def covered_pixels(self) -> np.ndarray:
        """The row-major indices `(P,)` of the pixels with any coverage."""
        return self.pixel[self.central]

    def pixel_means(
        self,
        values: np.ndarray,
        samples: np.ndarray | slice = slice(None),
        weights: np.ndarray | None = None,
    ) -> np.ndarray:
        """Compute the weighted mean of sample values over each covered pixel, `(P,)`.

        Args:
            values: value of each sample.
            samples: indices of the samples, all by default; every covered pixel needs at least one.
            weights: weight of each of these samples, needed unless these are all of them; all equal
                by default.
        """
        count = self._samples
        if weights is not None:
            values, count = values * weights, self._sums(weights, samples)
        return (self._sums(values, samples) / count).astype(np.float32)

    def _sums(self, values: np.ndarray, samples: np.ndarray | slice) -> np.ndarray:
        """Return the sum of sample values in each covered pixel, `(P,)`."""
        pixel, count = self.pixel[samples], self.coverage.size
        return np.bincount(pixel, values, count)[self.covered_pixels]

    @functools.cached_property
    def _samples(self) -> np.ndarray:
        """The number of samples that hit the object in each covered pixel, `(P,)`."""
        return np.bincount(self.pixel, minlength=self.coverage.size)[self.covered_pixels]

    def lobe_samples(self, most: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices of the samples at which S is computed, and their weights.

        A pixel whose spread is at most `most` has its central sample, any other pixel the samples
        of its cells.
        """
        rough = np.zeros(self.coverage.size, bool)
        rough[self.covered_pixels] = self.spread > most
        cells = rough[self.pixel[self.cells]]
        smooth = self.central[self.spread <= most]
        weights = np.concatenate([np.ones(len(smooth)), self.cell_weights[cells]])
        return np.concatenate([smooth, self.cells[cells]]), weights

    def mirror_spacing(self) -> np.ndarray:
        """Return the angle between the mirror directions of neighbouring samples, `(N,)` radians.

        It follows from the directions' variance in a pixel, as that of points on a square grid.
        """
        spacing = np.zeros(self.coverage.size)
        spacing[self.covered_pixels] = np.sqrt(6 * self.spread / np.maximum(self._samples - 1, 1))
        return spacing[self.pixel]

    def image(self, pixel_values: np.ndarray) -> np.ndarray:
        """Put values `(P,)` or `(P, C)` of the covered pixels into an `(S, S, C)` image."""
        values = pixel_values.reshape(len(pixel_values), -1)
        flat = np.zeros((self.coverage.size, values.shape[1]), np.float32)
        flat[self.covered_pixels] = values
        return flat.reshape(*self.coverage.shape, -1)

    def part(self, kept: np.ndarray) -> "GBuffer":
        """Return the G-buffer of the pixels where `kept` `(S · S,)` is true; the rest is empty."""
        inside, pixels = kept[self.pixel], kept[self.covered_pixels]
        cells, place = kept[self.pixel[self.cells]], np.cumsum(inside) - 1
        samples = np.flatnonzero(inside)  # flags would take longer to index `(N, 3)`
        return GBuffer(
            coverage=self.coverage * kept.reshape(self.coverage.shape),
            normal=self.normal[samples],
            view=self.view[samples],
            pixel=self.pixel[samples],
            central=place[self.central[pixels]],
            spread=self.spread[pixels],
            cells=place[self.cells[cells]],
            cell_weights=self.cell_weights[cells],
        )


class Tracer:
    """A tracer of images of one mesh, from any camera.

    The mesh stays in its own frame and the camera moves. So one Mitsuba scene and one acceleration
    structure serve every image of a mesh, and no kernel is compiled twice.

    Args:
        mesh: surface in its own frame.
        size: height and width of the images in pixels.
        quality: number of samples of a pixel, and limits above which pixels are rough.
        packets: whether rays are traced in packets, in three fifths of the time. Where a ray meets
            two triangles at once, at their edge or where they coincide, it may hit the other one.
    """

    def __init__(self, mesh: Mesh, size: int, quality: Quality = FAST, *, packets: bool = False):
        import mitsuba as mi

        self._size = size
        self._quality = quality
        self._packets = packets
        self._vertices, self._faces = mesh.vertices, mesh.faces
        self._scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mesh)})

    def trace(self, rotation: np.ndarray, translation: np.ndarray, camera: np.ndarray) -> GBuffer:
        """Trace the G-buffer of the mesh, seen by a camera.

        Args:
            rotation: rotation `(3, 3)` from object to camera space.
            translation: `(3,)`, the object's origin in camera space; its z is negative.
            camera: (fx, fy, cx, cy) in pixels.
        """
        place = rotation, translation, camera
        quality = self._quality
        in_sight = self._in_sight(*place)
        coarse = self._look(*place, np.flatnonzero(in_sight), quality.subsamples)
        if quality.refined == quality.subsamples:
            return coarse
        rough = _edges(coarse.coverage)
        rough[coarse.covered_pixels[coarse.spread > quality.rough_above]] = True
        again = self._look(*place, np.flatnonzero(rough & in_sight), quality.refined)
        return _joined(coarse.part(~rough), again)

    def _in_sight(self, rotation, translation, camera) -> np.ndarray:
        """Return row-major flags of the pixels in the boxes of the projected triangles."""
        size = self._size
        fx, fy, cx, cy = camera
        x, y, z = rotation @ self._vertices.T + translation[:, None]
        if z.max() >= 0:  # partly behind the camera
            return np.ones(size**2, bool)
        top, bottom = self._reach(cy + fy * y / z)
        left, right = self._reach(cx - fx * x / z)
        # Each box adds 1 to its pixels: the sums of the corners' marks, along both axes.
        across = size + 1
        corners = [top * across + left, bottom * across + right]
        corners += [top * across + right, bottom * across + left]
        marks = np.repeat([1.0, 1.0, -1.0, -1.0], len(top))
        boxes = np.bincount(np.concatenate(corners), marks, across**2).reshape(across, across)
        return boxes.cumsum(0).cumsum(1)[:size, :size].ravel() > 0.5

    def _reach(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first pixel of each triangle along an axis, and that after its last."""
        corners = np.clip(places, -1, self._size).astype(np.int64)[self._faces.T]
        first = np.minimum(np.minimum(corners[0], corners[1]), corners[2])
        last = np.maximum(np.maximum(corners[0], corners[1]), corners[2])
        return np.clip(first, 0, self._size), np.clip(last + 1, 0, self._size)

    def _look(self, rotation, translation, camera, pixels: np.ndarray, across: int) -> GBuffer:
        """Return the G-buffer of some pixels, each sampled on a grid of `across` × `across`."""
        if len(pixels) > max(_MOST_RAYS // across**2, 1):
            middle = len(pixels) // 2
            place = rotation, translation, camera
            return _joined(
                self._look(*place, pixels[:middle], across),
                self._look(*place, pixels[middle:], across),
            )
        grid = _grid(across, self._quality.cells)
        fx, fy, cx, cy = camera
        row, column = np.divmod(pixels, self._size)
        places = np.arange(self._size)[:, None]
        x = ((places + grid.x - cx) / fx).astype(np.float32)[column].ravel()
        y = ((cy - places - grid.y) / fy).astype(np.float32)[row].ravel()
        rays = np.stack([x, y, np.full_like(x, -1.0)])
        rays /= np.sqrt(np.einsum("ij,ij->j", rays, rays))
        turn = rotation.astype(np.float32)  # `turn.T @ rays`: from camera to object space
        there, shading_normal, geometric = _intersect(
            self._scene, -rotation.T @ translation, turn.T @ rays, self._packets
        )
        view = -np.take(rays, there, axis=1)
        normal = _facing(turn @ shading_normal, turn @ geometric, view)
        return grid.gather(self._size, pixels, there, normal, view)


def _intersect(
    scene, origin: np.ndarray, directions: np.ndarray, packets: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the indices `(N,)` of the rays `(3, M)` from one point that hit, and normals there.

    The shading and the geometric normals, `(3, N)` each, are in the scene's frame.
    """
    import drjit as dr
    import mitsuba as mi

    start = mi.Point3f(origin)
    if "scalar" in str(mi.variant()):
        hits = [scene.ray_intersect(mi.Ray3f(start, direction)) for direction in directions.T]
        there = np.flatnonzero([surface.is_valid() for surface in hits])
        normals = [(surface.sh_frame.n, surface.n) for surface in hits if surface.is_valid()]
        both = np.array(normals, np.float32).reshape(-1, 2, 3)
        shading_normal, geometric = both.transpose(1, 2, 0)
        return there, shading_normal, geometric
    if not directions.size:
        return np.zeros(0, int), np.zeros((3, 0), np.float32), np.zeros((3, 0), np.float32)
    dr.make_opaque(start)  # literals would compile a new kernel for every image
    ray = mi.Ray3f(start, mi.Vector3f(*map(mi.Float, directions)))
    hit = scene.ray_intersect_preliminary(ray, coherent=packets)
    valid = hit.is_valid()
    # Asked directly, the mesh answers in a tenth of the time that the scene takes to ask it.
    asked = mi.RayFlags.Minimal | mi.RayFlags.ShadingFrame
    surface = scene.shapes()[0].compute_surface_interaction(ray, hit, int(asked), valid)
    shading_normal, geometric = surface.sh_frame.n, surface.n
    dr.eval(valid, shading_normal, geometric)
    there = np.flatnonzero(np.array(valid))
    at_hits = [
        np.stack([np.array(axis)[there] for axis in (each.x, each.y, each.z)])
        for each in (shading_normal, geometric)
    ]
    return there, at_hits[0], at_hits[1]


def mitsuba_mesh(mesh: Mesh):
    """Return a Mitsuba shape with the vertices, faces and normals of a mesh."""
    import mitsuba as mi

    shape = mi.Mesh("mesh", len(mesh.vertices), len(mesh.faces), has_vertex_normals=True)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(mesh.vertices, np.float32).ravel()
    parameters["vertex_normals"] = np.ascontiguousarray(mesh.normals, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(mesh.faces, np.uint32).ravel()
    parameters.update()
    return shape


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the dot products `(N,)` of vectors `(3, N)`, in a third of the time of `einsum`."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _facing(normal: np.ndarray, geometric: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Turn unit normals `(3, N)` to the viewer: o·n is then at least about `_LEAST_COSINE`."""
    side = np.where(_dot(geometric, view) < 0, np.float32(-1), np.float32(1))
    normal = side * normal
    normal = normal + np.maximum(_LEAST_COSINE - _dot(normal, view), 0) * view
    return normal / np.sqrt(_dot(normal, normal))


def _edges(coverage: np.ndarray) -> np.ndarray:
    """Return row-major flags of the pixels at the silhouette, with their uncovered neighbours."""
    touched = ndimage.maximum_filter(coverage, 3) > 0
    return (touched & (ndimage.minimum_filter(coverage, 3, mode="nearest") < 1)).ravel()


def _joined(first: GBuffer, second: GBuffer) -> GBuffer:
    """Join the G-buffers of two parts of an image that share no pixel."""
    shift = {"central": len(first.pixel), "cells": len(first.pixel)}
    fields = {
        field.name: np.concatenate(
            [getattr(first, field.name), getattr(second, field.name) + shift.get(field.name, 0)]
        )
        for field in dataclasses.fields(GBuffer)
        if field.name != "coverage"
    }
    return GBuffer(coverage=first.coverage + second.coverage, **fields)


class _Grid:
    """Places of a pixel's samples, ordered by cell, then by distance from the cell's middle."""

    def __init__(self, across: int, cells: int):
        row, column = np.divmod(np.arange(across**2), across)
        row, column = (row + 0.5) / across, (column + 0.5) / across
        cell_row, cell_column = np.floor(row * cells), np.floor(column * cells)
        cell = (cell_row * cells + cell_column).astype(int)
        off_cell = np.hypot(row * cells - cell_row - 0.5, column * cells - cell_column - 0.5)
        order = np.lexsort((off_cell.round(6), cell))
        self.x, self.y = column[order], row[order]
        self._cell = cell[order]
        self._cells_a_pixel = cells**2
        # Of 3 × 3 samples those in the middle are of one cell alone, which is no larger for it.
        self._share = across**2 / cells**2 / np.bincount(self._cell)
        off_centre = np.hypot(row - 0.5, column - 0.5)[order]
        # Each sample's rank by its distance from the pixel's centre.
        self._rank = np.argsort(np.argsort(off_centre.round(6), kind="stable"))

    def gather(
        self, size: int, pixels: np.ndarray, there: np.ndarray, normal: np.ndarray, view: np.ndarray
    ) -> GBuffer:
        """Gather samples into a G-buffer, and choose those that represent pixels and cells.

        Args:
            size: height and width of the image in pixels.
            pixels: row-major indices of the sampled pixels, `(K,)`.
            there: indices of the samples that hit the object, pixel by pixel, `(N,)`, ascending.
            normal: unit normals of these samples, `(3, N)`.
            view: unit directions from these samples to the viewer, `(3, N)`.
        """
        samples = len(self._rank)
        owner = there // samples
        sample = there - owner * samples
        hits = np.bincount(owner, minlength=len(pixels))
        coverage = np.zeros(size * size, np.float32)
        coverage[pixels] = hits.astype(np.float32) / np.float32(samples)
        covered = np.flatnonzero(hits)
        count = hits[covered]
        starts = np.cumsum(count) - count
        # The least of a pixel's ranks, which come before the samples' own indices.
        ranked = self._rank[sample] * len(there) + np.arange(len(there))
        cell = owner * self._cells_a_pixel + self._cell[sample]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        means = [
            (np.bincount(owner, axis, len(hits))[covered] / count).astype(np.float32)
            for axis in reflect(normal.T, view.T).T
        ]
        return GBuffer(
            coverage=coverage.reshape(size, size),
            normal=normal.T,
            view=view.T,
            pixel=pixels[owner],
            central=np.minimum.reduceat(ranked, starts) % len(there) if len(there) else starts,
            spread=np.maximum(1 - sum(mean**2 for mean in means), 0),
            cells=first,
            cell_weights=np.diff(first, append=len(cell)) * self._share[self._cell[sample[first]]],
        )


_grid = functools.lru_cache(_Grid)
"""Returns the places of the samples of a pixel; they are the same in every image."""
