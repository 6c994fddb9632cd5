"""Scenes: each quantity is drawn from the distribution that the paper states."""

import numpy as np
import pytest
from scipy import stats

from lime_keras.optics import shininess
from lime_keras.render.scene import sampling
from lime_keras.render.shapes import procedural

PLAUSIBLE = 1e-3  # p-value, at fixed seeds


@pytest.fixture(scope="module")
def materials():
    rng = np.random.default_rng(0)
    return [sampling.sample_material(rng) for _ in range(4000)]


def test_every_shininess_bin_is_as_likely(materials):
    bins = shininess.bin_of(np.array([m.exponent for m in materials]))
    counts = np.bincount(bins, minlength=shininess.BIN_COUNT)
    assert len(counts) == 8 and stats.chisquare(counts).pvalue > PLAUSIBLE


def test_the_exponent_is_log_uniform_over_the_whole_range(materials):
    logs = np.log10([m.exponent for m in materials])
    assert stats.kstest(logs, stats.uniform(0, 3).cdf).pvalue > PLAUSIBLE


def test_the_numbers_are_uniform_in_their_ranges(materials):
    specular = [m.specular_albedo for m in materials]
    ambient = [m.ambient for m in materials]
    assert stats.kstest(specular, stats.uniform(0, 1).cdf).pvalue > PLAUSIBLE
    assert stats.kstest(ambient, stats.uniform(0, 0.05).cdf).pvalue > PLAUSIBLE


def test_albedos_are_uniform_in_the_colours_cube(materials):
    """YUV is linear in RGB: uniform in the one, within the cube, is uniform in the other."""
    albedo = np.array([m.diffuse_albedo for m in materials])
    assert albedo.min() >= 0 and albedo.max() <= 1
    for channel in albedo.T:
        assert stats.kstest(channel, stats.uniform(0, 1).cdf).pvalue > PLAUSIBLE
    np.testing.assert_allclose(np.cov(albedo.T), np.eye(3) / 12, atol=0.006)


def test_nothing_is_drawn_together(materials):
    table = [
        [*m.diffuse_albedo, m.specular_albedo, np.log(m.exponent), m.ambient] for m in materials
    ]
    correlation = np.corrcoef(np.transpose(table)) - np.eye(6)
    assert np.abs(correlation).max() < 0.06


def test_rotations_are_rotations_and_of_every_kind():
    rng = np.random.default_rng(1)
    rotations = np.array([sampling.sample_rotation(rng) for _ in range(2000)])
    identity = np.broadcast_to(np.eye(3), rotations.shape)
    np.testing.assert_allclose(rotations @ rotations.swapaxes(1, 2), identity, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotations), 1, atol=1e-12)
    # Archimedes: each coordinate of a uniform unit vector is uniform in [-1, 1].
    for entry in rotations.reshape(-1, 9).T:
        assert stats.kstest(entry, stats.uniform(-1, 2).cdf).pvalue > PLAUSIBLE


@pytest.fixture(scope="module")
def projections():
    """Poses of some shapes, with their vertices' columns and rows in the crop."""
    out = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        mesh = procedural.procedural(np.random.default_rng(seed % 6))
        pose = sampling.sample_pose(rng, mesh.vertices, 96)
        x, y, z = pose.rotation @ mesh.vertices.T + pose.translation[:, None]
        fx, fy, cx, cy = pose.camera
        out.append((pose, z, np.stack([cx - fx * x / z, cy + fy * y / z])))
    return out


def test_the_object_lies_inside_the_crop_before_the_camera(projections):
    for pose, z, pixels in projections:
        assert z.max() < -1
        assert pixels.min() >= -1e-9 and pixels.max() <= 96 + 1e-9
        assert pose.camera[0] == pose.camera[1] > 0


def test_the_longer_side_fills_the_stated_share(projections):
    fill = np.array([np.ptp(pixels, axis=1).max() / 96 for _, _, pixels in projections])
    assert fill.min() >= 0.55 - 1e-9 and fill.max() <= 0.92 + 1e-9
    assert np.ptp(fill) > 0.25


def test_the_object_is_not_always_in_the_middle_of_crop_or_photo(projections):
    middles = np.array([pixels.mean(axis=1) for _, _, pixels in projections])
    assert middles.std(axis=0).min() > 1
    principal = np.array([pose.camera[2:] - 48 for pose, _, _ in projections])
    assert np.abs(principal).max() > 20


@pytest.mark.parametrize("seed", range(5))
def test_the_strong_light_comes_to_the_front(seed):
    rng = np.random.default_rng(seed)
    for _ in range(40):
        strong = rng.normal(size=3)
        strong /= np.linalg.norm(strong)
        strong[1] *= 0.9  # not the very zenith
        rotation = sampling.sample_light_rotation(rng, strong)
        assert (rotation @ strong)[2] > 0
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)


def test_the_horizon_is_tilted_as_a_camera_is_but_never_rolled():
    rng = np.random.default_rng(2)
    ups = np.array(
        [sampling.sample_light_rotation(rng, np.array([0, 0, 1.0]))[:, 1] for _ in range(300)]
    )
    np.testing.assert_allclose(ups[:, 0], 0, atol=1e-12)
    pitch = np.degrees(np.arctan2(ups[:, 2], ups[:, 1]))
    assert -10 <= pitch.min() < -5 and 25 < pitch.max() <= 30


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_a_light_overhead_ends_the_search(up):
    rotation = sampling.sample_light_rotation(np.random.default_rng(0), np.array([0, up, 0]))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_a_scene_is_a_function_of_the_generator():
    first, again, other = (sampling.sample_material(np.random.default_rng(k)) for k in (0, 0, 1))
    assert first.exponent == again.exponent != other.exponent
    np.testing.assert_array_equal(first.diffuse_albedo, again.diffuse_albedo)
