"""From photos of every kind to materials, with untrained weights."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from lime_keras import Estimator, Material
from lime_keras.estimate import cautions, framing
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.model.folder import ENGINES
from lime_keras.networks import assemble, build
from lime_keras.optics import colour, highlights, shininess
from lime_keras.outputs import NEEDED

PHOTOS = {
    "noise": (32, 32),
    "one pixel": (1, 1),
    "wide": (40, 90),
    "tall": (90, 33),
    "a line": (1, 500),
    "a column": (500, 1),
}
LAYERS = {"mask": 1, "specular_shading": 1, "mirror": 1, "diffuse": 3, "recomposed": 3}


@pytest.fixture(scope="module", params=ENGINES)
def estimator(request, tiny_model):
    return Estimator(tiny_model, engine=request.param)


def photo(shape, seed=0):
    return np.random.default_rng(seed).uniform(size=(*shape, 3)).astype(np.float32)


def network_answer(model, image):
    """What the joined network says of a photo's whole square, its largest object being large."""
    _, subnetworks = weights.load(model)
    square = framing.cut(image, framing.whole(*image.shape[:2]), 32)[None]
    return {name: np.array(value)[0] for name, value in assemble(subnetworks)(square).items()}


def check(material, shape):
    assert isinstance(material, Material)
    assert {name: layer.shape for name, layer in material.layers.items()} == {
        name: (*shape, channels) for name, channels in LAYERS.items()
    }
    for layer in material.layers.values():
        assert np.isfinite(layer).all() and (layer >= 0).all()
    assert material.layers["mask"].max() <= 1
    assert material.diffuse_albedo.shape == (3,)
    assert ((material.diffuse_albedo >= 0) & (material.diffuse_albedo <= 1)).all()
    assert 0 <= material.specular_albedo <= 1 and 0 <= material.mask_coverage <= 1
    assert 10 ** shininess.LOG_MEANS[0] <= material.exponent <= 10 ** shininess.LOG_MEANS[-1]
    assert material.exponent_bin_probabilities.sum() == pytest.approx(1, rel=1e-5)
    assert 0 <= material.exponent_entropy <= 3.0001
    numbers = json.loads(json.dumps(material.to_json(), allow_nan=False))
    derived = {
        *("exponent_interval", "gloss", "glossy_probability", "roughness", "diffuse_srgb_hex")
    }
    assert (
        set(numbers)
        == set(Material.__dataclass_fields__) - {"layers", "gloss_calibration", "image_srgb"}
        | derived
    )
    assert 0.5 <= material.mask_confidence <= 1


@pytest.mark.parametrize("shape", PHOTOS.values(), ids=PHOTOS)
def test_photos_of_every_shape(shape, estimator):
    check(estimator.estimate(photo(shape)), shape)


@pytest.mark.parametrize("level", [0.0, -0.0, 1e-30, 0.5, 1.0])
@pytest.mark.parametrize("shape", [(1, 1), (32, 32), (50, 20)])
def test_photos_of_one_colour(level, shape, estimator):
    check(estimator.estimate(np.full((*shape, 3), level)), shape)


def test_double_precision_lists_and_the_same_photo_twice(estimator):
    image = photo((32, 32))
    first, again = estimator.estimate(image), estimator.estimate(image.astype(np.float64))
    assert first.to_json() == again.to_json()
    assert estimator.estimate(image.tolist()).to_json() == first.to_json()
    assert estimator.estimate(photo((32, 32), seed=1)).to_json() != first.to_json()


