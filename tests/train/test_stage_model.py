"""Each stage trains its own subnetworks, and can."""

import dataclasses

import keras
import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import write_split

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.metrics import masked_relative_error
from lime_keras.networks import Architecture, build, subnetwork_names
from lime_keras.optics import shading
from lime_keras.optics.dynamic_range import compress, expand
from lime_keras.optics.reflectance_map import disc, true_reflectance_map
from lime_keras.train import terms
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES
from lime_keras.train.terms import TERMS

SMALL = Architecture(size=64, unet_width=6, unet_depth=3, encoder_width=8, dense_width=32)
NO_MIRROR = dataclasses.replace(SMALL, mirror=False)
REGRESSION = dataclasses.replace(SMALL, exponent="regression")
BASELINE = dataclasses.replace(SMALL, system="reflectance-map")
LIME = subnetwork_names(SMALL)
JOINT = ("specular", "mirror", "exponent", "albedo")
OF_BASELINE = (BASELINE, ("reflectance_map", "material"))
# Last stages. The full system and the one that differs most are quick.
LAST = [
    pytest.param((SMALL, JOINT), id="full"),
    pytest.param(
        (NO_MIRROR, ("specular", "exponent", "albedo")), id="no mirror", marks=pytest.mark.slow
    ),
    pytest.param((REGRESSION, JOINT), id="regression", marks=pytest.mark.slow),
    pytest.param(OF_BASELINE, id="baseline"),
]
STAGES = [(SMALL, stage.subnetworks) for stage in SCHEDULES["paper"].stages(SMALL)] + [OF_BASELINE]


@pytest.fixture(scope="module")
def four_images(tmp_path_factory):
    corpus = write_split(tmp_path_factory.mktemp("four"), "test", [range(4)])
    batches = pipeline.evaluation(Split(corpus, "test").shard_paths(), size=64, batch_size=4)
    batch = next(iter(batches))
    return batch | {"painted": tf.zeros_like(batch["mask"])}


def _compiled(names, learning_rate=2e-3, architecture=SMALL, seed=1, run_eagerly=True, **options):
    """All subnetworks, and a model of some; a graph takes longer to trace than a few steps take."""
    subnetworks = build(architecture, seed)
    model = StageModel({name: subnetworks[name] for name in names}, **options)
    model.compile(optimizer=keras.optimizers.Adam(learning_rate), run_eagerly=run_eagerly)
    return subnetworks, model


# Those of several subnetworks take half a minute each; the first of them stands for all.
@pytest.mark.parametrize(
    "architecture, names",
    [pytest.param(*stage, marks=pytest.mark.slow if len(stage[1]) > 2 else ()) for stage in STAGES],
)
def test_a_stage_moves_only_its_own_weights(architecture, names, four_images):
    subnetworks, model = _compiled(names, architecture=architecture)
    before = {name: network.get_weights() for name, network in subnetworks.items()}
    for _ in range(2):
        model.train_on_batch(four_images)
    for name, network in subnetworks.items():
        moved = [
            not np.array_equal(old, new)
            for old, new in zip(before[name], network.get_weights(), strict=True)
        ]
        if name in names:
            assert np.mean(moved) > 0.8, name
        else:
            assert not any(moved), name


def test_a_stage_learns_by_the_printed_losses_or_by_those_in_their_place_never_by_both():
    def found(losses):
        networks = build(SMALL, 1)
        return set(StageModel({n: networks[n] for n in LIME}, losses=losses).terms)

    both = found("printed") & found("robust")
    assert found("printed") - both == {
        "mask",
        "diffuse_albedo",
        "specular_albedo",
        "exponent_binary",
        "compositing_printed",
    }
    assert found("robust") - both == {
        "structure",
        "diffuse_albedo_l1",
        "specular_albedo_l1",
        "exponent",
        "compositing",
    }
    assert both == {"specular", "mirror"}


