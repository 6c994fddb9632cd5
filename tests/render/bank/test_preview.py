"""The preview of a bank: one page with all of it."""

import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras.render.bank import preview


def read(path):
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))[..., :3]


def test_a_page_shows_gbuffers_lights_and_textures(rendered, tmp_path):
    out = tmp_path / "sheets" / "$bank.png"
    preview.preview(rendered, out)
    page = read(out)
    heights = (2 * 134, 70, 67)  # 20 G-buffers in two rows; lights and textures in one
    assert page.shape == (48 + sum(48 + h for h in heights) + 24, preview._WIDTH, 3)
    top = 2 * 48
    for height in heights:
        row = page[top : top + height, 24:]
        assert (row < 0.99).any(axis=(0, 2))[:120].any()
        top += height + 48
    assert [path.name for path in out.parent.iterdir()] == ["$bank.png"]


def test_normals_are_colours_over_white(rendered):
    geometry = preview.GeometryBank(rendered)
    picture = preview._normals(geometry, 0)
    coverage = geometry.read(np.array([0]))["coverage"][0]
    far = np.kron(coverage == 0, np.ones((4, 4))) > 0
    assert picture.shape == (128, 128, 3) and picture.min() >= 0 and picture.max() <= 1
    assert np.median(picture[far]) == 1
    inside = np.kron(coverage == 255, np.ones((4, 4))) > 0
    assert picture[inside][:, 2].mean() > 0.55  # towards the viewer


def test_a_broken_bank_is_told_and_nothing_is_drawn(bank, tmp_path):
    (bank / "textures.npy").unlink()
    with pytest.raises(FileNotFoundError, match=r"textures\.npy is missing"):
        preview.preview(bank, tmp_path / "sheet.png")
    assert not (tmp_path / "sheet.png").exists()
