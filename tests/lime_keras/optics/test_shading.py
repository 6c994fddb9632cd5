"""D, S and M: the white furnace, delta lights, brute force, limits and corners."""

import math

import numpy as np
import pytest

from lime_keras.optics import environment, shading, shininess
from lime_keras.optics.shading import normaliser

FURNACE_EXPONENTS = [0, 1, 2.37, 10, 100, 1000]
BINS = {f"bin {k + 1}": 10.0 ** shininess.LOG_MEANS[k] for k in (0, 3, 7)}


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def sphere(count, seed=0):
    """Visible normals of a sphere and directions to a near viewer, both `(count, 3)`."""
    rng = np.random.default_rng(seed)
    normal = unit(rng.normal(size=(count, 3)))
    normal[:, 2] = np.abs(normal[:, 2])
    view = unit(np.array([0, 0, 4.0]) - normal)
    seen = np.sum(normal * view, axis=-1) > 0.05
    return normal[seen], view[seen]


def at_angle(degrees):
    """n along z and o at an angle to it, `(1, 3)` each."""
    angle = math.radians(degrees)
    return np.array([[0.0, 0, 1]]), np.array([[math.sin(angle), 0, math.cos(angle)]])


def room(height=64, seed=0):
    """A smooth sky and floor with one small lamp 500 times as bright."""
    rng = np.random.default_rng(seed)
    direction = environment.directions(height, 2 * height)
    smooth = np.full(direction.shape[:2], 0.6)
    for _ in range(4):
        axis = unit(rng.normal(size=3))
        smooth += rng.uniform(0.1, 0.5) * np.exp(2 * (direction @ axis - 1))
    lamp = direction @ unit(np.array([0.4, 0.6, 0.7])) > math.cos(0.06)
    return smooth + 300.0 * lamp


@pytest.fixture(scope="module")
def furnace():
    return shading.texels(np.ones((128, 256)))


# The white furnace.


def test_the_furnaces_diffuse_shading_and_mirror_image_are_one(furnace):
    normal, view = sphere(40)
    np.testing.assert_allclose(shading.diffuse(normal, *furnace), 1, rtol=1e-3)
    mirror = environment.lookup(np.ones((8, 16)), shading.reflect(normal, view))
    np.testing.assert_allclose(mirror, 1)


@pytest.mark.parametrize("degrees, expected", [(0, 1), (30, 0.866), (60, 0.500), (80, 0.173)])
def test_the_furnaces_sharp_specular_shading_falls_as_the_cosine(degrees, expected):
    # Near the horizon, coarser maps err by several per cent.
    furnace = shading.texels(np.ones((256, 512)))
    found = shading.specular(*at_angle(degrees), 1000, *furnace)
    assert found[0] == pytest.approx(expected, rel=5e-3)


def test_the_furnaces_specular_shading_never_exceeds_one(furnace):
    """At a slant the lobe is cut off by the horizon or foreshortened, whatever the exponent."""
    for degrees in (10, 30, 50, 70, 85, 89.9):
        for exponent in FURNACE_EXPONENTS:
            [found] = shading.specular(*at_angle(degrees), exponent, *furnace)
            assert 0 < found < 1.002


def test_specular_shading_tends_to_the_mirror_image():
    """As s → ∞, S → (o·n) M; a first-order error in 1/s remains."""
    direction = environment.directions(512, 1024)
    radiance = 1 + 0.5 * direction[..., 0] + 0.4 * direction[..., 1] * direction[..., 2]
    lights = shading.texels(radiance)
    normal, view = sphere(16)
    mirror = environment.lookup(radiance, shading.reflect(normal, view))
    expected = np.sum(normal * view, axis=-1) * mirror
    errors = []
    for exponent in (100, 400, 1600):
        steep = np.sum(normal * view, axis=-1) > 0.5
        found = shading.specular(normal[steep], view[steep], exponent, *lights)
        errors.append(np.abs(found / expected[steep] - 1).max())
    assert errors[-1] < 0.01
    assert errors[0] > 3 * errors[1] > 9 * errors[2]


# Closed forms.


