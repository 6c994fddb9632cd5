"""Relighting: identities, signs, scikit-image's PSNR, and how many pixels it takes."""

import numpy as np
import pytest
import sphere_corpus
from skimage.metrics import peak_signal_noise_ratio

from lime_keras.eval.accuracy import relighting
from lime_keras.eval.accuracy.relighting import HIGHEST_PSNR, Lit
from lime_keras.optics import colour, shading
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.compositing import compose


@pytest.fixture(scope="module")
def example():
    return sphere_corpus.example(3)


def _true(example, **changes):
    parts = {
        "diffuse_albedo": example["diffuse_albedo"],
        "specular_albedo": example["specular_albedo"],
        "exponent": example["shininess"],
    }
    return BlinnPhong(**(parts | changes))


def test_the_true_material_relights_perfectly_under_any_light(example):
    assert relighting.relight(example, [_true(example)]) == [[HIGHEST_PSNR, HIGHEST_PSNR]]


def test_each_part_of_the_material_counts_and_more_is_worse(example):
    worse = [
        _true(example, diffuse_albedo=example["diffuse_albedo"] * 0.8),
        _true(example, diffuse_albedo=example["diffuse_albedo"] * 0.4),
        _true(example, specular_albedo=0.5 + 0.5 * example["specular_albedo"]),
        _true(example, exponent=example["shininess"] * 5),
    ]
    found = np.array(relighting.relight(example, worse))
    assert (found < HIGHEST_PSNR - 5).all()
    assert (found[1] < found[0]).all()


def test_the_photo_is_eq_4_of_the_reference_shading(example):
    radiance = example["environment"][..., 0]
    inside = example["mask"][..., 0] >= 1
    view = shading.view_directions(example["camera"], *inside.shape)[inside]
    light = shading.texels(radiance.astype(np.float64))
    n = example["normal"][inside].astype(np.float64)
    diffuse = shading.diffuse(n, *light)
    specular = shading.specular(n, view, 30.0, *light)
    composed = compose(
        np.array([0.2, 0.5, 0.7]),
        np.asarray(0.4),
        np.asarray(example["ambient"]),
        diffuse[None, :, None, None],
        specular[None, :, None, None],
    )[0, :, 0]
    expected = colour.linear_to_srgb(np.clip(composed, 0, 1))
    chosen = np.linspace(0, len(n) - 1, relighting.PIXELS).round().astype(int)
    found = Lit(example, radiance).photo(BlinnPhong(np.array([0.2, 0.5, 0.7]), 0.4, 30.0))
    assert found.shape == (relighting.PIXELS, 3)
    assert found == pytest.approx(expected[chosen], abs=2e-4)


def test_with_the_printed_lobe_the_same_material_has_another_m_s(example):
    furnace = _true(example, exponent=40.0)
    factor = shading.lobe_factor(40.0, "printed")
    printed = BlinnPhong(furnace.diffuse_albedo, furnace.specular_albedo / factor, 40.0)
    radiance = example["environment"][..., 0]
    expected = Lit(example, radiance).photo(furnace)
    assert Lit(example, radiance, "printed").photo(printed) == pytest.approx(expected, abs=1e-5)


def test_psnr_is_scikit_images_below_the_ceiling():
    rng = np.random.default_rng(0)
    true, found = rng.uniform(size=(2, 100, 3))
    expected = peak_signal_noise_ratio(true, found, data_range=1.0)
    assert relighting.psnr(true, found) == pytest.approx(expected)
    assert relighting.psnr(true, true) == HIGHEST_PSNR
    rounded = np.round(true * 255) / 255
    assert relighting.psnr(true, rounded) == pytest.approx(HIGHEST_PSNR, abs=0.5)


def test_without_an_object_there_is_nothing_to_see(example):
    empty = example | {"mask": np.zeros_like(example["mask"])}
    assert relighting.relight(empty, [relighting.AVERAGE])[0][0] == HIGHEST_PSNR


@pytest.mark.parametrize("exponent", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("strength", [0.0, 1e-8, 65504.0])
def test_extremes_stay_finite(example, exponent, strength):
    extreme = example | {"environment": example["environment"] * strength}
    assert np.isfinite(relighting.relight(extreme, [_true(example, exponent=exponent)])).all()


def test_an_object_without_a_whole_pixel_is_relit_by_the_partly_covered_ones(example):
    thin = example | {"mask": np.minimum(example["mask"], np.float32(0.9))}
    assert relighting.relight(thin, [relighting.AVERAGE])[0][0] < HIGHEST_PSNR - 5
