"""D, S and M on the device, against float64 sums over every texel."""

import keras
import numpy as np
import pytest

from lime_keras.optics import environment, shading
from lime_keras.synthesis import shading as synthesis_shading
from lime_keras.synthesis.shading import LEVEL_ROWS, PIECE, layers, pieces, rows_for

SIZE = 16
ROWS = 128
CAMERA = np.array([40.0, 40.0, 8.0, 7.5])


def _sphere():
    """The normals of a sphere that fills most of the image, and where it is."""
    y, x = (SIZE / 2 - 0.5 - np.mgrid[:SIZE, :SIZE]) / (0.45 * SIZE)
    inside = x**2 + y**2 < 0.95
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0.01))
    normal = np.stack([-x, y, z], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True), inside


def _lit(radiance, exponents, rotation=None, variance=0.0, second=None, share=1.0):
    """Return D, S, M `(B, S, S)` of the sphere, and n, o `(S, S, 3)` and where it is."""
    exponents = np.atleast_1d(np.asarray(exponents, np.float32))
    batch = len(exponents)
    normal, inside = _sphere()
    both = np.stack([normal, normal if second is None else second])
    there = np.stack([inside, inside & (second is not None)])
    rotation = np.eye(3) if rotation is None else rotation

    def repeated(values):
        return np.repeat(np.asarray(values, np.float32)[None], batch, axis=0)

    found = layers(
        repeated(both),
        repeated(np.full((2, SIZE, SIZE), variance)),
        repeated(np.full((SIZE, SIZE), share)),
        repeated(CAMERA),
        repeated(radiance),
        repeated(rotation),
        exponents,
        pieces(np.repeat(there[None], batch, axis=0), exponents),
    )
    images = [keras.ops.convert_to_numpy(image)[..., 0] for image in found]
    return images, normal, shading.view_directions(CAMERA, SIZE, SIZE), inside


def _smooth_map():
    towards = environment.directions(ROWS, 2 * ROWS)
    lobe = np.exp(6 * (towards @ np.array([0.6, 0.6, 0.529]) - 1))
    return 0.1 + lobe + 0.3 * np.exp(8 * (towards @ np.array([-0.8, 0.0, 0.6]) - 1))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 9.0, 60.0, 200.0, 500.0, 1000.0])
def test_layers_are_the_sums_over_every_texel(exponent):
    radiance = _smooth_map()
    (diffuse, specular, mirror), normal, view, inside = _lit(radiance, exponent)
    n, o = normal[inside], view[inside]
    lights = shading.texels(radiance)
    expected = {
        "D": (diffuse, shading.diffuse(n, *lights)),
        "S": (specular, shading.specular(n, o, exponent, *lights)),
        "M": (mirror, shading.mirror(n, o, radiance)),
    }
    for found, truth in expected.values():
        errors = np.abs(found[0][inside] / truth - 1)
        # At grazing angles the lobe is narrower than its exponent says, and so than the texels.
        steep = np.sum(n * o, axis=-1) > 0.5
        assert np.median(errors) < 0.01 and np.percentile(errors[steep], 95) < 0.04
    for image in (diffuse, specular, mirror):
        assert not image[0][~inside].any()


def test_a_batch_holds_the_scenes_of_all_levels_in_their_places():
    """Scenes are lit in the order of their levels, and come back in the order of the batch."""
    exponents = [1000.0, 2.0, 300.0, 0.0, 150.0]
    together = _lit(_smooth_map(), exponents)[0]
    for index, exponent in enumerate(exponents):
        alone = _lit(_smooth_map(), exponent)[0]
        for image, one in zip(together, alone, strict=True):
            np.testing.assert_array_equal(image[index], one[0])


@pytest.mark.parametrize("exponent", [0.0, 3.0, 1000.0])
def test_in_a_furnace_d_and_m_are_one_and_s_is_one_where_the_viewer_is_above(exponent):
    (diffuse, specular, mirror), normal, view, inside = _lit(np.ones((ROWS, 2 * ROWS)), exponent)
    np.testing.assert_allclose(diffuse[0][inside], 1, rtol=0.005)
    np.testing.assert_allclose(mirror[0][inside], 1, rtol=1e-5)
    above = np.sum(normal * view, axis=-1) > 0.99
    assert (above & inside).any()
    np.testing.assert_allclose(specular[0][above & inside], 1, rtol=0.02)


def test_a_rotation_turns_the_light():
    """Light rotated by R and normals as they are, or the map itself rotated: the same."""
    radiance = _smooth_map()
    rotation = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    turned = _lit(radiance, 50.0, rotation=rotation)[0]
    resampled = _lit(environment.rotate(radiance, rotation, ROWS, 2 * ROWS), 50.0)[0]
    for one, other in zip(turned, resampled, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.01, atol=1e-3)


