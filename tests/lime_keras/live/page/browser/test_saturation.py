"""The albedo of the page is as saturated as Python's."""

import javascript
import numpy as np
import pytest

from lime_keras.optics import colour, dichromatic

ALBEDO = np.array([0.4, 0.32, 0.26])


def picture(of, seed=0):
    rng = np.random.default_rng(seed)
    shade = rng.uniform(0.1, 0.9, (24, 24, 1))
    mask = (rng.uniform(size=(24, 24, 1)) < 0.8).astype(np.float32)
    return colour.linear_to_srgb(shade * np.array(of)).astype(np.float32), mask


@pytest.mark.parametrize("of", [(0.5, 0.2, 0.05), (0.3, 0.29, 0.27), (0.4, 0.25, 0.18)])
def test_it_is_that_of_python(of):
    image, mask = picture(of)
    found = javascript.run(
        'return (await import(page + "browser/saturation.js")).raised(albedo, seen, mask);',
        albedo=ALBEDO.tolist(),
        seen=image.ravel(),
        mask=mask.ravel(),
    )
    expected = dichromatic.with_saturation_of_pixels(ALBEDO, image, mask)
    assert found == pytest.approx(expected, rel=1e-4)
