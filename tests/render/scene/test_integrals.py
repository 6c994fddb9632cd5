"""Fast D, S and M against plain sums over every texel, and in closed form."""

import itertools
import math

import numpy as np
import pytest
from render_scenes import photographed

from lime_keras.optics import environment, shading, shininess
from lime_keras.optics.shading import normaliser
from lime_keras.render.scene import integrals, lights

BINS = 10.0 ** shininess.LOG_MEANS[[0, 3, 7]]
FURNACE = np.ones((128, 256))


@pytest.fixture(scope="module")
def light():
    return lights.prepare("photographed", photographed())


@pytest.fixture(scope="module")
def texels(light):
    return shading.texels(light.radiance.astype(np.float64))


def sphere(count, seed=0):
    """Normals of a sphere's visible side, and directions to a viewer of moderate distance."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    normal[:, 2] = np.abs(normal[:, 2])
    view = np.array([0, 0, 6.0]) - normal
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    seen = np.sum(normal * view, axis=1) > 0.05
    return (normal[seen] @ turn).astype(np.float32), (view[seen] @ turn).astype(np.float32)


def error(found, expected):
    """Relative errors; of nearly black ones, relative to a hundredth of the mean."""
    return np.abs(found - expected) / np.maximum(expected, 0.01 * expected.mean())


def test_diffuse_is_the_plain_sum(light, texels):
    normal, _ = sphere(150)
    errors = error(integrals.diffuse(normal, light), shading.diffuse(normal.astype(float), *texels))
    assert np.median(errors) < 0.01 and errors.max() < 0.05


@pytest.mark.parametrize(
    ("exponent", "median", "most"),
    [*((exponent, 0.02, 0.1) for exponent in BINS), (0.0, 0.03, np.inf), (1e4, 0.02, np.inf)],
)
def test_specular_is_the_plain_sum(light, texels, exponent, median, most):
    normal, view = sphere(90)
    found = integrals.specular(normal, view, exponent, light)
    expected = shading.specular(normal.astype(float), view.astype(float), exponent, *texels)
    errors = error(found, expected)
    assert found.dtype == np.float32 and np.isfinite(found).all() and (found >= 0).all()
    assert np.median(errors) < median and np.percentile(errors, 95) < most


def test_mirror_of_a_smooth_light_is_that_light():
    axis = np.array([0.48, 0.6, -0.64])
    radiance = 1 + 0.8 * environment.directions(128, 256) @ axis
    light = lights.prepare("smooth", radiance, 1.0)
    normal, view = sphere(500)
    reflected = 2 * np.sum(normal * view, axis=1, keepdims=True) * normal - view
    np.testing.assert_allclose(
        integrals.mirror(normal, view, light, np.zeros(len(normal))),
        1 + 0.8 * reflected @ axis,
        atol=2e-3,
    )


def test_diffuse_of_a_smooth_light_in_closed_form():
    """The cosine lobe keeps two thirds of a linear light."""
    axis = np.array([0.48, 0.6, -0.64])
    light = lights.prepare("smooth", 1 + 0.8 * environment.directions(128, 256) @ axis, 1.0)
    normal, _ = sphere(500)
    np.testing.assert_allclose(
        integrals.diffuse(normal, light), 1 + 0.8 * 2 / 3 * normal @ axis, atol=5e-3
    )


@pytest.mark.parametrize("exponent", [0.0, 1.0, 10.0, 100.0, 1000.0])
def test_a_furnace_is_white(exponent):
    light = lights.prepare("furnace", FURNACE, 1.0)
    normal, view = sphere(60)
    np.testing.assert_allclose(integrals.diffuse(normal, light), 1, rtol=2e-3)
    np.testing.assert_allclose(
        integrals.mirror(normal, view, light, np.zeros(len(normal))), 1, rtol=1e-5
    )
    np.testing.assert_allclose(integrals.specular(normal, normal, exponent, light), 1, rtol=0.02)


def test_a_furnace_falls_off_as_the_cosine_for_shiny_lobes():
    light = lights.prepare("furnace", np.ones((256, 512)), 1.0)
    angle = np.radians([0, 30, 60, 80])
    view = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1).astype(np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], np.float32), view.shape)
    specular = integrals.specular(normal, view, 1000.0, light)
    np.testing.assert_allclose(specular, np.cos(angle), rtol=0.01)


@pytest.mark.parametrize("exponent", [0.0, 3.0, 80.0, 2000.0])
def test_a_single_texel_is_a_delta_light(exponent):
    radiance = np.zeros((256, 512))
    radiance[90, 301] = 1.0
    light = lights.prepare("lamp", radiance, 1.0)
    i, energy = environment.directions(256, 512)[90, 301], 4 * np.pi
    normal, view = (directions.astype(float) for directions in sphere(3000))
    half = view + i
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    lit = np.sum(normal * i, axis=1) > 0
    lobe = np.maximum(np.sum(half * normal, axis=1), 0) ** exponent
    expected = np.where(lit, normaliser(exponent) * lobe * energy, 0)
    found = integrals.specular(normal.astype("f4"), view.astype("f4"), exponent, light)
    np.testing.assert_allclose(found, expected, rtol=5e-3, atol=1e-4 * expected.max())
    cosine = normal @ i
    diffuse = integrals.diffuse(normal, light)
    bright = cosine > 0.2
    np.testing.assert_allclose(diffuse[bright], cosine[bright] * energy / np.pi, rtol=0.02)
    assert (diffuse[cosine < -0.1] < 1e-3).all()


def test_the_support_of_a_lobe():
    assert integrals.support_angle(0.0, 1e-6) == np.pi
    angles = [integrals.support_angle(10.0**k, 1e-6) for k in range(-3, 6)]
    assert all(a >= b > 0 for a, b in itertools.pairwise(angles))
    for exponent in (50.0, 1e4):
        angle = integrals.support_angle(exponent, 1e-6)
        assert np.cos(angle / 2) ** exponent == pytest.approx(1e-6, rel=1e-6)


def test_no_sample_at_all_gives_no_shading(light):
    nothing = np.zeros((0, 3), np.float32)
    assert integrals.specular(nothing, nothing, 10.0, light).shape == (0,)
    assert integrals.diffuse(nothing, light).shape == (0,)


@pytest.mark.parametrize("degrees", [0.3, 1.0, 4.0, 9.0])
def test_a_lamp_of_one_texel_counts_once_wherever_it_falls_between_samples(degrees):
    """Samples of M on a grid see all of the lamp's energy; before, they saw it by chance."""
    rng, spacing = np.random.default_rng(0), math.radians(degrees)
    radiance = np.zeros((512, 1024), np.float32)
    radiance[256, 300] = 1
    light = lights.prepare("lamp", radiance)
    energy = np.sum(light.radiance * environment.solid_angles(512, 1024))
    half = max(3 * spacing, math.radians(3))
    for _ in range(4):
        # Mirror directions around the lamp, on the equator, seen along their own normals.
        steps = np.arange(-half, half, spacing)
        up, across = np.meshgrid(steps, steps, indexing="ij")
        shift = rng.uniform(0, spacing, 2)
        theta, phi = np.pi / 2 + up + shift[0], 2 * np.pi * 300 / 1024 + across + shift[1]
        sin = np.sin(theta)
        towards = np.stack([sin * np.sin(phi), np.cos(theta), -sin * np.cos(phi)], -1)
        towards = towards.reshape(-1, 3).astype(np.float32)
        found = integrals.mirror(towards, towards, light, np.full(len(towards), spacing))
        total = np.sum(found * sin.ravel()) * spacing**2
        assert total == pytest.approx(energy, rel=0.25)  # wider texels ripple


def test_light_that_is_negative_somewhere_is_refused():
    radiance = np.ones((64, 128))
    radiance[3, 5] = -0.5
    with pytest.raises(ValueError, match="cave: radiance is finite and at least 0"):
        lights.prepare("cave", radiance)