def test_light_from_one_side_of_the_sky():
    """E = 1 above the horizon, 0 below: D = (1 + n_y) / 2."""
    radiance = np.zeros((256, 512))
    radiance[:128] = 1
    normal, _ = sphere(40)
    found = shading.diffuse(normal, *shading.texels(radiance))
    np.testing.assert_allclose(found, (1 + normal[:, 1]) / 2, atol=2e-3)


def test_a_linear_sky():
    """E = 1 + i·a: D = 1 + (2/3) n·a, the first spherical harmonic under the cosine."""
    axis = np.array([0.3, -0.5, 0.2])
    radiance = 1 + environment.directions(128, 256) @ axis
    normal, _ = sphere(40)
    found = shading.diffuse(normal, *shading.texels(radiance))
    np.testing.assert_allclose(found, 1 + 2 / 3 * normal @ axis, rtol=1e-3)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 40.0, 1000.0])
def test_the_printed_lobe_is_eq_3_without_a_normaliser(furnace, exponent):
    """In a furnace at n = o, ∫ (h·n)^s di is 1 / c(s): 2π at s = 0, 8π / 1002 at s = 1000."""
    normal = sphere(10)[0]
    found = shading.lobe_factor(exponent, "printed") * shading.specular(
        normal, normal, exponent, *furnace
    )
    directions, energy = furnace
    half = directions[None] + normal[:, None]
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
    cosine = np.maximum(np.einsum("ntk,nk->nt", half, normal), 0)
    lit = normal @ directions.T > 0
    printed = np.where(lit, cosine**exponent, 0.0) @ energy
    np.testing.assert_allclose(found, printed / math.pi, rtol=1e-5)
    assert shading.lobe_factor(exponent, "furnace") == 1.0


# Brute force.


def brute_force(normal, view, exponent, radiance, subdivision=1):
    """D and S of one pixel, light by light, each texel cut into smaller constant ones."""
    height, width = (subdivision * n for n in radiance.shape)
    fine = np.repeat(np.repeat(radiance, subdivision, 0), subdivision, 1)
    diffuse = specular = 0.0
    for row in range(height):
        theta = math.pi * (row + 0.5) / height
        solid_angle = math.cos(math.pi * row / height) - math.cos(math.pi * (row + 1) / height)
        solid_angle *= 2 * math.pi / width
        phi = 2 * math.pi * (np.arange(width) + 0.5) / width
        light = np.stack(
            [
                math.sin(theta) * np.sin(phi),
                np.full(width, math.cos(theta)),
                -math.sin(theta) * np.cos(phi),
            ],
            axis=-1,
        )
        cosine = light @ normal
        half = unit(light + view)
        lit = (cosine > 0) & (half @ normal > 0)
        energy = fine[row] * solid_angle
        diffuse += np.sum(np.maximum(cosine, 0) * energy) / math.pi
        specular += np.sum((np.abs(half @ normal) ** exponent * energy)[lit])
    return diffuse, specular * normaliser(exponent)


@pytest.mark.parametrize("exponent", BINS.values(), ids=BINS)
def test_texels_are_fine_enough_for_the_lobe(exponent):
    radiance = room(128)
    normal, view = sphere(8, seed=1)
    lights = shading.texels(radiance)
    specular = shading.specular(normal, view, exponent, *lights)
    expected = [brute_force(n, o, exponent, radiance, 3) for n, o in zip(normal, view, strict=True)]
    diffuse, fine = np.array(expected).T
    np.testing.assert_allclose(shading.diffuse(normal, *lights), diffuse, rtol=2e-3)
    assert np.median(np.abs(specular / fine - 1)) < 5e-3
    np.testing.assert_allclose(specular, fine, rtol=0.05)


def test_the_normal_halves_the_angle_to_the_reflected_direction():
    normal, view = sphere(50)
    reflected = shading.reflect(normal, view)
    np.testing.assert_allclose(np.linalg.norm(reflected, axis=-1), 1)
    np.testing.assert_allclose(unit(reflected + view), normal, atol=1e-9)
    facing = np.array([[0, 0, 1.0]])
    np.testing.assert_array_equal(shading.reflect(facing, facing), facing)


# Precision, pieces and corners.


