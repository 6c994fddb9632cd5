"""Pictures inside maps: a camera that turns keeps its angles, and any map gives a picture."""

import numpy as np
import pytest

from lime_keras.render.scene import map_views


def test_the_camera_is_turned_without_bending_its_rays(monkeypatch):
    seen = []

    def lookup(band, rays):
        seen.append(rays.reshape(map_views.HEIGHT, map_views.WIDTH, 3))
        return np.ones(len(rays))

    monkeypatch.setattr(map_views.environment, "lookup", lookup)
    elevations = []
    for seed in range(50):
        map_views.view(np.ones((4, 8, 3)), np.random.default_rng(seed))
        rays = seen[-1]
        np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, atol=1e-6)
        # The axis halves the angle between opposite edges, which is 37 to 90 degrees.
        middle, left, right = rays[144].mean(0), rays[144, 0], rays[144, -1]
        assert left @ middle == pytest.approx(right @ middle, abs=0.01)
        assert 36 < np.degrees(np.arccos(left @ right)) < 91
        elevations.append(np.degrees(np.arcsin(rays[143:145, 191:193, 1].mean())))
    # It looks 35 degrees down to 15 degrees up.
    assert -36 < min(elevations) < -25 and 8 < max(elevations) < 16


@pytest.mark.parametrize("value", [0.0, 1e-30, 1.0, 1e30, np.inf])
def test_any_radiance_gives_a_picture(value):
    picture = map_views.view(np.full((4, 8, 3), value), np.random.default_rng(0))
    assert picture.shape == (map_views.HEIGHT, map_views.WIDTH, 3)
    assert np.isfinite(picture).all() and 0 <= picture.min() <= picture.max() <= 1


def test_two_maps_of_one_name_are_refused(tmp_path):
    for split in ("train", "test"):
        (tmp_path / split).mkdir()
    for name in ("room.hdr", "room.exr", "hall.exr"):
        (tmp_path / "train" / name).write_bytes(name.encode())
    with pytest.raises(ValueError, match=r"room\.\w+ and room\.\w+ would have the same names"):
        map_views.write_views(tmp_path, tmp_path / "out", 1, lambda done, total: None)
