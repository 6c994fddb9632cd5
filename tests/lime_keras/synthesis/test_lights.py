"""The lights of a bank, and how broken ones are told."""

import json

import bank_files
import numpy as np
import pytest

from lime_keras.optics import environment
from lime_keras.synthesis.lights import LISTED, RADIANCE, LightBank


@pytest.fixture
def folder(tmp_path):
    bank_files.write(tmp_path)
    return tmp_path


def change(folder, row, where, value):
    path = folder / RADIANCE
    radiance = np.load(path)
    radiance[row][where] = value
    np.save(path, radiance)


def relist(folder, entry, **values):
    listed = json.loads((folder / LISTED).read_text())
    listed[entry] |= values
    (folder / LISTED).write_text(json.dumps(listed))


def test_lights_have_a_mean_of_one_after_scaling(folder):
    lights = LightBank(folder)
    assert len(lights) == 2 and lights.kinds == ["room", "sky"] == lights.names
    assert isinstance(lights.radiance, np.memmap) and lights.scale.tolist() == [1, 4]
    for number in range(2):
        assert lights.map(number).dtype == np.float32
        assert environment.spherical_mean(lights.map(number)) == pytest.approx(1, abs=1e-3)
    assert environment.spherical_mean(lights.radiance[1].astype(float)) < 0.26
    np.testing.assert_array_equal(lights.strong_direction, [[0, 1, 0]] * 2)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e-3])
def test_a_light_with_a_texel_that_is_none_is_refused_by_name(folder, value):
    change(folder, 1, (3, 4), value)
    with pytest.raises(ValueError, match=r"radiance\.npy: map 1, sky, .*row 3, column 4"):
        LightBank(folder)


@pytest.mark.parametrize("value", [0, 3])
def test_a_light_of_another_mean_is_refused_by_name(folder, value):
    change(folder, 0, ..., value)
    with pytest.raises(ValueError, match=rf"map 0, room, has a mean of {value}, expected 1"):
        LightBank(folder)


def test_a_light_of_one_texel_is_kept(folder):
    """All of its power in one texel, which the scale lets a half float hold."""
    change(folder, 1, ..., 0)
    texel = environment.solid_angles(256, 512)[100, 0] / (4 * np.pi)
    scale = 16.0
    change(folder, 1, (100, 7), 1 / texel / scale)
    relist(folder, 1, scale=scale)
    assert environment.spherical_mean(LightBank(folder).map(1)) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("name", [RADIANCE, LISTED])
def test_a_missing_file_is_told_by_name(folder, name):
    (folder / name).unlink()
    with pytest.raises(FileNotFoundError, match=f"{name} is missing"):
        LightBank(folder)


@pytest.mark.parametrize("name", [RADIANCE, LISTED])
@pytest.mark.parametrize("kept", [0, 20, -1])
def test_a_file_cut_off_is_told_by_name(folder, name, kept):
    (folder / name).write_bytes((folder / name).read_bytes()[:kept])
    with pytest.raises(ValueError, match=rf"{name} is .*broken .*run the same"):
        LightBank(folder)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"scale": "much"}, "broken"),
        ({"scale": float("nan")}, "map 1"),
        ({"strong_direction": [0, 1]}, "broken"),
        ({"strong_direction": [0, 0, 0]}, "strongest light without a direction"),
        ({"strong_direction": [0, float("nan"), 0]}, "strongest light without a direction"),
        ({"kind": "lamp"}, "names lights of kind lamp"),
    ],
)
def test_a_list_that_cannot_be_is_refused(folder, values, told):
    relist(folder, 1, **values)
    with pytest.raises(ValueError, match=told):
        LightBank(folder)


def test_as_many_lights_as_listed(folder):
    np.save(folder / RADIANCE, np.load(folder / RADIANCE)[:1])
    with pytest.raises(ValueError, match=r"radiance\.npy is float16 of \(1, 256, 512\), expected"):
        LightBank(folder)