# Share of the first loss that is left after so many steps on the same four images.
OVERFIT = {
    "segmentation": (150, 0.1),
    "specular": (200, 0.35),
    "mirror": (250, 0.5),
    "albedo": (150, 0.15),
    "exponent": (100, 0.05),
    "reflectance_map": (250, 0.4),
    "material": (150, 0.15),
    "log_exponent": (100, 0.12),  # an absolute error, which shrinks by the root of its square
}


# The one that joint training has no part in stands for all.
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name == "log_exponent" else pytest.mark.slow)
        for name in OVERFIT
    ],
)
def test_a_subnetwork_overfits_four_images(name, four_images):
    if name == "log_exponent":
        _, model = _compiled(["exponent"], architecture=REGRESSION, run_eagerly=False)
    else:
        architecture = SMALL if name in LIME else BASELINE
        _, model = _compiled([name], architecture=architecture, run_eagerly=False)
    first = model.test_on_batch(four_images, return_dict=True)["loss"]
    steps, share = OVERFIT[name]
    for _ in range(steps):
        model.reset_metrics()
        loss = model.train_on_batch(four_images, return_dict=True)["loss"]
    assert loss < share * first


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_joint_training_lowers_every_term_and_no_head_dies(seed, four_images):
    """Under ℓ1 on mostly black layers, networks have died to all black within a few steps."""
    _, model = _compiled(JOINT, 1e-3, seed=seed, run_eagerly=False)
    first = model.test_on_batch(four_images, return_dict=True)
    for _ in range(60):
        model.reset_metrics()
        last = model.train_on_batch(four_images, return_dict=True)
    assert set(last) == {"loss", *model.terms}
    for term, value in last.items():
        assert value < 0.8 * first[term], term
    answer = model(four_images).raw
    inside = np.array(four_images["mask"]) >= 1
    for name in ("specular_shading", "mirror"):
        values = np.array(answer[name])[inside]
        assert values.max() > 0.1
        assert values.std() > 0.01
    for name in ("albedos", "exponent_bin_probabilities"):
        assert np.ptp(np.array(answer[name]), axis=0).max() > 0.01, f"{name}: one for all images"


def test_without_the_perceptual_loss_only_its_term_is_missing(four_images):
    _, full = _compiled(JOINT)
    _, without = _compiled(JOINT, compositing=False)
    every = full.test_on_batch(four_images, return_dict=True)
    fewer = without.test_on_batch(four_images, return_dict=True)
    assert every.pop("loss") - fewer.pop("loss") == pytest.approx(
        TERMS["compositing_printed"].weight * every.pop("compositing_printed"), rel=1e-3
    )
    assert fewer == pytest.approx(every, rel=1e-4)


def test_the_baseline_sees_the_true_map_alone_and_the_estimated_one_joined(four_images):
    subnetworks, alone = _compiled(["material"], architecture=BASELINE)
    joined = StageModel({name: subnetworks[name] for name in ("reflectance_map", "material")})
    joined.compile()
    true = compress(true_reflectance_map(four_images))
    masked = four_images["image"] * four_images["mask"]
    estimated = subnetworks["reflectance_map"](masked) * disc(64)
    for model, sphere in ((alone, true), (joined, estimated)):
        logits, albedos = subnetworks["material"](sphere)
        answer = model(four_images).raw
        np.testing.assert_allclose(answer["albedos"], albedos, atol=1e-4)
        np.testing.assert_allclose(answer["exponent_bin_probabilities"], logits, atol=1e-4)
    logs = joined.test_on_batch(four_images, return_dict=True)
    error = np.square(np.array(subnetworks["reflectance_map"](masked)) - np.array(true))
    inside = error[:, disc(64)[..., 0] > 0]
    assert logs["reflectance_map_l2"] == pytest.approx(inside.mean(), rel=1e-3)


def test_the_true_map_of_a_printed_corpus_is_that_of_its_image(four_images):
    """m_s in the paper's unit, divided by the lobe's factor, is the same material."""
    factor = shading.lobe_factor(np.array(four_images["shininess"]), "printed")
    printed = {**four_images, "specular_albedo": four_images["specular_albedo"] / factor}
    maps = [
        terms.truth("reflectance_map", batch, terms.Units(lobe))
        for batch, lobe in ((four_images, "furnace"), (printed, "printed"))
    ]
    np.testing.assert_allclose(maps[0], maps[1], rtol=1e-4)