def test_the_numbers_are_those_of_the_network(tiny_model, estimator):
    image = photo((40, 90))
    answer, square = network_answer(tiny_model, image), framing.whole(40, 90)
    material = estimator.estimate(image)
    assert material.square == square
    np.testing.assert_allclose(material.diffuse_albedo, answer["diffuse_albedo"], rtol=1e-5)
    assert material.specular_albedo == pytest.approx(answer["specular_albedo"][0], rel=1e-5)
    probabilities = answer["exponent_bin_probabilities"]
    assert np.log10(material.exponent) == pytest.approx(probabilities @ shininess.LOG_MEANS)
    for name in ("mask", "specular_shading", "mirror"):
        expected = framing.paste(answer[name], square, 40, 90)
        np.testing.assert_allclose(material.layers[name], expected, rtol=1e-4, atol=1e-6)
    mask, shading = material.layers["mask"], material.layers["specular_shading"]
    assert material.mask_coverage == pytest.approx(np.mean(mask >= 0.5))
    specular = answer["specular_albedo"] * shading
    seen = colour.srgb_to_linear(image)
    diffuse, found = np.maximum(seen - specular, 0) * mask, material.layers["diffuse"]
    hidden = highlights.hidden(image, specular) & (mask[..., 0] >= 0.5)
    np.testing.assert_allclose(found[~hidden], diffuse[~hidden], rtol=1e-4, atol=1e-6)
    assert 0 < diffuse.max() and np.ptp(mask) > 0
    # Where a highlight hides the diffuse part, it is as around, and never more than is seen.
    assert hidden.any() and (found <= seen * mask + 1e-6).all()
    assert found[hidden].mean() > diffuse[hidden].mean()
    diffuse = found
    # Least squares, the long way: the grey shade that leaves the smallest difference.
    albedo = answer["diffuse_albedo"][:, None]
    shade = np.linalg.lstsq(albedo, diffuse.reshape(-1, 3).T, rcond=None)[0].reshape(40, 90, 1)
    expected = shade * albedo[:, 0] + specular * mask
    np.testing.assert_allclose(material.layers["recomposed"], expected, rtol=1e-3, atol=1e-5)


def test_a_black_material_is_recomposed_as_its_highlights(tiny, tmp_path):
    subnetworks = build(tiny)
    subnetworks["segmentation"].get_layer("head").bias.assign([0.8])
    albedos = subnetworks["albedo"].get_layer("albedos")
    albedos.bias.assign([-100.0, -100.0, -100.0, 0.5])
    weights.save(tmp_path, tiny, subnetworks)
    material = Estimator(tmp_path, engine="keras").estimate(photo((20, 32)))
    assert (material.diffuse_albedo == 0).all()
    lobe = material.specular_albedo * material.layers["specular_shading"]
    expected = np.repeat(lobe * material.layers["mask"], 3, axis=-1)
    np.testing.assert_allclose(material.layers["recomposed"], expected, atol=1e-6)


def test_a_photo_may_be_a_path_a_pil_image_bytes_or_floats(estimator, tmp_path):
    levels = np.random.default_rng(0).integers(0, 256, (40, 90, 3), np.uint8)
    image = Image.fromarray(levels)
    image.save(tmp_path / "photo.png")
    forms = [tmp_path / "photo.png", str(tmp_path / "photo.png"), image, levels, levels / 255.0]
    expected = estimator.estimate(levels / np.float32(255))
    for material in estimator.estimate_many(forms):
        np.testing.assert_allclose(material.diffuse_albedo, expected.diffuse_albedo, rtol=1e-4)
        assert material.square == expected.square
    mask = np.zeros((40, 90), np.uint8)
    mask[5:30, 20:60] = 255
    cut_out = Image.fromarray(np.dstack([levels, mask]))
    cut_out.save(tmp_path / "cut.png")
    forms = [(tmp_path / "cut.png", None), (cut_out, None), (image, mask), (levels, mask > 0)]
    forms += [(tmp_path / "photo.png", Image.fromarray(mask)), (levels, mask / 255)]
    for form, its_mask in forms:
        found = estimator.estimate(form, its_mask).layers["mask"]
        np.testing.assert_array_equal(found[..., 0], mask / np.float32(255))


# Where the object is.


class Finder:
    """An engine whose SegmentationNet finds all that is red."""

    def __init__(self, engine):
        self.looks, self.size, self._engine = 0, engine.size, engine

    def run(self, outputs, given):
        if "mask" in given:
            return self._engine.run(outputs, given)
        images = given["image"]
        self.looks += len(images)
        return {"mask": (images[..., :1] - images[..., 1:2] > 0.4).astype(np.float32)}


