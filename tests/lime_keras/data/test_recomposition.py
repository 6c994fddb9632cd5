"""Recomposed images: what did not change shows no change, and the background stays behind."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example

from lime_keras.data import camera, records
from lime_keras.data.recomposition import recompose
from lime_keras.optics import colour
from lime_keras.optics.compositing import compose

SIZE = 32


def scene(coverage, background=0.3):
    """A parsed sphere of even coverage before a grey background."""
    sphere = example(2, size=SIZE)
    composed = compose(
        sphere["diffuse_albedo"],
        np.float64(sphere["specular_albedo"]),
        np.float64(sphere["ambient"]),
        sphere["diffuse_shading"][None],
        sphere["specular_shading"][None],
    )[0]
    mask = sphere["mask"] * coverage
    linear = np.clip(mask * composed + (1 - mask) * background, 0, 1)
    changes = {"mask": mask, "image": colour.linear_to_srgb(linear)}
    return records.parse(records.encode(sphere | changes))


@pytest.mark.parametrize("coverage", [1.0, 0.5, 0.1])
def test_a_scene_that_did_not_change_keeps_its_image(coverage):
    stored = scene(coverage)
    image = recompose(stored, stored).numpy()
    unclipped = stored["image"].numpy() < 1
    apart = np.abs(image - stored["image"])[unclipped]
    assert unclipped.mean() > 0.5 and apart.max() <= 1.01 / 255


@pytest.mark.parametrize("coverage", [1.0, 0.5])
def test_without_light_only_the_background_and_m_a_are_left(coverage):
    stored = scene(coverage)
    black = {name: tf.zeros((SIZE, SIZE, 1)) for name in ("diffuse_shading", "specular_shading")}
    image = recompose(stored | black, stored).numpy()
    mask = stored["mask"].numpy()
    expected = mask * float(stored["ambient"]) + (1 - mask) * 0.3
    known = (mask > 0) & (stored["image"].numpy() < 1)
    apart = np.abs(image - colour.linear_to_srgb(expected))[known]
    assert known.any() and apart.max() < 4 / 255


def test_a_background_is_never_less_than_black():
    """Where the stored image is clipped, less is left than the object's own share."""
    stored = scene(0.9, background=1.0)
    bright = {"diffuse_shading": stored["diffuse_shading"] * 100}
    stored = stored | bright
    dark = stored | {"diffuse_shading": stored["diffuse_shading"] * 0}
    image = recompose(dark, stored).numpy()
    assert np.isfinite(image).all() and image.min() >= 0 and image.max() <= 1
    share = camera.objects_share(dark).numpy()
    least = colour.linear_to_srgb(np.clip(share, 0, 1)) - 0.53 / 255
    assert (image >= least).all() and least.max() > 0.1