def test_a_regressed_exponent_is_judged_by_its_logarithm(four_images):
    _, model = _compiled(["exponent"], architecture=REGRESSION)
    logs = model.test_on_batch(four_images, return_dict=True)
    found = np.array(model(four_images).raw["log_exponent"])[:, 0]
    wrong = found - np.log10(np.array(four_images["shininess"]))
    assert set(logs) == {"loss", "log_exponent_l1"}
    assert logs["log_exponent_l1"] == pytest.approx(np.mean(np.abs(wrong)), rel=1e-4)


@pytest.mark.parametrize("last", LAST)
def test_what_a_stage_reads_is_all_it_needs(last, four_images):
    architecture, names = last
    _, model = _compiled(names, architecture=architecture)
    batch, weights = {name: four_images[name] for name in model.features}, np.ones(4, np.float32)
    given = model.test_on_batch(batch, sample_weight=weights, return_dict=True)
    assert given == pytest.approx(model.test_on_batch(four_images, return_dict=True), rel=1e-5)
    assert model.measured()
    if architecture in (SMALL, NO_MIRROR):
        assert "environment" not in model.features


def test_the_loss_is_the_weighted_sum_of_its_terms(four_images):
    _, model = _compiled(JOINT)
    logs = model.test_on_batch(four_images, return_dict=True)
    total = logs.pop("loss")
    assert total == pytest.approx(
        sum(TERMS[term].weight * value for term, value in logs.items()), 1e-4
    )


def test_only_what_comes_with_weights_is_measured(four_images):
    """Training neither changes the measures nor begins them anew."""
    _, model = _compiled(["exponent"])
    weights = np.ones(4, np.float32)
    logs = model.test_on_batch(four_images, sample_weight=weights, return_dict=True)
    before = model.measured()
    assert set(before).isdisjoint(logs)
    plain = model.test_on_batch(four_images, return_dict=True)
    assert plain == pytest.approx(logs, rel=1e-6)
    trained = model.train_on_batch(four_images, return_dict=True)
    assert set(trained) == set(logs)
    assert model.measured() == before
    model.test_on_batch(four_images, sample_weight=weights)
    after = model.measured()
    assert after["log_exponent_mae"] != before["log_exponent_mae"]
    model.reset_measures()
    model.test_on_batch(four_images, sample_weight=weights)
    alone = model.measured()
    # Pooled over the batches, which here are equally many examples.
    for name, value in after.items():
        assert 2 * value == pytest.approx(before[name] + alone[name], rel=1e-4), name


def test_a_stage_is_measured_by_what_it_answers(four_images):
    subnetworks, model = _compiled(["specular", "mirror"])
    model.test_on_batch(four_images, sample_weight=np.ones(4, np.float32))
    mask = np.array(four_images["mask"])
    shading = subnetworks["specular"](four_images["image"] * mask) * mask
    mirror = subnetworks["mirror"](shading) * mask
    found = {"specular_shading": expand(np.array(shading)), "mirror": expand(np.array(mirror))}
    assert model.measured() == pytest.approx(
        {
            f"{name}_relative": masked_relative_error(np.array(four_images[name]), layer, mask)[
                0
            ].mean()
            for name, layer in found.items()
        },
        rel=1e-4,
    )


def test_a_lone_subnetwork_sees_the_truth(four_images):
    subnetworks, model = _compiled(["mirror"])
    true_shading = compress(four_images["specular_shading"]) * four_images["mask"]
    expected = subnetworks["mirror"](true_shading)
    assert np.allclose(model(four_images).raw["mirror"], expected, atol=1e-6)


