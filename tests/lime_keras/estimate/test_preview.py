"""Pictures of estimates."""

import dataclasses

import numpy as np
import pytest

from lime_keras import Estimator
from lime_keras.estimate import preview
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


def test_all_layers_are_shown(tiny_model):
    photo = np.random.default_rng(0).uniform(size=(40, 90, 3)).astype(np.float32)
    found = preview.sheet(photo, Estimator(tiny_model).estimate(photo))
    assert found.shape[1] == 6 * 256 + 7 * 12
    only = preview.sheet(photo, Estimator(tiny_model, ["mask"]).estimate(photo))
    assert only.shape[1] == 256 + 2 * 12


def test_warnings_stand_below_the_numbers():
    mask = np.zeros((64, 64, 1), np.float32)
    mask[16:48, 16:48] = 1
    photo, plain = np.zeros((64, 64, 3), np.float32), Material(layers={"mask": mask})
    long = "a sentence that is too long for one line of so narrow a page, with its mend"
    told = dataclasses.replace(plain, warnings=(Caution("a", "short"), Caution("b", long)))
    before, after = preview.sheet(photo, plain), preview.sheet(photo, told)
    numbers = 2 * 24 + 256
    np.testing.assert_array_equal(after[:numbers], before[:numbers])
    lines = (len(after) - len(before)) // 20
    assert lines >= 3 and len(after) == len(before) + 20 * lines
    reddish = after[numbers:, :, 0] - after[numbers:, :, 2] > 0.3
    for line in range(lines):
        assert reddish[8 + 20 * line : 28 + 20 * line].any()
    assert not reddish[:, -12:].any() and not reddish[:, :12].any()


def test_a_warning_longer_than_the_page_keeps_its_words():
    for text in ("", "word", "many words " * 30, "w" * 300):
        lines = [line for _, line in preview._lines(text, 200)]
        assert " ".join(lines) == text.strip()


def test_the_mask_is_outlined():
    mask = np.zeros((64, 64, 1), np.float32)
    mask[16:48, 16:48] = 1
    found = preview.sheet(np.zeros((64, 64, 3), np.float32), Material(layers={"mask": mask}))
    tile = found[24 : 24 + 256, 12 : 12 + 256]
    red = tile[..., 0] > 0.5
    rows, columns = np.nonzero(red)
    assert abs(rows.min() - 64) <= 2 and abs(rows.max() - 191) <= 2
    assert abs(columns.min() - 64) <= 2 and abs(columns.max() - 191) <= 2
    assert not red[100:150, 100:150].any()


def test_the_caption_leaves_out_what_is_not_known():
    assert preview.caption(Material(mask_coverage=0.25)) == "covers 25%"
    whole = material([0.1, 0.2, 0.3], 0.5, 123.4, exponent_entropy=1.0, mask_coverage=0.5)
    expected = "m_d 0.10 0.20 0.30    m_s 0.50    s 123    entropy 1.0 of 3 bits    covers 50%"
    assert preview.caption(whole) == expected
    found = dataclasses.replace(whole, mask_confidence=0.914)
    assert preview.caption(found) == f"{expected}    mask confidence 0.91"