def red_square(height, width, rows, columns):
    image = np.full((height, width, 3), 0.3, np.float32)
    image[rows, columns] = [0.9, 0.1, 0.1]
    return image


@pytest.fixture
def finder(estimator, monkeypatch):
    stand_in = Finder(estimator._engine)
    monkeypatch.setattr(estimator, "_engine", stand_in)
    return stand_in


@pytest.mark.parametrize("full_size", [False, True])
def test_no_mask_exceeds_one(full_size):
    """Interpolation rounds, and `--normals` refuses a mask above 1."""
    rows, columns = np.mgrid[:192, :192]
    disc = (np.hypot(rows - 96, columns - 96) < 70).astype(np.float32)[..., None]
    image = np.random.default_rng(0).uniform(0, 1, (192, 192, 3)).astype(np.float32)
    highest = []
    for side in (105, 128, 137, 161):
        square, photo = framing.Square(0, 0, side), image[:side, :side]
        view = SimpleNamespace(
            supplied_mask=None, photo=photo, square=square, image=image, mask=disc
        )
        placed = Estimator._place_mask(SimpleNamespace(_full_size=full_size), view)
        highest.append(framing.paste(disc, square, side, side).max())
        assert 0.9 < placed.max() <= 1
    assert max(highest) > 1


def test_a_small_object_is_looked_at_again_from_near(estimator, finder):
    image = red_square(200, 300, slice(20, 60), slice(240, 280))
    material = estimator.estimate(image)
    assert finder.looks == 2
    top, left, side = material.square
    assert side == pytest.approx(40 / framing.FILL, rel=0.35)
    assert top <= 20 and top + side >= 60 and left <= 240 and left + side >= 280
    found = material.layers["mask"][..., 0] >= 0.5
    truth = image[..., 0] > 0.5
    assert (found & truth).sum() / (found | truth).sum() > 0.9
    assert (material.layers["mirror"][:, :200] == 0).all()


def test_a_large_object_is_looked_at_once(estimator, finder):
    material = estimator.estimate(red_square(200, 300, slice(20, 180), slice(70, 230)))
    assert finder.looks == 1 and material.square == framing.whole(200, 300)


def test_a_given_mask_is_not_looked_for(estimator, finder, tiny_model):
    image = photo((60, 80))
    mask = np.zeros((60, 80), np.float32)
    mask[10:40, 30:60] = 1
    material = estimator.estimate(image, mask)
    assert finder.looks == 0
    np.testing.assert_array_equal(material.layers["mask"][..., 0], mask)
    assert material.mask_coverage == pytest.approx(900 / 4800)
    assert (material.layers["specular_shading"][mask == 0] < 0.5).all()
    again = estimator.estimate(image, mask[..., None])
    assert again.to_json() == material.to_json()
    # What is outside the mask's square has no influence.
    changed = image.copy()
    changed[:, 75:] = 1 - changed[:, 75:]
    assert estimator.estimate(changed, mask).to_json() == material.to_json()


def test_an_empty_mask_is_an_answer(estimator):
    check_nothing(estimator.estimate(photo((20, 30)), np.zeros((20, 30))), (20, 30))


def check_nothing(material, shape):
    """Nothing is estimated where no object was found, and the reason is told."""
    assert material.mask_coverage == 0 and material.whole() is None
    assert set(material.to_json()) == {"mask_coverage", "square", "warnings"}
    assert {name: layer.shape for name, layer in material.layers.items()} == {"mask": (*shape, 1)}
    assert material.warnings == (cautions.NO_OBJECT,)


@pytest.mark.parametrize("shape", [(), (20,), (30, 20), (20, 30, 3), (1, 20, 30)])
def test_a_mask_of_another_shape_is_refused(shape, estimator):
    with pytest.raises(ValueError, match=r"a mask has its photo's shape.*got"):
        estimator.estimate(photo((20, 30)), np.zeros(shape))


@pytest.mark.parametrize("value", [-0.1, 1.1, 255, np.nan, np.inf])
def test_a_mask_out_of_range_is_refused(value, estimator):
    with pytest.raises(ValueError, match="a mask's values"):
        estimator.estimate(photo((20, 30)), np.full((20, 30), value))


