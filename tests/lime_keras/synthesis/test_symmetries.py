"""Turned G-buffers against turned decoded normals and view directions."""

import numpy as np
import pytest

from lime_keras.data.mirrored import flip
from lime_keras.optics import octahedral
from lime_keras.optics.shading import view_directions
from lime_keras.synthesis.symmetries import SYMMETRIES, turned

SIZE = 6
EVERY = range(SYMMETRIES)


def gbuffers(count=1):
    rng = np.random.default_rng(0)
    shape = (count, SIZE, SIZE)
    normal = rng.normal(size=(count, 2, SIZE, SIZE, 3))  # behind as well: the folded codes
    normal[:, 0, 0] = (1, 0, 0)
    normal[:, 0, 1] = (0, -1, 0)
    normal[:, 0, 2] = (0, 0, 1)
    coverage = rng.integers(0, 256, shape).astype(np.uint8)
    coverage[:, 2, :3] = 0
    share = rng.integers(1, 256, shape).astype(np.uint8)
    share[:, 4] = 255
    codes = octahedral.encode(normal)
    codes[:, 0][coverage == 0] = 0
    codes[:, 1][(coverage == 0) | (share == 255)] = 0
    return {
        "coverage": coverage,
        "share": share,
        "normal": codes,
        "spread": rng.integers(0, 16, (count, 2, SIZE, SIZE)).astype(np.uint8),
        "camera": rng.uniform(2, 9, (count, 4)).astype(np.float32),
    }


def turned_image(image, bits):
    image = image.swapaxes(0, 1) if bits & 4 else image
    image = image[:, ::-1] if bits & 1 else image
    return image[::-1] if bits & 2 else image


def matrix(bits):
    """What a symmetry makes of directions in camera space."""
    out = np.eye(3)
    if bits & 4:
        out = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, 1]]) @ out
    if bits & 1:
        out = np.diag([-1, 1, 1]) @ out
    return np.diag([1, -1, 1]) @ out if bits & 2 else out


@pytest.mark.parametrize("bits", EVERY)
def test_pixels_normals_and_rays_turn_together(bits):
    whole = gbuffers()
    found = turned(whole, np.array([bits]))
    for name in ("coverage", "share"):
        np.testing.assert_array_equal(found[name][0], turned_image(whole[name][0], bits))
    there = found["coverage"][0] > 0, (found["coverage"][0] > 0) & (found["share"][0] < 255)
    for surface, seen in enumerate(there):
        before, after = whole["normal"][0, surface], found["normal"][0, surface]
        expected = turned_image(octahedral.decode(before), bits) @ matrix(bits).T
        np.testing.assert_allclose(octahedral.decode(after)[seen], expected[seen], atol=2e-6)
        assert not after[~seen].any() and seen.any()
        spread = whole["spread"][0, surface]
        np.testing.assert_array_equal(found["spread"][0, surface], turned_image(spread, bits))
    view = view_directions(whole["camera"][0], SIZE, SIZE)
    np.testing.assert_allclose(
        view_directions(found["camera"][0], SIZE, SIZE),
        turned_image(view, bits) @ matrix(bits).T,
        atol=1e-6,
    )


def test_every_scene_has_its_own_symmetry():
    whole = gbuffers(SYMMETRIES)
    together = turned(whole, np.arange(SYMMETRIES))
    for bits in EVERY:
        one = turned(
            {name: value[bits : bits + 1] for name, value in whole.items()}, np.array([bits])
        )
        for name, value in one.items():
            np.testing.assert_array_equal(together[name][bits], value[0])
            assert value.dtype == whole[name].dtype


def test_the_eight_differ_and_the_first_is_none():
    whole = {name: value.repeat(SYMMETRIES, axis=0) for name, value in gbuffers().items()}
    found = turned(whole, np.arange(SYMMETRIES))
    assert len({image.tobytes() for image in found["coverage"]}) == SYMMETRIES
    for name, value in whole.items():
        np.testing.assert_array_equal(found[name][0], value[0])


def test_left_and_right_are_exchanged_as_in_corpora():
    whole = gbuffers()
    found = turned(whole, np.array([1]))
    covered = whole["coverage"][0, ..., None] > 0
    scene = {
        "mask": whole["coverage"][0, ..., None],
        "normal": (octahedral.decode(whole["normal"][0, 0]) * covered).astype(np.float32),
        "camera": whole["camera"][0],
    }
    expected = flip(scene)
    np.testing.assert_array_equal(found["coverage"][0, ..., None], expected["mask"])
    np.testing.assert_allclose(found["camera"][0], expected["camera"], rtol=1e-6)
    normal = octahedral.decode(found["normal"][0, 0]) * (found["coverage"][0, ..., None] > 0)
    np.testing.assert_allclose(normal, expected["normal"], atol=2e-6)


def test_the_given_arrays_stay():
    whole = gbuffers()
    before = {name: value.copy() for name, value in whole.items()}
    turned(whole, np.array([7]))
    for name, value in before.items():
        np.testing.assert_array_equal(whole[name], value)
