"""The light and the guessed normals are Python's, in JavaScript."""

import javascript
import numpy as np
import pytest

from lime_keras.lighting import guessed_normals, illumination
from lime_keras.optics import shading

SIZE = 48
ROWS, COLUMNS = np.mgrid[:SIZE, :SIZE]
DISC = (ROWS - 22) ** 2 + (COLUMNS - 26) ** 2 < 17**2
INSIDE = {
    "a disc": DISC,
    "a frame": DISC & ~((abs(ROWS - 18) < 6) & (abs(COLUMNS - 24) < 5)),
    "specks": np.random.default_rng(1).uniform(size=(SIZE, SIZE)) < 0.1,
    "all": np.ones((SIZE, SIZE), bool),
    "a pixel": (ROWS == 20) & (COLUMNS == 20),
    "nothing": np.zeros((SIZE, SIZE), bool),
}
CAMERA = [90.0, 90.0, 17.0, 30.0]


def coverage(inside):
    rng = np.random.default_rng(0)
    mask = np.where(inside, rng.uniform(0.5, 1, inside.shape), rng.uniform(0, 0.49, inside.shape))
    return mask.astype(np.float32)


# Wider than the grid on which the dome is solved; not square.
V, U = np.mgrid[:101, :260]
LARGE = (((V - 50) / 45) ** 2 + ((U - 140) / 110) ** 2 < 1).astype(np.float32)


@pytest.mark.parametrize("mask", [*map(coverage, INSIDE.values()), LARGE], ids=[*INSIDE, "large"])
def test_normals_are_those_of_python(mask):
    found = javascript.run(
        'return (await import(page + "browser/normals.js")).normals(mask, ...shape);',
        mask=mask,
        shape=mask.shape,
    )
    expected = guessed_normals.normals(mask[..., None])
    np.testing.assert_allclose(found.reshape(*mask.shape, 3), expected, atol=1e-6)


@pytest.mark.parametrize("known", ["both", "M", "D", "one lamp"])
@pytest.mark.parametrize("inside", list(INSIDE.values())[:-1], ids=list(INSIDE)[:-1])
def test_the_light_is_that_of_python(inside, known):
    rng = np.random.default_rng(2)
    mask = coverage(inside)
    mirror = rng.gamma(0.5, 1, mask.shape).astype(np.float32)
    diffuse = rng.uniform(size=mask.shape).astype(np.float32)
    if known == "M":
        diffuse[:] = np.nan
    elif known == "D":
        mirror[:] = np.nan
    elif known == "one lamp":
        mirror[:] = 0
        mirror.flat[np.flatnonzero(inside)[0]] = 5e4
    found = javascript.run(
        """
        const { normals } = await import(page + "browser/normals.js");
        const { estimated } = await import(page + "browser/light.js");
        return estimated(normals(mask, 48, 48), mirror, diffuse, mask, 48, camera);
        """,
        mask=mask,
        mirror=mirror,
        diffuse=diffuse,
        camera=CAMERA,
    )
    normal = guessed_normals.normals(mask[..., None])
    view = shading.view_directions(np.array(CAMERA), SIZE, SIZE)
    seen = np.where(mask >= 0.5, mask, 0)[..., None]
    evidence = illumination.observe(normal, view, mirror[..., None], diffuse[..., None], seen)
    expected = illumination.estimate(evidence)
    # Python sums the cosines of D in single precision.
    atol = 1e-5 * max(1, expected.max())
    np.testing.assert_allclose(found.reshape(64, 128), expected, rtol=1e-4, atol=atol)


def test_no_pixel_shows_no_light():
    nothing = np.zeros((SIZE, SIZE), np.float32)
    found = javascript.run(
        """
        const { estimated } = await import(page + "browser/light.js");
        return estimated(new Float64Array(3 * 48 * 48), mask, mask, mask, 48, camera);
        """,
        mask=nothing,
        camera=CAMERA,
    )
    assert found is None