@pytest.mark.parametrize("shape", [(40, 90), (90, 33), (32, 32)])
@pytest.mark.parametrize("masked", [False, True])
def test_its_two_halves_give_the_same_numbers_with_layers_in_the_square(shape, masked, estimator):
    image, mask = photo(shape), np.zeros((*shape, 1), np.float32)
    mask[8:24, 5:30] = 1
    given = mask if masked else None
    expected, view = estimator.estimate(image, given), estimator.view(image, given)
    found = estimator.read(view)
    assert found.square == expected.square == view.square
    assert found.diffuse_albedo == pytest.approx(expected.diffuse_albedo, abs=1e-6)
    assert found.exponent == pytest.approx(expected.exponent)
    assert found.mask_coverage == pytest.approx(expected.mask_coverage, abs=0.03)
    assert found.mask_confidence == pytest.approx(expected.mask_confidence)
    assert found.warnings == () and estimator.place(view, found).warnings == expected.warnings
    for name, layer in found.layers.items():
        assert layer.shape == (32, 32, LAYERS[name])
    pasted = framing.paste(found.layers["specular_shading"], view.square, *shape)
    assert pasted == pytest.approx(expected.layers["specular_shading"], abs=1e-5)


def test_a_views_coverage_is_a_share_of_the_photo(estimator):
    mask = np.zeros((40, 90, 1), np.float32)
    mask[10:30, :20] = 1
    assert estimator.view(photo((40, 90)), mask).coverage == pytest.approx(400 / 3600, rel=0.1)
    assert estimator.view(photo((40, 90)), np.ones((40, 90))).coverage == pytest.approx(1, abs=0.05)
    assert estimator.view(photo((40, 90)), np.zeros((40, 90))).coverage == 0


def test_several_photos_are_answered_as_one_by_one(estimator):
    images = [photo((40, 90)), photo((33, 20), seed=1), photo((32, 32), seed=2)]
    masks = [None, np.ones((33, 20)), None]
    together = list(estimator.estimate_many(images, masks))
    for image, mask, material in zip(images, masks, together, strict=True):
        assert material.to_json() == estimator.estimate(image, mask).to_json()
    assert list(estimator.estimate_many([])) == []
    with pytest.raises(ValueError, match="3 photos with 1 masks"):
        next(estimator.estimate_many(images, [None]))


ALWAYS = {"mask_coverage", "mask_confidence", "square", "warnings"}
FIELDS = {
    "mask": (set(), {"mask"}),
    "specular": (set(), {"mask", "specular_shading"}),
    "mirror": (set(), {"mask", "mirror"}),
    "albedo": ({"diffuse_albedo", "specular_albedo", "diffuse_srgb_hex"}, {"mask"}),
    "exponent": (
        {"exponent", "exponent_bin_probabilities", "exponent_entropy"}
        | {"exponent_interval", "gloss", "glossy_probability", "roughness"},
        {"mask"},
    ),
    "diffuse": (set(), {"mask", "diffuse", "recomposed"}),
}


@pytest.fixture(scope="module", params=FIELDS)
def alone(request, tiny_model):
    """What may be asked for alone, and what answers it."""
    return request.param, Estimator(tiny_model, [request.param])


def test_only_what_is_asked_for_is_opened_run_and_answered(alone, estimator):
    name, alone = alone
    numbers, layers = FIELDS[name]
    material, whole = alone.estimate(photo((32, 32))), estimator.estimate(photo((32, 32)))
    assert set(material.to_json()) == numbers | ALWAYS
    assert set(material.layers) == layers
    for layer in layers:
        np.testing.assert_allclose(material.layers[layer], whole.layers[layer], atol=1e-5)
    for number in numbers - {"gloss", "diffuse_srgb_hex"}:
        found, expected = (np.asarray(getattr(m, number)) for m in (material, whole))
        np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert alone.subnetworks == RUN[name] and set(alone._engine._sessions) == set(RUN[name])


