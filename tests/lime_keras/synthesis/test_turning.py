"""Turned G-buffers against turned decoded normals and view directions."""

import numpy as np
import pytest

from lime_keras.data.flip import flip
from lime_keras.optics import octahedral
from lime_keras.optics.shading import view_directions
from lime_keras.synthesis.turning import SYMMETRIES, turned

SIZE = 6
EVERY = range(SYMMETRIES)


def gbuffers(count=1):
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(count, 2, SIZE, SIZE, 3))
    normal[..., :2, 2] *= -1  # behind as well: the folded half of the codes
    coverage = rng.integers(0, 256, (count, SIZE, SIZE)).astype(np.uint8)
    coverage[:, 2, :3] = 0
    there = np.repeat((coverage > 0)[:, None], 2, axis=1)
    there[:, 1, :, 4:] = False
    codes = octahedral.encode(normal) * there[..., None].astype(np.uint16)
    return {
        "coverage": coverage,
        "share": rng.integers(1, 256, coverage.shape).astype(np.uint8),
        "normal": codes,
        "spread": rng.integers(0, 16, there.shape).astype(np.uint8),
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
    for surface in (0, 1):
        codes, before = found["normal"][0, surface], whole["normal"][0, surface]
        there = turned_image(before.any(axis=-1), bits)
        expected = turned_image(octahedral.decode(before), bits) @ matrix(bits).T
        np.testing.assert_allclose(octahedral.decode(codes)[there], expected[there], atol=2e-6)
        assert not codes[~there].any()
        spread = turned_image(whole["spread"][0, surface], bits)
        np.testing.assert_array_equal(found["spread"][0, surface], spread)
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
