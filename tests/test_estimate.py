"""From photos of every kind to materials, with untrained weights."""

import json

import keras
import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras import Estimator, Material, colour, estimate_cli, shininess, weights
from lime_keras.estimate import NEEDED
from lime_keras.networks import answers, build
from lime_keras.photo import fit_square, read_srgb, write

PHOTOS = {
    "noise": (32, 32),
    "one pixel": (1, 1),
    "wide": (40, 90),
    "tall": (90, 33),
    "a line": (1, 500),
    "a column": (500, 1),
}
LAYERS = {"mask": 1, "specular_shading": 1, "mirror": 1, "diffuse": 3}


@pytest.fixture(scope="module")
def estimator(tiny_model):
    return Estimator(tiny_model)


def photo(shape, seed=0):
    return np.random.default_rng(seed).uniform(size=(*shape, 3)).astype(np.float32)


def check(material):
    assert isinstance(material, Material)
    assert {name: layer.shape for name, layer in material.layers.items()} == {
        name: (32, 32, channels) for name, channels in LAYERS.items()
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
    assert set(numbers) == set(Material.__dataclass_fields__) - {"layers"}


@pytest.mark.parametrize("shape", PHOTOS.values(), ids=PHOTOS)
def test_photos_of_every_shape(shape, estimator):
    check(estimator.estimate(photo(shape)))


@pytest.mark.parametrize("level", [0.0, -0.0, 1e-30, 0.5, 1.0])
@pytest.mark.parametrize("shape", [(1, 1), (32, 32), (50, 20)])
def test_photos_of_one_colour(level, shape, estimator):
    check(estimator.estimate(np.full((*shape, 3), level)))


def test_double_precision_lists_and_the_same_photo_twice(estimator):
    image = photo((32, 32))
    first, again = estimator.estimate(image), estimator.estimate(image.astype(np.float64))
    assert first.to_json() == again.to_json()
    assert estimator.estimate(image.tolist()).to_json() == first.to_json()
    assert estimator.estimate(photo((32, 32), seed=1)).to_json() != first.to_json()


def test_the_numbers_are_those_of_the_network(estimator):
    image = photo((40, 90))
    square = fit_square(image, 32)
    answer = {name: np.array(v)[0] for name, v in estimator._network(square[None]).items()}
    material = estimator.estimate(image)
    np.testing.assert_allclose(material.diffuse_albedo, answer["diffuse_albedo"], rtol=1e-5)
    assert material.specular_albedo == pytest.approx(answer["specular_albedo"][0], rel=1e-5)
    probabilities = answer["exponent_bin_probabilities"]
    assert np.log10(material.exponent) == pytest.approx(probabilities @ shininess.LOG_MEANS)
    assert material.mask_coverage == pytest.approx(np.mean(answer["mask"] >= 0.5))
    for name in ("mask", "specular_shading", "mirror"):
        np.testing.assert_allclose(material.layers[name], answer[name], rtol=1e-4, atol=1e-6)
    specular = answer["specular_albedo"] * answer["specular_shading"]
    diffuse = np.maximum(colour.srgb_to_linear(square) - specular, 0) * answer["mask"]
    np.testing.assert_allclose(material.layers["diffuse"], diffuse, rtol=1e-4, atol=1e-6)
    assert 0 < diffuse.max() and np.ptp(answer["mask"]) > 0


FIELDS = {
    "mask": (set(), {"mask"}),
    "specular": (set(), {"mask", "specular_shading"}),
    "mirror": (set(), {"mask", "mirror"}),
    "albedo": ({"diffuse_albedo", "specular_albedo"}, {"mask"}),
    "exponent": ({"exponent", "exponent_bin_probabilities", "exponent_entropy"}, {"mask"}),
    "diffuse": (set(), {"mask", "diffuse"}),
}


@pytest.mark.parametrize("name", FIELDS)
def test_only_what_is_asked_for_is_run_and_answered(name, tiny_model, estimator):
    numbers, layers = FIELDS[name]
    alone = Estimator(tiny_model, [name])
    material, whole = alone.estimate(photo((32, 32))), estimator.estimate(photo((32, 32)))
    assert set(material.to_json()) == numbers | {"mask_coverage"}
    assert set(material.layers) == layers
    for layer in layers:
        np.testing.assert_allclose(material.layers[layer], whole.layers[layer], atol=1e-5)
    for number in numbers:
        found, expected = (np.asarray(getattr(m, number)) for m in (material, whole))
        np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert set(alone._network.output) == set(NEEDED[name])


def test_the_mask_alone_takes_one_subnetwork(tiny_model):
    network = Estimator(tiny_model, ["mask"])._network
    held = [layer.name for layer in network.layers if isinstance(layer, keras.Model)]
    assert held == ["segmentation_net"]


def test_an_object_that_is_not_found_is_an_answer(tiny, tmp_path):
    subnetworks = build(tiny)
    subnetworks["segmentation"].get_layer("head").bias.assign([-100.0])
    weights.save(tmp_path, tiny, subnetworks)
    material = Estimator(tmp_path).estimate(photo((32, 32)))
    check(material)
    assert material.mask_coverage == 0
    assert all((layer == 0).all() for layer in material.layers.values())


# Refusals.


@pytest.mark.parametrize(
    "shape", [(), (3,), (8, 8), (8, 8, 1), (8, 8, 4), (1, 8, 8, 3), (0, 8, 3), (8, 0, 3), (0, 0, 3)]
)
def test_a_wrong_shape_is_refused(shape, estimator):
    with pytest.raises(ValueError, match=r"shape \(H, W, 3\), got"):
        estimator.estimate(np.zeros(shape))


@pytest.mark.parametrize("value", [-1e-3, 1.001, 255, np.nan, np.inf, -np.inf])
def test_a_value_out_of_range_is_refused(value, estimator):
    image = photo((8, 8))
    image[3, 4, 1] = value
    with pytest.raises(ValueError, match=r"\[0, 1\].*255"):
        estimator.estimate(image)


def test_bytes_are_refused_with_the_remedy(estimator):
    with pytest.raises(ValueError, match="divide 8-bit ones by 255"):
        estimator.estimate((photo((8, 8)) * 255).astype(np.uint8))


@pytest.mark.parametrize("only", [[], ["normals"], ["mask", "masks"], "mask"])
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
    square = fit_square(image, 32)
    assert set(estimator._network.output) == set(answers(weights.load(ablation_model)[1]))
    answer = {name: np.array(v)[0] for name, v in estimator._network(square[None]).items()}
    material = estimator.estimate(image)
    np.testing.assert_allclose(material.diffuse_albedo, answer["diffuse_albedo"], rtol=1e-5)
    assert material.specular_albedo == pytest.approx(answer["specular_albedo"][0], rel=1e-5)
    layers = {"specular_shading", "mirror", "reflectance_map"} & set(answer)
    diffuse = {"diffuse"} & (set(NEEDED) - ABLATED[ablation.description])
    assert set(material.layers) == {"mask"} | layers | diffuse
    for name in layers:
        np.testing.assert_allclose(material.layers[name], answer[name], rtol=1e-4, atol=1e-6)
    if "reflectance_map" in layers:
        assert material.layers["reflectance_map"].shape == (32, 32, 3)
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
    for name in can:
        Estimator(ablation_model, [name])


def test_an_ablations_exponent_alone(ablation, ablation_model):
    estimator = Estimator(ablation_model, ["exponent"])
    regresses = ablation.exponent == "regression"
    output = "log_exponent" if regresses else "exponent_bin_probabilities"
    assert set(estimator._network.output) == {"mask", output}
    numbers = {"exponent"} if regresses else FIELDS["exponent"][0]
    material = estimator.estimate(photo((32, 32)))
    assert set(material.to_json()) == numbers | {"mask_coverage"}
    assert set(material.layers) == {"mask"}


# The command.


def test_the_command_writes_what_an_ablation_answers(ablation, ablation_model, tmp_path, capsys):
    write(tmp_path / "ball.png", photo((40, 90)))
    arguments = [str(tmp_path / "ball.png"), "--weights", str(ablation_model)]
    out = tmp_path / "out"
    assert estimate_cli.main([*arguments, "--out", str(out)]) == 0
    material = Estimator(ablation_model).estimate(read_srgb(tmp_path / "ball.png"))
    written = json.loads((out / "ball.json").read_text(encoding="utf-8"))
    assert written == {"photo": str(tmp_path / "ball.png")} | material.to_json()
    assert json.loads(capsys.readouterr().out) == written
    pictures = {f"ball-{name}.png" for name in material.layers}
    linear = [name for name in material.layers if name not in ("mask", "diffuse")]
    assert {path.name for path in out.iterdir()} == pictures | {"ball.json"} | {
        f"ball-{name}.exr" for name in linear
    }
    for name in linear:
        image = oiio.ImageBuf(str(out / f"ball-{name}.exr")).get_pixels(oiio.FLOAT)
        np.testing.assert_allclose(image, material.layers[name], rtol=1e-3, atol=1e-3)


def test_the_command_says_what_an_ablation_cannot(ablation, ablation_model, tmp_path, capsys):
    name = min(ABLATED[ablation.description])
    arguments = ["photo.png", "--weights", str(ablation_model), "--only", name]
    assert estimate_cli.main([*arguments, "--out", str(tmp_path / "out")]) == 1
    assert f"{ablation.description}; choose from mask" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