RUN = {
    "mask": ("segmentation",),
    "specular": ("segmentation", "specular"),
    "mirror": ("segmentation", "specular", "mirror"),
    "albedo": ("segmentation", "specular", "albedo"),
    "exponent": ("segmentation", "specular", "mirror", "exponent"),
    "diffuse": ("segmentation", "specular", "albedo"),
}


def test_a_given_mask_leaves_segmentation_unopened(tiny_model):
    estimator = Estimator(tiny_model, ["albedo"])
    assert not estimator._engine._sessions
    estimator.estimate(photo((32, 32)), np.ones((32, 32)))
    assert set(estimator._engine._sessions) == {"specular", "albedo"}


def test_an_object_that_is_not_found_is_an_answer(tiny, tmp_path):
    subnetworks = build(tiny)
    subnetworks["segmentation"].get_layer("head").bias.assign([-100.0])
    weights.save(tmp_path, tiny, subnetworks)
    material = Estimator(tmp_path, engine="keras").estimate(photo((32, 32)))
    check_nothing(material, (32, 32))
    assert (material.layers["mask"] == 0).all()


def test_a_masker_takes_the_place_of_segmentation(tiny_model):
    """Its mask is the given one, but may be doubted."""
    mask = np.zeros((60, 80), np.float32)
    mask[10:40, 30:60] = 0.9
    seen = []

    def masker(image):
        seen.append(image)
        return mask

    alone = Estimator(tiny_model, masker=masker)
    image, square = photo((60, 80)), np.ones((60, 80))
    found, told = alone.estimate_many([image, image], [None, square])
    assert len(seen) == 1 and seen[0].dtype == np.float32
    np.testing.assert_array_equal(found.layers["mask"][..., 0], mask)
    assert found.mask_confidence == pytest.approx(0.9) and told.mask_confidence is None
    expected = Estimator(tiny_model).estimate(image, mask)
    np.testing.assert_allclose(found.diffuse_albedo, expected.diffuse_albedo, rtol=1e-4)
    assert found.square == expected.square and expected.mask_confidence is None
    assert "segmentation" not in {*alone.subnetworks, *alone._engine._sessions}
    with pytest.raises(ValueError, match="a mask has its photo's shape"):
        Estimator(tiny_model, masker=lambda image: mask[:5]).estimate(image)
    nothing = Estimator(tiny_model, masker=lambda image: 0.49 * np.ones((60, 80)))
    check_nothing(nothing.estimate(image), (60, 80))


# Refusals.


@pytest.mark.parametrize(
    "shape",
    [
        *((), (3,), (8, 8), (8, 8, 1), (8, 8, 4), (3, 8, 8), (1, 8, 8, 3)),
        *((0, 8, 3), (8, 0, 3), (0, 0, 3)),
    ],
)
def test_a_wrong_shape_is_refused(shape, estimator):
    with pytest.raises(ValueError, match=r"\(H, W, 3\), got .* grey channel .* as the mask"):
        estimator.estimate(np.zeros(shape))


@pytest.mark.parametrize("value", [-1e-3, 1.001, 255, np.nan, np.inf, -np.inf])
def test_a_value_out_of_range_is_refused(value, estimator):
    image = photo((8, 8))
    image[3, 4, 1] = value
    with pytest.raises(ValueError, match=r"\[0, 1\].*255"):
        estimator.estimate(image)


def test_answers_that_are_not_finite_are_refused(tiny_model, monkeypatch):
    estimator = Estimator(tiny_model)
    answer = estimator._engine.run

    def broken(outputs, given):
        found = answer(outputs, given)
        return found | {name: np.full_like(found[name], np.nan) for name in found if name != "mask"}

    monkeypatch.setattr(estimator._engine, "run", broken)
    with pytest.raises(ValueError, match="with NaN or infinity: its weights are damaged"):
        estimator.estimate(photo((40, 40)))


@pytest.mark.parametrize("only", [[], ["normals"], ["mask", "masks"]])
def test_unknown_names_and_none_are_refused(only, tiny_model):
    with pytest.raises(ValueError, match="choose from mask, specular"):
        Estimator(tiny_model, only)


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-train"):
        Estimator(tmp_path)


