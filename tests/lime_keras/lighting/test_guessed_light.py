"""The light from guessed normals: as bright and as varied as the photo."""

import javascript
import numpy as np
import pytest

from lime_keras.lighting import guessed_light
from lime_keras.material import Material
from lime_keras.optics import colour, environment, shading

SIZE = 64
WHOLE = Material(np.array([0.5, 0.3, 0.2]), 0.1, 60.0)


def ball():
    """Return the normals `(N, 3)` of a ball's pixels, and its mask."""
    x, y = np.meshgrid(
        (np.arange(SIZE) + 0.5) / SIZE * 2 - 1, 1 - (np.arange(SIZE) + 0.5) / SIZE * 2
    )
    square = (x**2 + y**2) / 0.8**2
    inside = square < 1
    z = np.sqrt(np.maximum(1 - square, 0))
    return np.stack([x / 0.8, y / 0.8, z], axis=-1)[inside], inside


def lamp(towards=(0.3, 0.6, 0.74), strength=30.0, ground=0.3):
    """Return a light with one lamp of 12° over an even ground."""
    cosine = environment.directions(64, 128) @ np.array(towards)
    return np.where(cosine > np.cos(np.radians(12)), strength, ground)


def seen(normal, light, material=WHOLE):
    """Return the radiance `(N, 3)` of a material, by the library's own sums."""
    view = np.tile([0.0, 0.0, 1.0], (len(normal), 1))
    texels = shading.texels(light.astype(np.float32))
    diffuse = shading.diffuse(normal, *texels)
    specular = shading.specular(normal, view, material.exponent, *texels)
    return np.outer(diffuse, material.diffuse_albedo) + material.specular_albedo * specular[:, None]


def varies(radiance):
    grey = radiance.mean(axis=-1)
    return grey.mean(), grey.std() / grey.mean()


def test_the_object_is_as_bright_and_varies_as_much_as_it_is_seen():
    """From a light that is blurred until it is dull."""
    normal, _ = ball()
    true = seen(normal, lamp())
    dull = environment.blur(lamp(), np.radians(35))
    assert varies(seen(normal, dull))[1] < 0.8 * varies(true)[1]
    found = guessed_light.with_contrast(dull, normal, true.mean(axis=-1), WHOLE)
    assert found.shape == (64, 128) and found.min() >= 0
    assert varies(seen(normal, found)) == pytest.approx(varies(true), rel=0.06)


def test_a_light_that_varies_enough_keeps_its_form():
    normal, _ = ball()
    even = np.full(len(normal), 0.2)
    found = guessed_light.with_contrast(lamp(), normal, even, WHOLE)
    ratio = found / lamp()
    assert np.ptp(ratio) < 1e-6 * ratio.max()
    assert varies(seen(normal, found))[0] == pytest.approx(0.2, rel=0.03)


@pytest.mark.parametrize("exponent", [1.0, 1000.0])
@pytest.mark.parametrize("level", [0.0, 1e-6, 1.0])
def test_extremes_are_finite(exponent, level):
    normal, _ = ball()
    material = Material(np.zeros(3), 1.0, exponent)
    for light in (np.zeros((64, 128)), np.ones((64, 128)), lamp(strength=1e6, ground=0.0)):
        found = guessed_light.with_contrast(light, normal, np.full(len(normal), level), material)
        assert np.isfinite(found).all() and found.min() >= 0
    none = np.empty((0, 3))
    found = guessed_light.with_contrast(lamp(), none, np.empty(0), material)
    np.testing.assert_array_equal(found, lamp())


def test_the_highlights_energy_is_kept():
    """A mirror image without its lamp, and the specular shading that has it."""
    normal, inside = ball()
    radiance = seen(normal, lamp())
    image = np.zeros((SIZE, SIZE, 3), np.float32)
    image[inside] = colour.linear_to_srgb(np.clip(radiance, 0, 1))
    view = np.tile([0.0, 0.0, 1.0], (len(normal), 1))
    texels = shading.texels(lamp().astype(np.float32))
    specular = np.zeros((SIZE, SIZE, 1), np.float32)
    specular[inside, 0] = shading.specular(normal, view, WHOLE.exponent, *texels)
    mask = inside[..., None].astype(np.float32)
    layers = {"mask": mask, "specular_shading": specular, "mirror": np.minimum(specular, 0.3)}
    layers["diffuse"] = np.maximum(colour.srgb_to_linear(image) - 0.1 * specular, 0) * mask
    found = guessed_light.estimate(image, Material(*_of(WHOLE), layers=layers))
    brightest = environment.directions(64, 128)[np.unravel_index(found.argmax(), found.shape)]
    assert brightest @ np.array([0.3, 0.6, 0.74]) > np.cos(np.radians(20))
    assert found.max() > 10 * np.median(found)


def _of(material):
    return material.diffuse_albedo, material.specular_albedo, material.exponent


def test_what_is_missing_is_named():
    layers = {"mask": np.ones((4, 4, 1), np.float32)}
    with pytest.raises(ValueError, match="lacks diffuse, mirror, specular_shading"):
        guessed_light.estimate(np.zeros((4, 4, 3)), Material(*_of(WHOLE), layers=layers))


def test_the_page_gives_the_same_light():
    normal, _ = ball()
    bright = seen(normal, lamp()).mean(axis=-1)
    dull = environment.blur(lamp(), np.radians(25))
    found = javascript.run(
        """
        const { withContrast } = await import(page + "browser/contrast.js");
        const material = { diffuse_albedo: diffuse, specular_albedo: 0.1, exponent: 60 };
        return [...withContrast(Float64Array.from(light), normal, [...bright], material)];
        """,
        light=dull.ravel().astype(np.float32),
        normal=normal.ravel().astype(np.float32),
        bright=bright.astype(np.float32),
        diffuse=[0.5, 0.3, 0.2],
    )
    light = dull.astype(np.float32).astype(np.float64)
    expected = guessed_light.with_contrast(light, normal, bright, WHOLE)
    np.testing.assert_allclose(np.reshape(found, (64, 128)), expected, rtol=2e-3)
