"""Equirectangular maps: the convention, its seams and poles, and energy under rotation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics import environment

SHAPES = [(1, 1), (1, 2), (3, 5), (16, 32), (64, 128)]
ANGLE = st.floats(-10, 10)


def noise(height, width, seed=0):
    return np.random.default_rng(seed).exponential(size=(height, width))


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def bilinear(radiance, direction):
    """One look-up, by the definition of u and v, with explicit neighbours."""
    height, width = radiance.shape
    x, y, z = direction / np.linalg.norm(direction)
    u, v = np.arctan2(x, -z) / (2 * np.pi) % 1, np.arccos(np.clip(y, -1, 1)) / np.pi
    total = 0.0
    for row in range(-1, height + 1):
        for column in range(-1, width + 1):
            share_v = max(0, 1 - abs(v * height - 0.5 - row))
            share_u = max(0, 1 - abs(u * width - 0.5 - column))
            clamped = min(max(row, 0), height - 1)
            total += share_v * share_u * radiance[clamped, column % width]
    return total


@pytest.mark.parametrize("shape", SHAPES)
def test_directions_are_mitsubas(shape):
    height, width = shape
    found = environment.directions(height, width)
    for row, column in np.ndindex(shape):
        v, u = (row + 0.5) / height, (column + 0.5) / width
        expected = [
            np.sin(np.pi * v) * np.sin(2 * np.pi * u),
            np.cos(np.pi * v),
            -np.sin(np.pi * v) * np.cos(2 * np.pi * u),
        ]
        np.testing.assert_allclose(found[row, column], expected, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1)


def test_the_top_row_is_up_and_the_middle_column_faces_the_camera():
    found = environment.directions(64, 128)
    assert found[0, 0, 1] > 0.999 and found[-1, 0, 1] < -0.999
    assert found[32, 64, 2] > 0.99 and found[32, 0, 2] < -0.99 and found[32, 32, 0] > 0.99


@pytest.mark.parametrize("shape", SHAPES)
def test_solid_angles_cover_the_sphere(shape):
    found = environment.solid_angles(*shape)
    assert found.shape == shape and (found > 0).all()
    assert found.sum() == pytest.approx(4 * np.pi)
    assert environment.spherical_mean(np.full(shape, 3.5)) == pytest.approx(3.5)


def test_solid_angles_are_integrals_of_the_sine():
    theta = (np.arange(1000) + 0.5) / 1000 * np.pi / 7
    expected = np.sin(theta).sum() * np.pi / 7 / 1000 * 2 * np.pi / 3
    assert environment.solid_angles(7, 3)[0, 0] == pytest.approx(expected, rel=1e-6)


@given(ANGLE, ANGLE, st.sampled_from(SHAPES[:3]))
def test_look_ups_are_bilinear(theta, phi, shape):
    direction = np.array([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)])
    radiance = noise(*shape)
    found = environment.lookup(radiance, direction)
    assert found == pytest.approx(bilinear(radiance, direction), rel=1e-6)


def test_the_seam_behind_and_the_poles_are_continuous():
    radiance = noise(8, 16)
    for y in (-0.9, 0.0, 0.3):
        sides = np.array([[1e-9, y, -1], [-1e-9, y, -1]])
        left, right = environment.lookup(radiance, sides)
        assert left == pytest.approx(right, rel=1e-6)
    for pole, row in ((1.0, 0), (-1.0, -1)):
        # Axes and signed zeros included.
        directions = np.array([[0, pole, 0], [-0.0, pole, -0.0], [1e-30, pole, 0]])
        values = environment.lookup(radiance, directions)
        assert radiance[row].min() <= values.min() and values.max() <= radiance[row].max()


def test_length_and_shape_of_directions_do_not_matter():
    radiance, directions = noise(8, 16), environment.directions(3, 4)
    found = environment.lookup(radiance, directions)
    assert found.shape == (3, 4)
    np.testing.assert_allclose(environment.lookup(radiance, directions * 7), found, rtol=1e-6)
    single = environment.lookup(radiance.astype(np.float32), directions.astype(np.float32))
    np.testing.assert_allclose(single, found, rtol=1e-4)


def smooth(height, width):
    """A map that a box filter barely changes, unlike in every direction."""
    x, y, z = np.moveaxis(environment.directions(height, width), -1, 0)
    return 2 + x + 0.5 * y * z - 0.3 * z


@pytest.mark.parametrize("texels", [0, 1, 5, 16, 31])
def test_turning_about_the_vertical_shifts_the_columns(texels):
    radiance, phi = smooth(16, 32), 2 * np.pi * texels / 32
    # u grows from −z towards +x.
    turn = np.array([[np.cos(phi), 0, -np.sin(phi)], [0, 1, 0], [np.sin(phi), 0, np.cos(phi)]])
    found = environment.rotate(radiance, turn, 16, 32)
    np.testing.assert_allclose(found, np.roll(radiance, texels, axis=1), rtol=0.03)


@pytest.mark.parametrize("seed", range(8))
def test_a_lamp_goes_where_the_rotation_takes_it_with_its_energy(seed):
    turn = rotation(seed)
    assert np.linalg.det(turn) == pytest.approx(1)
    lamp = np.zeros((64, 128))
    row, column = np.random.default_rng(seed).integers([10, 1], [54, 127])
    lamp[row - 1 : row + 2, column - 1 : column + 2] = 1e4
    energy = lamp * environment.solid_angles(64, 128)
    found = environment.rotate(lamp, turn, 32, 64) * environment.solid_angles(32, 64)
    assert found.sum() == pytest.approx(energy.sum(), rel=0.05)
    before = turn @ np.sum(energy[..., None] * environment.directions(64, 128), axis=(0, 1))
    after = np.sum(found[..., None] * environment.directions(32, 64), axis=(0, 1))
    before, after = (sums / np.linalg.norm(sums) for sums in (before, after))
    np.testing.assert_allclose(after, before, atol=0.02)


def test_a_lamp_of_one_texel_keeps_its_energy_in_a_map_of_its_size():
    """One look-up in each texel would lose 3 % of it, where it lies between two."""
    lamp = np.zeros((16, 32))
    lamp[6, 9] = 1
    means = [
        environment.spherical_mean(environment.rotate(lamp, rotation(k), 16, 32)) for k in range(8)
    ]
    np.testing.assert_allclose(means, environment.spherical_mean(lamp), rtol=0.01)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1e-3])
def test_what_is_no_radiance_is_refused_by_place(value):
    radiance = np.ones((4, 8), np.float32)
    environment.check(radiance)
    environment.check(0 * radiance)
    environment.check(radiance[:0])
    radiance[2, 5] = radiance[3, 1] = value
    with pytest.raises(ValueError, match=r"2 of the map's 32 texels .* row 2, column 5: repair"):
        environment.check(radiance)
    with pytest.raises(ValueError, match=f"the first {np.float32(value)} in row 2"):
        environment.rotate(radiance, np.eye(3), 4, 8)


@pytest.mark.parametrize("shape", SHAPES)
def test_splatting_is_the_transpose_of_looking_up(shape):
    rng = np.random.default_rng(5)
    towards = rng.normal(size=(200, 3))
    towards = np.concatenate([towards, [[0, 1, 0], [0, -1, 0], [0, 0, -1], [1e-9, 0, -1]]])
    values, radiance = rng.uniform(size=len(towards)), noise(*shape)
    found = environment.splat(values, towards, *shape)
    assert found.shape == shape
    assert np.sum(found * radiance) == pytest.approx(
        np.sum(values * environment.lookup(radiance, towards))
    )
    assert np.sum(found) == pytest.approx(np.sum(values))


@pytest.mark.parametrize("degrees", [3, 10, 40])
def test_an_even_light_stays_even_under_blur(degrees):
    blurred = environment.blur(np.full((64, 128), 2.5), np.radians(degrees))
    assert blurred == pytest.approx(2.5, rel=1e-6)


@pytest.mark.parametrize("towards", [(0, 0, 1), (0.01, 0.3, -1), (1, -0.9, 0)])
def test_a_lamps_blur_is_round_and_keeps_its_energy(towards):
    """Second moments along the parallel and the meridian are those of the Gaussian."""
    towards = np.array(towards) / np.linalg.norm(towards)
    lamp = environment.splat(np.ones(1), towards[None], 64, 128)
    solid_angle = environment.solid_angles(64, 128)
    angle = np.radians(8)
    blurred = environment.blur(lamp / solid_angle, angle) * solid_angle
    assert np.sum(blurred) == pytest.approx(1, rel=0.02)
    place = environment.directions(64, 128)
    east = np.cross((0, 1, 0), towards)
    east /= np.linalg.norm(east)
    for axis in (east, np.cross(towards, east)):
        spread = np.sqrt(np.sum(blurred * (place @ axis) ** 2) / np.sum(blurred))
        assert spread == pytest.approx(angle, rel=0.12)


def test_blur_crosses_the_poles():
    """Across the pole is 34° away, round the parallel 180° of longitude."""
    lamp = np.zeros((64, 128))
    lamp[6, 0] = 1.0
    blurred = environment.blur(lamp, np.radians(20))
    expected = np.exp(-0.5 * (2 * 6.5 * 180 / 64 / 20) ** 2)
    assert blurred[6, 64] / blurred[6, 0] == pytest.approx(expected, rel=0.3)
    assert blurred.min() >= 0
