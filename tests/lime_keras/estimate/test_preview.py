"""Pictures of estimates."""

import dataclasses

import numpy as np
import pytest

from lime_keras.estimate import preview
from lime_keras.estimate.framing import Square
from lime_keras.material import Caution, Material
from lime_keras.optics import colour, shading, studio_light
from lime_keras.optics.compositing import compose
from lime_keras.optics.reflectance_map import disc


def material(diffuse, specular, exponent, **fields):
    return Material(
        diffuse_albedo=np.array(diffuse, np.float32),
        specular_albedo=specular,
        exponent=exponent,
        **fields,
    )


@pytest.mark.parametrize("exponent", [1.0, 30.0, 1000.0])
def test_the_sphere_is_eq_4_under_the_studio(exponent):
    """Against the direct sum over the light, away from where two pixels' means differ."""
    size = 32
    found = preview.sphere(material([0.5, 0.3, 0.1], 0.5, exponent), size)
    assert found.shape == (size, size, 3) and found.min() >= 0 and found.max() <= 1
    u, v = np.meshgrid(*[(2 * np.arange(size) + 1) / size - 1] * 2)
    inside = u**2 + v**2 < 0.7
    normal = np.stack([u, -v, np.sqrt(np.maximum(1 - u**2 - v**2, 0))], axis=-1)[inside]
    view = np.tile([0.0, 0.0, 1.0], (len(normal), 1))
    light = shading.texels(studio_light.light())
    lit = [shading.diffuse(normal, *light), shading.specular(normal, view, exponent, *light)]
    albedos = np.array([0.5, 0.3, 0.1]), np.array(0.5), np.array(0.0)
    expected = compose(*albedos, *(part[None, :, None, None] for part in lit))[0, :, 0]
    difference = np.abs(colour.srgb_to_linear(found[inside]) - np.clip(expected, 0, 1))
    assert difference.mean() < 0.02


