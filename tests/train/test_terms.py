"""What a stage is judged by is what `lime-eval` judges: each measure against the NumPy ones."""

import keras
import numpy as np
import pytest
import tensorflow as tf
from scipy.special import softmax
from sklearn.metrics import mean_absolute_error

from lime_keras import metrics
from lime_keras.networks.registry import OUTPUT_ROWS, QUANTITIES
from lime_keras.optics import shininess
from lime_keras.optics.dynamic_range import HIGHEST_COMPRESSED, compress
from lime_keras.train import terms

COUNT, SIZE = 40, 6
EXPONENT = {"exponent_exact", "exponent_within_one", "log_exponent_mae"}
ALBEDOS = {"diffuse_albedo_mae", "specular_albedo_mae"}
LIME = ("segmentation", "specular", "mirror", "exponent", "albedo")
MEASURED = {
    "segmentation": {"mask_iou_pooled"},
    "specular": {"specular_shading_relative"},
    "mirror": {"mirror_relative"},
    "exponent": EXPONENT,
    "albedo": ALBEDOS,
    "reflectance_map": set(),
    "material": EXPONENT | ALBEDOS,
}


def _batch(rng):
    mask = rng.uniform(size=(COUNT, SIZE, SIZE, 1))
    mask[3] = 0
    shininess_ = 10.0 ** rng.uniform(-0.2, 3.2, size=COUNT)
    batch = {
        "mask": mask,
        "specular_shading": rng.exponential(size=(COUNT, SIZE, SIZE, 1)),
        "mirror": rng.exponential(5, size=(COUNT, SIZE, SIZE, 1)),
        "shininess": shininess_,
        "diffuse_albedo": rng.uniform(size=(COUNT, 3)),
        "specular_albedo": rng.uniform(size=COUNT),
    }
    batch = {name: value.astype(np.float32) for name, value in batch.items()}
    return batch | {"exponent_bin": shininess.bin_of(shininess_)}


def _answer(rng, regresses=False):
    layers = {
        name: rng.normal(0.5, 0.7, size=(COUNT, SIZE, SIZE, 1))
        for name in ("mask", "specular_shading", "mirror")
    }
    if regresses:
        exponent = rng.uniform(-0.5, 3.5, size=(COUNT, 1))
    else:
        exponent = rng.normal(0, 3, size=(COUNT, 8))
    quantity = "log_exponent" if regresses else "exponent_bin_probabilities"
    found = layers | {quantity: exponent, "albedos": rng.normal(0.5, 0.4, size=(COUNT, 4))}
    return {name: value.astype(np.float32) for name, value in found.items()}


def _outputs(batch, answer):
    """As the stage's graph reads them from its subnetworks' answers."""
    return {
        name: row.read(
            QUANTITIES[row.quantity].from_prediction(answer[row.quantity], batch.__getitem__)
        )
        for name, row in OUTPUT_ROWS.items()
        if row.quantity in answer
    }


def _update(found, batch, answer, weights):
    terms.update(found, batch, _outputs(batch, answer), weights)


def _measured(batch, answer, borders=(), weights=None, update=_update):
    """After batches that end at these examples."""
    if weights is None:
        weights = np.ones(COUNT, np.float32)
    found = terms.metrics_of(LIME)
    for rows in np.split(np.arange(COUNT), borders):
        parts = (
            {name: tf.constant(value[rows]) for name, value in of.items()} for of in (batch, answer)
        )
        update(found, *parts, tf.constant(weights[rows]))
    return {name: float(metric.result()) for name, metric in found.items()}


def _expected(batch, answer):
    """From the evaluation's measures of all examples at once, in double precision."""
    batch, answer = (
        {name: value.astype(np.float64) for name, value in of.items()} for of in (batch, answer)
    )
    mask = batch["mask"]
    albedos = np.clip(answer["albedos"], 0, 1)
    intersection, union = metrics.overlap(mask, answer["mask"])
    limited = np.maximum(batch["shininess"], 1)
    if "log_exponent" in answer:
        log = np.clip(answer["log_exponent"][:, 0], 0, 3)
        winning = shininess.bin_of(10**log)
    else:
        probabilities = softmax(answer["exponent_bin_probabilities"], axis=-1)
        log = probabilities @ shininess.LOG_MEANS
        winning = np.argmax(probabilities, axis=-1)
    distance = np.abs(winning - shininess.bin_of(limited))
    layers = {}
    for name in ("specular_shading", "mirror"):
        found = np.expm1(np.clip(answer[name] * mask, 0, HIGHEST_COMPRESSED))
        error, lit = metrics.masked_relative_error(batch[name], found, mask)
        layers[f"{name}_relative"] = error.sum() / lit.sum()
    specular = batch["specular_albedo"][:, None]
    return layers | {
        "mask_iou_pooled": intersection.sum() / union.sum(),
        "exponent_exact": np.mean(distance == 0),
        "exponent_within_one": np.mean(distance <= 1),
        "log_exponent_mae": mean_absolute_error(np.log10(limited), log),
        "diffuse_albedo_mae": mean_absolute_error(batch["diffuse_albedo"], albedos[:, :3]),
        "specular_albedo_mae": mean_absolute_error(specular, albedos[:, 3:]),
    }


