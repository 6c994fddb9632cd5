"""A dome over a mask: a ball for a disc, an ellipsoid for an ellipse, finite for any mask."""

import numpy as np
import pytest

from lime_keras.lighting import guessed_normals


def _disc(size, across=0.8, up=0.8):
    v, u = (np.mgrid[:size, :size] + 0.5) * (2 / size) - 1
    return (np.hypot(u / across, v / up) < 1)[..., None].astype(np.float32), u, -v


def _angle(found, expected):
    cosine = np.clip(np.sum(found * expected, axis=-1), -1, 1)
    return np.degrees(np.arccos(cosine))


@pytest.mark.parametrize("size", [64, 300])
@pytest.mark.parametrize("across, up", [(0.8, 0.8), (0.9, 0.5)])
def test_an_ellipse_becomes_half_an_ellipsoid(size, across, up):
    mask, u, v = _disc(size, across, up)
    # h = k (1 − u²/a² − v²/b²) with ∇²h = −4.
    k = 2 / (1 / across**2 + 1 / up**2)
    height = np.maximum(k * (1 - (u / across) ** 2 - (v / up) ** 2), 0)
    n = np.stack([k * u / across**2, k * v / up**2, np.sqrt(height)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    well_inside = height > 0.05 * k
    error = _angle(guessed_normals.normals(mask), n)[well_inside]
    assert np.median(error) < 1.5
    assert np.quantile(error, 0.95) < 5
    assert error.max() < 15  # at the rim, where the mask has steps


def test_nothing_outside_and_unit_normals_towards_the_viewer_inside():
    rng = np.random.default_rng(0)
    mask = np.kron(rng.uniform(size=(9, 7)) > 0.4, np.ones((11, 13)))[..., None]
    found = guessed_normals.normals(mask)
    inside = mask[..., 0] >= 0.5
    assert found.dtype == np.float32
    assert not found[~inside].any()
    assert np.linalg.norm(found[inside], axis=-1) == pytest.approx(1, abs=1e-5)
    assert found[inside][:, 2].min() >= 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (2, 300)])
def test_slivers_and_single_pixels_are_finite(shape):
    found = guessed_normals.normals(np.ones((*shape, 1)))
    assert np.linalg.norm(found, axis=-1) == pytest.approx(1, abs=1e-5)


def test_no_object_has_no_normals_and_a_wrong_shape_is_told():
    assert not guessed_normals.normals(np.zeros((5, 6, 1))).any()
    with pytest.raises(ValueError, match=r"\(H, W, 1\)"):
        guessed_normals.normals(np.ones((5, 6)))
