"""Scenes: each quantity is drawn from the distribution that the paper states."""

import numpy as np
import pytest
from scipy import stats

from lime_keras.render.scene import sampling
from lime_keras.render.shapes import endless

PLAUSIBLE = 1e-3  # p-value, at fixed seeds


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
        mesh = endless.procedural(np.random.default_rng(seed % 6))
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


def test_size_and_shift_in_the_crop_follow_their_laws():
    """The size is uniform; the shift is uniform in the free space that the object leaves."""
    rng = np.random.default_rng(3)
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    fill, across, up = [], [], []
    for _ in range(2000):
        pose = sampling.sample_pose(rng, vertices, 256)
        fx, fy, cx, cy = pose.camera
        seen = vertices @ pose.rotation.T + pose.translation
        x, y = cx - fx * seen[:, 0] / seen[:, 2], cy + fy * seen[:, 1] / seen[:, 2]
        fill.append(max(np.ptp(x), np.ptp(y)) / 256)
        across.append((x.min() + x.max()) / 512 - 0.5)
        up.append(0.5 - (y.min() + y.max()) / 512)
    low, high = sampling.NARROW.fill
    free = (1 - np.linspace(low, high, 201)) / 2

    def shift(value):
        return np.clip((np.asarray(value)[..., None] / free + 1) / 2, 0, 1).mean(axis=-1)

    assert stats.kstest(fill, stats.uniform(low, high - low).cdf).pvalue > PLAUSIBLE
    for values in (across, up):
        assert stats.kstest(values, shift).pvalue > PLAUSIBLE


def test_wide_crops_cut_the_object_at_times():
    """15 % are moved further; without these, a crop cuts only what is longer than it."""
    rng = np.random.default_rng(4)
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    cut, fill = [], []
    for _ in range(2000):
        pose = sampling.sample_pose(rng, vertices, 128, sampling.WIDE)
        fx, fy, cx, cy = pose.camera
        seen = vertices @ pose.rotation.T + pose.translation
        x, y = cx - fx * seen[:, 0] / seen[:, 2], cy + fy * seen[:, 1] / seen[:, 2]
        fill.append(max(np.ptp(x), np.ptp(y)) / 128)
        cut.append(min(x.min(), y.min()) < -1e-6 or max(x.max(), y.max()) > 128 + 1e-6)
    assert stats.kstest(fill, stats.uniform(0.35, 0.7).cdf).pvalue > PLAUSIBLE
    longer = np.mean(np.array(fill) > 1)
    assert longer < np.mean(cut) < longer + sampling.WIDE.cut


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
