"""Normals from files: what is written is read, and what is no normal map is refused."""

import os

import lying_headers
import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image
from written_pictures import oriented, write

from lime_keras.io import normal_map


def _ball(size=24):
    """Normals of a ball, 0 outside, and where it is."""
    down, across = (np.mgrid[:size, :size] + 0.5) * (2 / size) - 1
    inside = np.hypot(across, down) < 0.95
    z = np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    return np.stack([across, -down, z], axis=-1) * inside[..., None], inside


@pytest.mark.parametrize("names", [None, ("X", "Y", "Z"), ("normal.X", "normal.Y", "normal.Z")])
def test_exr_holds_normals_as_they_are(tmp_path, names):
    normal, _ = _ball()
    path = write(tmp_path / "n.exr", normal, oiio.FLOAT, names)
    assert normal_map.read(path) == pytest.approx(normal, abs=1e-6)


def test_normals_lie_in_the_display_window_as_their_photo_does(tmp_path):
    """A renderer writes the pixels of the object alone."""
    normal, _ = _ball()
    spec = oiio.ImageSpec(20, 18, 3, oiio.FLOAT)
    spec.x, spec.y, spec.full_width, spec.full_height = 2, 3, 24, 24
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(spec.roi, np.ascontiguousarray(normal[3:21, 2:22], np.float32))
    assert buffer.write(str(tmp_path / "n.exr"))
    expected = np.zeros_like(normal)
    expected[3:21, 2:22] = normal[3:21, 2:22]
    assert normal_map.read(tmp_path / "n.exr") == pytest.approx(expected, abs=1e-6)


def test_normals_are_found_among_other_channels(tmp_path):
    normal, inside = _ball()
    names = ("R", "G", "B", "mask.Y", "normal.X", "normal.Y", "normal.Z")
    pixels = np.concatenate([np.ones_like(normal), inside[..., None], normal], axis=-1)
    path = write(tmp_path / "layers.exr", pixels, oiio.FLOAT, names)
    assert normal_map.read(path) == pytest.approx(normal, abs=1e-6)


@pytest.mark.parametrize("kind, tolerance", [(oiio.UINT8, 0.01), (oiio.UINT16, 1e-4)])
@pytest.mark.parametrize("background", [0.0, 0.5])
def test_png_holds_half_of_n_plus_1(tmp_path, kind, tolerance, background):
    normal, inside = _ball()
    colours = np.where(inside[..., None], (normal + 1) / 2, background)
    found = normal_map.read(write(tmp_path / "n.png", colours, kind))
    assert found == pytest.approx(normal, abs=tolerance)
    assert not found[~inside].any()
    assert np.linalg.norm(found[inside], axis=-1) == pytest.approx(1, abs=1e-6)


def test_an_orientation_turns_the_grid_and_not_the_vectors(tmp_path):
    """As a photo's mask is turned: the normals are those of the upright photo."""
    normal = _ball()[0][:, 4:]
    turned = np.rot90(np.where(normal.any(-1, keepdims=True), (normal + 1) / 2, 0))
    levels = np.round(turned * 255).astype(np.uint8)
    Image.fromarray(levels).save(tmp_path / "n.png", exif=oriented(6))
    assert normal_map.read(tmp_path / "n.png") == pytest.approx(normal, abs=0.01)


def test_alpha_cuts_out_and_does_not_darken(tmp_path):
    normal, inside = _ball()
    alpha = np.where(inside, 0.6, 0.0)[..., None]
    pixels = np.concatenate([np.where(inside[..., None], (normal + 1) / 2, 1.0), alpha], axis=-1)
    straight = {"oiio:UnassociatedAlpha": (1,)}
    found = normal_map.read(write(tmp_path / "n.png", pixels, oiio.UINT16, **straight))
    assert found == pytest.approx(normal, abs=1e-3)


@pytest.mark.parametrize(
    "spoil, mend",
    [
        (lambda n: (n + 1) / 2, "an EXR holds n itself"),
        (lambda n: 3 * n, "median is 3"),
        (lambda n: n * [1, 1, -1], "flip z"),
        (lambda n: 0 * n, "no normal"),
        (lambda n: np.where(n > 0.5, np.nan, n), "write 0 there"),
        (lambda n: np.where(n > 0.5, np.inf, n), "write 0 there"),
        (lambda n: n[..., :1], "name those of the normals"),
    ],
)
def test_what_are_no_normals_is_refused_by_name(tmp_path, spoil, mend):
    path = write(tmp_path / "spoilt.exr", spoil(_ball()[0]), oiio.FLOAT)
    with pytest.raises(ValueError, match=mend) as refused:
        normal_map.read(path)
    assert str(path) in str(refused.value)


def test_files_that_are_none_are_refused_by_name(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    lossy = write(tmp_path / "n.jpg", (_ball()[0] + 1) / 2, oiio.UINT8)
    whole = write(tmp_path / "whole.exr", _ball()[0], oiio.FLOAT)
    cut = tmp_path / "cut.exr"
    cut.write_bytes(whole.read_bytes()[:-600])
    for path in (tmp_path / "missing.exr", tmp_path / "text.png", lossy, cut):
        with pytest.raises(ValueError, match=r"check|save|anew") as refused:
            normal_map.read(path)
        assert path.name in str(refused.value)


def test_one_pixel(tmp_path):
    n = np.array([[[-0.6, 0.0, 0.8]]])
    path = write(tmp_path / "n.exr", n, oiio.HALF)
    assert normal_map.read(path) == pytest.approx(n, abs=1e-3)


def test_a_wall_has_normals_too(tmp_path):
    """All alike, and none of their values negative."""
    n = np.tile([0.48, 0.6, 0.64], (5, 7, 1))
    path = write(tmp_path / "wall.exr", n, oiio.HALF)
    assert normal_map.read(path) == pytest.approx(n, abs=1e-3)


def test_pipes_and_huge_headers_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "n.exr")
    with pytest.raises(ValueError, match=r"n\.exr cannot be read as normals, it is a pipe"):
        normal_map.read(tmp_path / "n.exr")
    for make in (lying_headers.exr, lying_headers.png):
        path = make(tmp_path / f"huge.{make.__name__}", 6000, 5000)
        with pytest.raises(ValueError, match="has 6000×5000 pixels, more than the 25 million"):
            normal_map.read(path)
        with pytest.raises(ValueError, match=path.name):
            normal_map.read(make(path, 100_000, 50_000))
