"""The two surfaces of a pixel that sees an edge."""

import numpy as np
import pytest

from lime_keras.optics.shading import reflect
from lime_keras.render.bank.surfaces import PARTED_ABOVE, parted
from lime_keras.render.scene.gbuffer import GBuffer


def seen(*pixels):
    """A G-buffer of pixels in a row, each given by the normals of its samples, seen from z."""
    counts = [len(normals) for normals in pixels]
    normal = np.concatenate([np.asarray(normals, float) for normals in pixels])
    view = np.broadcast_to([0.0, 0, 1], normal.shape)
    owner = np.repeat(np.arange(len(pixels)), counts)
    mirrored = reflect(normal, view)
    spread = [1 - (mirrored[owner == k].mean(axis=0) ** 2).sum() for k in range(len(pixels))]
    return GBuffer(
        coverage=np.ones((1, len(pixels)), np.float32),
        normal=normal,
        view=view,
        pixel=owner,
        central=np.cumsum(counts) - counts,
        spread=np.array(spread),
        cells=np.cumsum(counts) - counts,
        cell_weights=np.array(counts),
    )


def leaning(degrees):
    return [np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]


def test_an_edge_of_two_planes_is_parted_into_them():
    a, b = leaning(-20), leaning(25)
    found = parted(seen([leaning(0)] * 9, [a, b, a, a, b, a, a, a, a]))
    assert found.rows.tolist() == [1]
    first = 0 if found.share[0] > 0.5 else 1
    assert max(found.share[0], 1 - found.share[0]) == pytest.approx(7 / 9)
    np.testing.assert_allclose(found.normal[first, 0], a, atol=1e-12)
    np.testing.assert_allclose(found.normal[1 - first, 0], b, atol=1e-12)
    np.testing.assert_allclose(found.variance, 0, atol=1e-12)


def test_flat_pixels_stay_whole():
    found = parted(seen([leaning(10)] * 9, [leaning(0), leaning(1)]))
    assert found.normal.shape == (2, 0, 3) and not len(found.rows)


def test_pixels_are_parted_above_the_stated_variance():
    """Two directions at an angle of 2a have a variance of sin² a."""
    half = np.degrees(np.arcsin(np.sqrt(PARTED_ABOVE))) / 2  # mirror directions turn twice as fast
    found = parted(seen(*([leaning(-k * half), leaning(k * half)] for k in (0.99, 1.01))))
    assert found.rows.tolist() == [1]


def test_samples_of_one_mirror_direction_stay_whole():
    """Their variance may be told above by rounding alone."""
    one = seen([leaning(30)] * 5)
    held = GBuffer(**(vars(one) | {"spread": np.array([0.5])}))
    assert not len(parted(held).rows)


def test_opposite_normals_of_a_group_have_no_mean_and_stay_whole():
    """They cannot be of one surface; a mean of length 0 has no direction."""
    found = parted(seen([[0, 1, 0], [0, -1, 0], [0, 0, 1]]))
    assert np.isfinite(found.normal).all()
    assert (np.linalg.norm(found.normal, axis=-1) > 1e-3).all()


def slow(normals):
    """The same groups by loops."""
    mirrored = reflect(normals, np.broadcast_to([0.0, 0, 1], normals.shape))

    def farthest(point):
        return mirrored[np.argmax(((mirrored - point) ** 2).sum(axis=1))]

    a = farthest(mirrored.mean(axis=0))
    b = farthest(a)
    for _ in range(3):
        first = ((mirrored - a) ** 2).sum(axis=1) <= ((mirrored - b) ** 2).sum(axis=1)
        a, b = mirrored[first].mean(axis=0), mirrored[~first].mean(axis=0)
    normal = [normals[first].mean(axis=0), normals[~first].mean(axis=0)]
    return first.mean(), np.array(normal), 1 - np.array([a @ a, b @ b])


def test_rough_pixels_are_parted_as_by_loops():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(40, 25, 3))
    normals[..., 2] = np.abs(normals[..., 2]) + 0.3
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    found = parted(seen(*normals))
    assert found.rows.tolist() == list(range(40))
    for k, pixel in enumerate(normals):
        share, normal, variance = slow(pixel)
        assert found.share[k] == pytest.approx(share)
        np.testing.assert_allclose(found.normal[:, k], normal, atol=1e-9)
        np.testing.assert_allclose(found.variance[:, k], variance, atol=1e-9)


def test_two_surfaces_vary_less_than_the_pixel():
    rng = np.random.default_rng(1)
    angles = rng.uniform(-60, 60, (30, 16))
    gbuffer = seen(*([leaning(a) for a in pixel] for pixel in angles))
    found = parted(gbuffer)
    both = found.share * found.variance[0] + (1 - found.share) * found.variance[1]
    assert len(found.rows) == 30 and (both < 0.6 * gbuffer.spread[found.rows]).all()