# The ablations.

ABLATED = {
    "LIME without MirrorNet": {"mirror", "reflectance_map"},
    "LIME with its exponent by regression": {"reflectance_map"},
    "the reflectance-map baseline": {"specular", "mirror", "diffuse"},
}
"""What each cannot estimate."""


def test_an_ablation_estimates_all_that_it_can(ablation, ablation_model):
    estimator = Estimator(ablation_model)
    image = photo((40, 90))
    answer = network_answer(ablation_model, image)
    assert {"mask", *estimator._outputs} == set(answer)
    material = estimator.estimate(image)
    np.testing.assert_allclose(material.diffuse_albedo, answer["diffuse_albedo"], rtol=1e-5)
    assert material.specular_albedo == pytest.approx(answer["specular_albedo"][0], rel=1e-5)
    layers = {"specular_shading", "mirror", "reflectance_map"} & set(answer)
    diffuse = {"diffuse"} & (set(NEEDED) - ABLATED[ablation.description])
    diffuse |= {"recomposed"} if diffuse else set()
    assert set(material.layers) == {"mask"} | layers | diffuse
    for name in layers - {"reflectance_map"}:
        expected = framing.paste(answer[name], framing.whole(40, 90), 40, 90)
        np.testing.assert_allclose(material.layers[name], expected, rtol=1e-4, atol=1e-6)
    if "reflectance_map" in layers:
        found = material.layers["reflectance_map"]
        np.testing.assert_allclose(found, answer["reflectance_map"], rtol=1e-4, atol=1e-6)
    written = material.to_json()
    if ablation.exponent == "regression":
        assert np.log10(material.exponent) == pytest.approx(answer["log_exponent"][0], rel=1e-5)
        assert material.exponent_bin_probabilities is None and material.exponent_entropy is None
        assert not {"exponent_bin_probabilities", "exponent_entropy"} & set(written)
    else:
        probabilities = answer["exponent_bin_probabilities"]
        assert np.log10(material.exponent) == pytest.approx(probabilities @ shininess.LOG_MEANS)
        assert written["exponent_entropy"] > 0
    assert json.loads(json.dumps(written, allow_nan=False))["exponent"] >= 1


def test_what_an_ablation_cannot_estimate_is_refused(ablation, ablation_model):
    lacking = ABLATED[ablation.description]
    can = [name for name in NEEDED if name not in lacking]
    for name in lacking:
        with pytest.raises(ValueError) as refusal:
            Estimator(ablation_model, ["mask", name])
        told = str(refusal.value)
        assert told.startswith(f"cannot estimate ['{name}']: {ablation_model} holds")
        assert told.endswith(f"{ablation.description}; choose from {', '.join(can)}")
    Estimator(ablation_model, can)


def test_an_ablations_exponent_alone(ablation, ablation_model):
    estimator = Estimator(ablation_model, ["exponent"])
    regresses = ablation.exponent == "regression"
    output = "log_exponent" if regresses else "exponent_bin_probabilities"
    assert estimator._outputs == [output]
    numbers = {n for n in FIELDS["exponent"][0] if not (regresses and n.startswith("exponent_"))}
    material = estimator.estimate(photo((32, 32)))
    assert set(material.to_json()) == numbers | ALWAYS
    assert set(material.layers) == {"mask"}


def test_a_model_in_the_printed_unit_says_so(tmp_path):
    shutil.copytree(model_folder.PRETRAINED / "nano", tmp_path / "nano")
    (tmp_path / "nano" / "model" / "training.json").write_text('{"config": {"lobe": "printed"}}')
    photo = np.full((70, 70, 3), 90, np.uint8)
    mask = np.ones((70, 70), bool)
    estimator = Estimator(tmp_path / "nano", only=["albedo"])
    found = estimator.estimate(photo, mask).warnings
    assert found[-1] == cautions.PRINTED_LOBE
    assert estimator.doubts(estimator.view(photo, mask))[-1] == cautions.PRINTED_LOBE
    shipped = Estimator("nano", only=["albedo"]).estimate(photo, mask).warnings
    assert shipped == found[:-1]