def test_a_joined_subnetwork_sees_the_others_answer(four_images):
    subnetworks, model = _compiled(["specular", "mirror"])
    masked = four_images["image"] * four_images["mask"]
    shading = subnetworks["specular"](masked) * four_images["mask"]
    expected = subnetworks["mirror"](shading)
    assert np.allclose(model(four_images).raw["mirror"], expected, atol=1e-5)


EXTREMES = {
    "empty mask": {"mask": 0.0},
    "full mask": {"mask": 1.0},
    "black image": {"image": 0.0},
    "saturated image": {"image": 1.0},
    "no specular albedo": {"specular_albedo": 0.0},
    "no diffuse albedo": {"diffuse_albedo": 0.0},
    "lowest bin": {"exponent_bin": 0, "shininess": 0.0},
    "highest bin": {"exponent_bin": 7, "shininess": 1e6},
    "no light": {"environment": 0.0, "ambient": 0.0},
    "blinding light": {"environment": 65504.0},
    "blinding layers": {"specular_shading": 65504.0, "mirror": 65504.0, "diffuse_shading": 65504.0},
    "black layers": {"specular_shading": 0.0, "mirror": 0.0, "diffuse_shading": 0.0},
}
LARGEST_GRADIENT = 1e15  # adam squares gradients in float32


@pytest.fixture(scope="module", params=LAST)
def loss_and_gradients(request):
    architecture, names = request.param
    _, model = _compiled(names, architecture=architecture)

    @tf.function
    def run(batch):
        with tf.GradientTape() as tape:
            loss = model.compute_loss(x=batch, y_pred=model(batch))
        return loss, tape.gradient(loss, model.trainable_variables)

    return lambda batch: run({name: batch[name] for name in model.features})


@pytest.mark.parametrize("extreme", EXTREMES)
def test_extreme_batches_have_finite_loss_and_gradients(extreme, loss_and_gradients, four_images):
    batch = dict(four_images)
    for name, value in EXTREMES[extreme].items():
        batch[name] = tf.fill(tf.shape(batch[name]), tf.cast(value, batch[name].dtype))
    loss, gradients = loss_and_gradients(batch)
    assert np.isfinite(loss)
    for gradient in gradients:
        assert np.all(np.abs(gradient) < LARGEST_GRADIENT)


LINEAR = dataclasses.replace(SMALL, linear=True, mask_contrast=False)


def test_linear_s_and_m_are_learnt_and_read_as_radiance(four_images):
    subnetworks, model = _compiled(JOINT, architecture=LINEAR)
    answer = model(four_images)
    mask, masked = four_images["mask"], four_images["image"] * four_images["mask"]
    specular = np.maximum(subnetworks["specular"](masked), 0) * mask
    mirror = np.maximum(subnetworks["mirror"](specular), 0) * mask
    np.testing.assert_allclose(answer.seen["linear_specular_shading"], specular, atol=1e-5)
    np.testing.assert_allclose(answer.seen["specular_shading"], compress(specular), atol=1e-5)
    np.testing.assert_allclose(answer.outputs["mirror"], mirror, atol=1e-5)
    logits = subnetworks["exponent"]([specular, mirror])
    np.testing.assert_allclose(answer.raw["exponent_bin_probabilities"], logits, atol=1e-4)
    logs = model.test_on_batch(four_images, return_dict=True)
    for name in ("specular", "mirror"):
        quantity = {"specular": "specular_shading"}.get(name, name)
        error = np.abs(np.array(answer.raw[quantity]) - np.array(four_images[quantity]))
        weight = np.broadcast_to(mask, error.shape)
        each = (error * weight).sum((1, 2, 3)) / weight.sum((1, 2, 3))
        assert logs[name] == pytest.approx(each.mean(), rel=1e-4)


def test_a_subnetwork_alone_reads_the_true_radiance(four_images):
    subnetworks, model = _compiled(["mirror"], architecture=LINEAR)
    true = four_images["specular_shading"] * four_images["mask"]
    expected = subnetworks["mirror"](true)
    np.testing.assert_allclose(model(four_images).raw["mirror"], expected, atol=1e-4)