@pytest.mark.parametrize("exponent", [0.0, 20.0, 1000.0])
def test_one_lit_texel_is_one_light(exponent):
    """Sums keep a lone lamp's energy and place at every level."""
    radiance = np.zeros((ROWS, 2 * ROWS))
    radiance[40, 200] = 5000.0
    (diffuse, specular, mirror), normal, view, inside = _lit(radiance, exponent)
    light = environment.directions(ROWS, 2 * ROWS)[40, 200]
    energy = 5000.0 * environment.solid_angles(ROWS, 2 * ROWS)[40, 200]
    n, o = normal[inside], view[inside]
    expected = shading.diffuse(n, light[None], np.array([energy]))
    np.testing.assert_allclose(diffuse[0][inside], expected, rtol=1e-4, atol=1e-6)
    expected = shading.specular(n, o, exponent, light[None], np.array([energy]))
    np.testing.assert_allclose(specular[0][inside], expected, rtol=2e-3, atol=1e-6)
    assert np.isfinite(mirror).all() and (mirror >= 0).all()


@pytest.mark.parametrize("value", [0.0, 1e-30, 1e12])
def test_dark_and_dazzling_maps_stay_finite(value):
    images, *_, inside = _lit(np.full((ROWS, 2 * ROWS), value), [0.0, 1000.0])
    for image in images:
        assert np.isfinite(image).all() and (image >= 0).all()
        assert (image[:, inside] > 0).all() or value < 1e-20


def test_a_pixel_with_two_surfaces_is_their_mean_by_share():
    other = np.broadcast_to([0.6, 0.0, 0.8], (SIZE, SIZE, 3))
    radiance = _smooth_map()
    mixed = _lit(radiance, 80.0, second=other, share=0.3)[0]
    first = _lit(radiance, 80.0)[0]
    second = _lit(radiance, 80.0, second=other, share=0.0)[0]
    for image, one, two in zip(mixed, first, second, strict=True):
        np.testing.assert_allclose(image, 0.3 * one + 0.7 * two, rtol=1e-5)


def test_a_surface_that_bends_within_the_pixel_is_lit_as_by_a_wider_lobe():
    """Samples of normals that vary about the pixel's: their mean S, D and M."""
    radiance = _smooth_map()
    normal, inside = _sphere()
    rng = np.random.default_rng(0)
    deviation = 0.06
    view = shading.view_directions(CAMERA, SIZE, SIZE)[inside]
    total, mirrored = 0.0, 0.0
    n = normal[inside]
    lights = shading.texels(environment.rotate(radiance, np.eye(3), 32, 64))
    count = 200
    directions = np.zeros_like(n)
    for _ in range(count):
        tangent = rng.normal(0, deviation, n.shape)
        tangent -= np.sum(tangent * n, axis=-1, keepdims=True) * n
        bent = (n + tangent) / np.linalg.norm(n + tangent, axis=-1, keepdims=True)
        total += shading.specular(bent, view, 100.0, *lights) / count
        mirrored += shading.mirror(bent, view, radiance) / count
        directions += shading.reflect(bent, view) / count
    variance = float(np.mean(1 - np.sum(directions**2, axis=-1)))
    (_, specular, mirror), *_ = _lit(radiance, 100.0, variance=variance)
    inner = np.sum(n * view, axis=-1) > 0.5
    assert np.median(np.abs(specular[0][inside] / total - 1)[inner]) < 0.03
    assert np.median(np.abs(mirror[0][inside] / mirrored - 1)[inner]) < 0.03


def test_a_batch_without_any_surface_is_black():
    there = np.zeros((2, 2, SIZE, SIZE), bool)
    exponents = np.array([3.0, 900.0], np.float32)
    work = pieces(there, exponents)
    assert work.ends[-1] == 0
    found = layers(
        np.zeros((2, 2, SIZE, SIZE, 3), np.float32),
        np.zeros((2, 2, SIZE, SIZE), np.float32),
        np.ones((2, SIZE, SIZE), np.float32),
        np.repeat(CAMERA[None], 2, axis=0).astype(np.float32),
        np.ones((2, ROWS, 2 * ROWS), np.float32),
        np.repeat(np.eye(3, dtype=np.float32)[None], 2, axis=0),
        exponents,
        work,
    )
    for image in found:
        assert not keras.ops.convert_to_numpy(image).any()


def test_pieces_list_each_surface_once_and_fill_up_with_its_own_scene():
    rng = np.random.default_rng(3)
    there = rng.random((3, 2, 40, 40)) < [[[[0.9]]], [[[0.0]]], [[[0.3]]]]
    work = pieces(there, np.array([5.0, 5.0, 700.0]))
    listed = work.surfaces.reshape(-1, PIECE)[: work.ends[-1]]
    scenes = work.scenes[: work.ends[-1]]
    for row, scene in zip(listed, scenes, strict=True):
        assert set(row // there[0].size) == {scene}
    found = np.flatnonzero(there)
    assert set(listed.reshape(-1)) == set(found)
    np.testing.assert_array_equal(work.surfaces[work.places[found]], found)
    assert (work.places[~there.reshape(-1)] == work.surfaces.size).all()


def test_levels_are_finer_for_sharper_lobes():
    levels = rows_for(np.array([0.0, 10.0, 100.0, 300.0, 1000.0, 1e5]))
    assert (np.diff(levels) >= 0).all()
    assert levels[0] == 0 and levels[-1] == len(LEVEL_ROWS) - 1
    extents = np.pi / np.array(LEVEL_ROWS)[levels[:5]]
    assert (extents**2 * (np.array([0.0, 10.0, 100.0, 300.0, 1000.0]) + 2) <= 4.001).all()
    assert synthesis_shading.COARSENESS == 4.0