def test_the_rim_is_averaged_from_twice_the_size():
    """Above, where all is lit, white only differs by the grey beside it."""
    size = 24
    white = preview.sphere(material([1e6, 1e6, 1e6], 0.0, 1.0), size)
    found = colour.srgb_to_linear(white)[..., 0]
    covered = disc(2 * size).reshape(size, 2, size, 2).mean((1, 3))
    expected = covered + (1 - covered) * found[0, 0]
    np.testing.assert_allclose(found[: size // 2], expected[: size // 2], atol=1e-4)
    assert len(np.unique(covered)) > 3


def test_the_sphere_lies_on_grey():
    found = preview.sphere(material([1.0, 0.0, 0.0], 0.0, 1.0), 16)
    assert np.ptp(found[0, 0]) < 1e-6 and found[8, 5, 0] > found[8, 5, 1]


@pytest.mark.parametrize("fields", [{}, {"exponent": 3.0}, {"diffuse_albedo": np.zeros(3)}])
def test_half_a_material_has_no_sphere(fields):
    with pytest.raises(ValueError, match="whole material"):
        preview.sphere(Material(**fields), 16)


def blob(size=64):
    mask = np.zeros((size, size, 1), np.float32)
    mask[size // 4 : 3 * size // 4, size // 4 : 3 * size // 4] = 1
    return mask


def layered(**fields):
    """Return a whole material with all layers, each of one colour."""
    mask = blob()
    grey, colours = 0.25 * mask, 0.5 * mask * np.array([0.9, 0.5, 0.2], np.float32)
    layers = {"mask": mask, "specular_shading": grey, "mirror": grey, "diffuse": colours}
    return material([0.5, 0.3, 0.1], 0.1, 50.0, layers=layers | {"recomposed": colours}, **fields)


def test_all_parts_are_shown_on_a_page_for_a_small_screen():
    """Six tiles in two rows of three, none reaching over the page's edge or another."""
    photo = np.random.default_rng(0).uniform(size=(64, 64, 3)).astype(np.float32)
    whole = layered(mask_coverage=0.25)
    shown = preview.tiles(photo, whole)
    assert list(shown)[:2] == ["photo and mask", "in a studio"] and len(shown) == 6
    page = preview.sheet(photo, whole)
    assert page.shape[1] == 1000
    for (left, top), tile in zip(map(preview.place, range(6)), shown.values(), strict=True):
        assert np.abs(page[top : top + 320, left : left + 320] - tile).max() < 0.005
    only = preview.sheet(photo, Material(layers={"mask": blob()}))
    assert only.shape[1] == 1000 and len(only) < len(page) - 300


def test_the_sphere_has_room_around_it():
    tile = preview.tiles(np.zeros((64, 64, 3), np.float32), layered())["in a studio"]
    assert tile.shape == (320, 320, 3)
    border = np.concatenate([tile[:10].ravel(), tile[-10:].ravel(), tile[:, :10].ravel()])
    assert np.ptp(border) < 1e-6


def test_beyond_the_photo_there_is_the_page():
    """A photo twice as wide as high: a quarter of each tile above, and one below."""
    photo = np.random.default_rng(0).uniform(size=(40, 80, 3)).astype(np.float32)
    mask = np.ones((40, 80, 1), np.float32)
    layers = {"mask": mask, "mirror": 0 * mask}
    for tile in preview.tiles(photo, Material(layers=layers)).values():
        paper = np.array(preview._PAPER) / 255
        assert np.abs(tile[:78] - paper).max() < 0.005 and np.abs(tile[-78:] - paper).max() < 0.005
        assert np.abs(tile[84:-84] - paper).max() > 0.5


def test_warnings_stand_below_the_numbers():
    photo, plain = np.zeros((64, 64, 3), np.float32), Material(layers={"mask": blob()})
    long = "a sentence that is too long for one line of a page, whose mend is told with it " * 3
    told = dataclasses.replace(plain, warnings=(Caution("a", "short"), Caution("b", long)))
    before, after = preview.sheet(photo, plain), preview.sheet(photo, told)
    numbers = len(before) - preview._MARGIN
    np.testing.assert_array_equal(after[:numbers], before[:numbers])
    lines = (len(after) - len(before)) // 20
    assert lines >= 3 and len(after) == len(before) + 20 * lines
    reddish = after[numbers:, :, 0] - after[numbers:, :, 2] > 0.3
    for line in range(lines):
        assert reddish[20 * line : 20 * line + 20].any()
    assert not reddish[:, -10:].any() and not reddish[:, :10].any()


def test_a_warning_longer_than_the_page_keeps_its_words():
    for text in ("", "word", "many words " * 30, "w" * 300):
        lines = [line[2:] for line in preview._lines(text)]
        assert " ".join(lines) == text.strip()


def test_the_mask_is_outlined():
    tile = preview.tiles(np.zeros((64, 64, 3), np.float32), Material(layers={"mask": blob()}))
    red = tile["photo and mask"][..., 0] > 0.5
    rows, columns = np.nonzero(red)
    assert abs(rows.min() - 80) <= 2 and abs(rows.max() - 239) <= 2
    assert abs(columns.min() - 80) <= 2 and abs(columns.max() - 239) <= 2
    assert not red[125:190, 125:190].any()


def test_the_caption_leaves_out_what_is_not_known():
    assert preview.caption({}) == [] and preview.caption({"mask_coverage": 0.0}) == ["no object"]
    whole = material([0.1, 0.2, 0.3], 0.5, 123.4, mask_coverage=0.5)
    words, first = "rather glossy (81 %)    #597c95", "m_d 0.10 0.20 0.30    m_s 0.50    s 123"
    assert preview.caption(whole.to_json()) == [words, first, "covers 50.0%"]
    found = dataclasses.replace(
        whole, mask_confidence=0.914, exponent_bin_probabilities=np.full(8, 0.125)
    )
    first = "m_d 0.10 0.20 0.30    m_s 0.50    s 123 (2.0 to 501)"
    third = "covers 50.0%    mask confidence 0.91"
    assert preview.caption(found.to_json()) == [words, first, third]


def test_a_square_beyond_the_photo_is_black():
    """A poor network may find its object in the repeated edge of a narrow photo alone."""
    tile = preview._crop(np.ones((60, 300, 3)), Square(-100, 0, 50), is_photo=True)
    assert tile.shape == (preview.TILE, preview.TILE, 3) and not tile.any()