@pytest.mark.parametrize("regresses", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_in_any_split_the_measures_are_the_evaluations(regresses, seed):
    rng = np.random.default_rng(seed)
    batch, answer = _batch(rng), _answer(rng, regresses)
    expected = _expected(batch, answer)
    for borders in ([], [16, 32], range(1, COUNT), [1, 2, 39]):
        found = _measured(batch, answer, borders)
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)
        # Nothing here is right or wrong by being one number.
        assert all(0 < value for value in found.values())


@pytest.mark.parametrize("jit_compile", [False, True])
def test_compiled_they_are_the_same(jit_compile):
    rng = np.random.default_rng(0)
    batch, answer = _batch(rng), _answer(rng)
    compiled = None

    def update(found, *arguments):
        nonlocal compiled
        compiled = compiled or tf.function(
            lambda *given: _update(found, *given), jit_compile=jit_compile
        )
        compiled(*arguments)

    assert _measured(batch, answer, [4], update=update) == pytest.approx(
        _expected(batch, answer), rel=1e-5
    )


@pytest.mark.parametrize("name", ["exponent_exact", "exponent_within_one"])
def test_a_bin_that_is_no_number_is_wrong(name):
    outputs = {"log_exponent": tf.constant([[np.nan], [1.5]])}
    right, _ = terms.MEASURES[name].of_examples({"exponent_bin": tf.constant([4, 4])}, outputs)
    assert right.numpy().tolist() == [False, True]


def test_weights_count():
    rng = np.random.default_rng(0)
    batch, answer = _batch(rng), _answer(rng)
    weights = np.ones(COUNT, np.float32)
    weights[6:] = 0
    kept = [{name: value[:6] for name, value in of.items()} for of in (batch, answer)]
    assert _measured(batch, answer, [2, 7], weights) == pytest.approx(_expected(*kept), rel=1e-5)


def test_the_truth_is_measured_as_right():
    batch = _batch(np.random.default_rng(0))
    batch["shininess"] = np.minimum(batch["shininess"], 1000)
    for name in ("specular_shading", "mirror"):
        batch[name][batch["mask"] < 0.5] = 0
    batch["mask"] = np.round(batch["mask"])
    truth = {
        "mask": batch["mask"],
        "specular_shading": compress(batch["specular_shading"]),
        "mirror": compress(batch["mirror"]),
        "log_exponent": np.log10(np.maximum(batch["shininess"], 1))[:, None],
        "albedos": np.concatenate(
            [batch["diffuse_albedo"], batch["specular_albedo"][:, None]], axis=-1
        ),
    }
    found = _measured(batch, truth, [4])
    shares = {"mask_iou_pooled", "exponent_exact", "exponent_within_one"}
    assert found == pytest.approx({name: float(name in shares) for name in found}, abs=1e-5)
    assert all(found[name] == 1 for name in shares)


EXTREMES = {
    "empty masks": {"mask": 0.0},
    "full masks": {"mask": 1.0},
    "blinding layers": {"specular_shading": 65504.0, "mirror": 65504.0},
    "black layers": {"specular_shading": 0.0, "mirror": 0.0},
    "no exponent": {"shininess": 0.0, "exponent_bin": 0},
    "huge exponents": {"shininess": 1e6, "exponent_bin": 7},
}


@pytest.mark.parametrize("extreme", EXTREMES)
@pytest.mark.parametrize("said", [-1e30, -1e4, 0.0, 1e4, 1e30])
@pytest.mark.parametrize("regresses", [False, True])
def test_measures_are_finite_and_in_range_at_the_extremes(extreme, said, regresses):
    rng = np.random.default_rng(0)
    batch, answer = _batch(rng), _answer(rng, regresses)
    for name, value in EXTREMES[extreme].items():
        batch[name] = np.full_like(batch[name], value)
    answer = {name: np.full_like(value, said) for name, value in answer.items()}
    found = _measured(batch, answer)
    assert all(np.isfinite(value) and value >= 0 for value in found.values()), found
    for name in ("mask_iou_pooled", "exponent_exact", "exponent_within_one", *ALBEDOS):
        assert found[name] <= 1, name
    if extreme == "empty masks":
        assert found["mask_iou_pooled"] == (said <= 0)
        assert found["specular_shading_relative"] == found["mirror_relative"] == 0


@pytest.mark.parametrize("part", MEASURED)
def test_a_subnetwork_is_judged_by_what_it_answers(part):
    found = terms.metrics_of([part])
    assert set(found) == MEASURED[part]
    assert all(metric.name == name for name, metric in found.items())
    assert all(isinstance(metric, keras.metrics.Metric) for metric in found.values())