@pytest.mark.parametrize("exponent", BINS.values(), ids=BINS)
def test_single_precision_and_chunks_change_little(exponent, monkeypatch):
    radiance, (normal, view) = room(), sphere(30)
    lights = shading.texels(radiance)
    double = shading.diffuse(normal, *lights), shading.specular(normal, view, exponent, *lights)
    arrays = [array.astype(np.float32) for array in (normal, view, *lights)]
    monkeypatch.setattr(shading, "_CHUNK", 7 * len(lights[0]))
    single = (
        shading.diffuse(arrays[0], *arrays[2:]),
        shading.specular(*arrays[:2], exponent, *arrays[2:]),
    )
    for found, expected in zip(single, double, strict=True):
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, rtol=1e-3)
    monkeypatch.setattr(shading, "_CHUNK", 1)
    again = shading.specular(normal, view, exponent, *lights)
    np.testing.assert_allclose(again, double[1], rtol=1e-10)


def test_no_light_at_all():
    normal, view = sphere(5)
    light, energy = shading.texels(np.zeros((4, 8)))
    assert len(light) == len(energy) == 0
    assert (shading.diffuse(normal, light, energy) == 0).all()
    assert (shading.specular(normal, view, 10, light, energy) == 0).all()
    lights = shading.texels(np.ones((4, 8)))
    assert shading.specular(normal[:0], view[:0], 10, *lights).shape == (0,)


def test_texels_leave_out_the_dark_and_keep_the_energy():
    radiance = room().astype(np.float32)
    radiance[:10] = 0
    light, energy = shading.texels(radiance)
    assert len(light) == radiance.size - 10 * 128 and light.dtype == energy.dtype == np.float32
    assert energy.sum() == pytest.approx(
        4 * math.pi * environment.spherical_mean(radiance), rel=1e-4
    )
    assert light[:, 1].max() < math.cos(math.pi * 10 / 64)


def test_view_directions_by_the_records_formula():
    fx, fy, cx, cy = camera = np.array([90.0, 80, 5, 2])
    found = shading.view_directions(camera, 4, 6)
    assert found.shape == (4, 6, 3)
    for y, x in np.ndindex(4, 6):
        expected = -unit(np.array([(x + 0.5 - cx) / fx, -(y + 0.5 - cy) / fy, -1]))
        np.testing.assert_allclose(found[y, x], expected, rtol=1e-12)
    # A pixel to the right and above sees along (+, +, −): its viewer lies the other way.
    assert (np.sign(found[0, 5]) == [-1, -1, 1]).all()


def test_an_unknown_camera_looks_straight_at_the_photos_centre():
    view = shading.view_directions(shading.assumed_camera(101, 301), 101, 301)
    assert view[50, 150] == pytest.approx([0, 0, 1])
    half_angle = math.atan(0.5 / shading.ASSUMED_FOCAL * 300 / 301)
    assert view[50, 0] == pytest.approx([math.sin(half_angle), 0, math.cos(half_angle)])


@pytest.mark.parametrize("exponent", [0, 1, 2.37, 10, 100, 1000])
def test_normaliser_makes_a_furnace_one(exponent):
    """S at n = o: h lies at half the light's angle θ, so ∫ cos(θ/2)^s 2π sin θ dθ · c = 1."""
    theta = (np.arange(200_000) + 0.5) * (math.pi / 2 / 200_000)
    integral = np.sum(np.cos(theta / 2) ** exponent * np.sin(theta)) * (math.pi / 2 / 200_000)
    assert 2 * math.pi * integral * normaliser(exponent) == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize("exponent", [-1e-6, -2.0, np.nan, np.array([1.0, np.nan]), -np.inf])
def test_an_exponent_that_is_none_has_no_normaliser(exponent):
    with pytest.raises(ValueError, match=r"exponents are at least 0, got .*: check the material"):
        normaliser(exponent)
    np.testing.assert_allclose(normaliser(np.array([0.0, -0.0])), 1 / (2 * math.pi))


def test_tensors_and_arrays_agree(differentiate):
    exponent = np.geomspace(1e-3, 1e6, 41)
    np.testing.assert_allclose(differentiate(normaliser, exponent)[0], normaliser(exponent))
