"""What a written model is shown, and what it is refused for."""

import numpy as np
import pytest

from lime_keras.export import parity


@pytest.mark.parametrize("size", [32, 64])
def test_the_images_are_photos_and_extremes(size):
    images = parity.images(size)
    assert images.shape == (8, size, size, 3) and images.dtype == np.float32
    assert images.min() == 0 and images.max() == 1
    np.testing.assert_array_equal(images, parity.images(size))
    smooth, noisy = (np.abs(np.diff(image, axis=0)).mean() for image in images[2:4])
    assert 0 < smooth < noisy
    black, white, colour, lit = images[4:]
    assert black.max() == 0 and white.min() == 1
    assert np.ptp(colour, axis=(0, 1)).max() == 0 and len(set(colour[0, 0])) == 3
    assert np.unique(lit.sum(axis=-1), return_counts=True)[1].tolist() == [size * size - 1, 1]


def test_answers_to_all_images_come_from_batches_of_one_and_of_several():
    images = np.arange(12.0).reshape(6, 2)
    batches = []

    class Doubling:
        outputs = ("doubled",)

        def run(self, outputs, given):
            batches.append(len(given["image"]))
            return {name: 2 * given["image"] for name in outputs}

    engine = Doubling()
    np.testing.assert_array_equal(parity.predictions(engine, images)["doubled"], 2 * images)
    assert batches == [1, 4, 1]
    assert len(parity.predictions(engine, images[:1])["doubled"]) == 1


class Cutting:
    """Engine whose M is 1 in each pixel that the mask takes in, and whose mask leaves out all."""

    outputs = ("mask", "mirror")

    def run(self, outputs, inputs):
        mask = np.zeros_like(inputs["image"])
        mirror = (inputs.get("mask", mask) > 0).astype(float)
        return {name: {"mask": mask, "mirror": mirror}[name] for name in outputs}


def test_a_pixel_more_in_the_mask_by_rounding_is_no_difference_of_the_other_outputs():
    images, one_more = np.zeros((3, 4)), np.zeros((3, 4))
    one_more[1, 2] = 1e-6
    predicted = {"mask": one_more, "mirror": (one_more > 0).astype(float)}
    compared = Cutting(), images, ("mask", "mirror"), predicted
    assert parity.check_against(*compared, "float32") == {"mask": 1e-6, "mirror": 0}
    with pytest.raises(parity.ParityError, match=r"differs from Keras.*mirror"):
        parity.check_against(*compared, "float16")
    with pytest.raises(parity.ParityError, match="outputs"):
        parity.check_against(Cutting(), images, ("mirror",), predicted, "float32")


def test_differences_are_relative_above_one():
    expected = {"mirror": np.array([0.5, 100.0]), "mask": np.array([0.0])}
    found = {"mirror": np.array([0.5004, 100.01]), "mask": np.array([-0.0005])}
    differences = parity.check(expected, found, "float32")
    assert differences == pytest.approx({"mirror": 4e-4, "mask": 5e-4})


EXPECTED = {"mask": np.array([0.0, 1.0]), "mirror": np.array([3.0, 1.0])}


@pytest.mark.parametrize(("precision", "limit"), [("float32", 1e-3), *parity.GROSS.items()])
def test_what_is_within_the_limit_is_told_and_what_is_beyond_is_refused(precision, limit):
    """The mask's mean is 0.5: an error of one value is, on average, as large relative to it."""
    for error in (0.9 * limit, -0.9 * limit):
        found = EXPECTED | {"mask": np.array([error, 1.0])}
        differences = parity.check(EXPECTED, found, precision)
        assert differences == pytest.approx({"mask": abs(error), "mirror": 0})
    for error in (1.1 * limit, -1.1 * limit):
        found = EXPECTED | {"mask": np.array([error, 1.0])}
        with pytest.raises(parity.ParityError, match=f"differs from Keras.*mask.*in {precision}"):
            parity.check(EXPECTED, found, precision)


@pytest.mark.parametrize("precision", ["float32", *parity.GROSS])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(precision, value):
    with pytest.raises(parity.ParityError, match="not finite"):
        parity.check(EXPECTED, EXPECTED | {"mirror": np.array([value, 1.0])}, precision)


@pytest.mark.parametrize("precision", ["float32", *parity.GROSS])
@pytest.mark.parametrize(
    "found",
    [
        {"mask": EXPECTED["mask"]},
        EXPECTED | {"normal": EXPECTED["mask"]},
        EXPECTED | {"mask": EXPECTED["mask"][None]},
    ],
    ids=["a missing output", "another output", "another shape"],
)
def test_other_names_or_shapes_are_refused(precision, found):
    with pytest.raises(parity.ParityError, match="outputs"):
        parity.check(EXPECTED, found, precision)
