"""Table 1's measures against loops, scikit-learn and by hand; Keras' in any split the same."""

import keras
import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import accuracy_score, confusion_matrix, jaccard_score, mean_absolute_error

from lime_keras import metrics
from lime_keras.metrics import MaskedRelativeError, PooledIoU, WithinBins


@given(st.integers(0, 2**31))
def test_iou_counts_pixels(seed):
    rng = np.random.default_rng(seed)
    mask, predicted = rng.uniform(size=(2, 3, 4, 5, 1)) * rng.uniform(0.3, 1)
    found = metrics.overlap_ratio(*metrics.overlap(mask, predicted))
    for b in range(3):
        pairs = [(t >= 0.5, p >= 0.5) for t, p in zip(mask[b].flat, predicted[b].flat, strict=True)]
        union = sum(t or p for t, p in pairs)
        expected = sum(t and p for t, p in pairs) / union if union else 1
        assert found[b] == pytest.approx(expected)


def test_relative_error_is_compaction_and_scale_free():
    rng = np.random.default_rng(0)
    shading, predicted = rng.exponential(size=(2, 3, 4, 5, 1))
    mask = rng.uniform(size=(3, 4, 5, 1))
    mask[2] = 0
    found, lit = metrics.masked_relative_error(shading, predicted, mask)
    for b in range(2):
        chosen = mask[b] >= 0.5
        difference = np.abs(predicted[b][chosen] - shading[b][chosen])
        assert found[b] == pytest.approx(difference.sum() / shading[b][chosen].sum())
    assert found[2] == 0 and lit.tolist() == [1, 1, 0]
    scaled, _ = metrics.masked_relative_error(shading * 1e4, predicted * 1e4, mask)
    assert scaled == pytest.approx(found)


def test_tensors_are_measured_as_arrays_are():
    rng = np.random.default_rng(1)
    images = rng.uniform(size=(3, 2, 4, 5, 1)).astype(np.float32)
    images[2, 1] = 0
    tensors = list(map(tf.constant, images))
    for one, other in (
        (metrics.overlap(*images[1:]), metrics.overlap(*tensors[1:])),
        (
            metrics.overlap_ratio(*metrics.overlap(*images[1:])),
            metrics.overlap_ratio(*metrics.overlap(*tensors[1:])),
        ),
        (metrics.masked_relative_error(*images), metrics.masked_relative_error(*tensors)),
    ):
        np.testing.assert_allclose(other, one, rtol=1e-6)


@pytest.mark.parametrize("answered", [0.0, 3.0, 1e30])
def test_a_black_layer_and_an_empty_mask_do_not_count_in_the_mean(answered):
    """Neither as right, which 0 would say, nor as wrong without limit."""
    shading, mask = np.full((4, 2, 2, 1), 3.0), np.ones((4, 2, 2, 1))
    predicted = 1.5 * shading
    shading[1], mask[2], predicted[1:3] = 0, 0, answered
    error, lit = metrics.masked_relative_error(shading, predicted, mask)
    assert error.tolist() == [0.5, 0, 0, 0.5] and lit.tolist() == [1, 0, 0, 1]
    assert metrics.mean_where_lit(error.mean(), lit.mean()) == 0.5
    metric = MaskedRelativeError()
    metric.update_state(shading, predicted, mask, [1.0, 1.0, 1.0, 3.0])
    assert float(metric.result()) == 0.5
    metric.update_state(shading[1:3], predicted[1:3], mask[1:3])
    assert float(metric.result()) == 0.5


# Gathered batch by batch.


MADE = {
    "iou": PooledIoU,
    "exact": lambda: WithinBins(0),
    "within one": lambda: WithinBins(1),
    "relative error": MaskedRelativeError,
}


def _masks(rng, count):
    """Coverages, of which some are empty."""
    density = rng.uniform(0.4, 1, size=(count, 1, 1, 1)) * (
        rng.uniform(size=(count, 1, 1, 1)) < 0.8
    )
    return (density * rng.uniform(0.4, 1.6, size=(count, 4, 5, 1))).clip(0, 1)


def _arguments(kind, seed, count=7):
    """What the metric takes of random examples, each `(count, …)`."""
    rng = np.random.default_rng(seed)
    if kind == "iou":
        found = tuple(_masks(rng, count) for _ in range(2))
    elif kind == "relative error":
        found = (*rng.exponential(size=(2, count, 4, 5, 1)), _masks(rng, count))
    else:
        found = tuple(rng.integers(8, size=(2, count)))
    return [array.astype(np.float32) for array in found]


def _streamed(kind, arguments, borders=(), weights=None):
    """The metric after batches that end at these examples."""
    metric = MADE[kind]()
    ends = [*sorted(borders), len(arguments[0])]
    for start, end in zip([0, *ends], ends, strict=False):
        if end > start:
            weight = None if weights is None else weights[start:end]
            metric.update_state(*(one[start:end] for one in arguments), sample_weight=weight)
    return float(metric.result())


def _expected(kind, arguments):
    """By scikit-learn, of all examples at once."""
    if kind == "iou":
        true, found = (one.ravel() >= 0.5 for one in arguments)
        return jaccard_score(true, found, zero_division=1)
    if kind == "exact":
        return accuracy_score(*arguments)
    if kind == "within one":
        counts = confusion_matrix(*arguments, labels=range(8))
        return sum(np.trace(counts, offset) for offset in (-1, 0, 1)) / counts.sum()
    errors = []
    for true, found, mask in zip(*arguments, strict=True):
        inside = mask >= 0.5
        if inside.any():
            true, found = true[inside], found[inside]
            errors.append(mean_absolute_error(true, found) / true.mean())
    return np.mean(errors)


@pytest.mark.parametrize("kind", MADE)
@settings(max_examples=40)
@given(seed=st.integers(0, 2**31), borders=st.lists(st.integers(0, 7), max_size=4))
def test_any_split_gives_what_scikit_learn_does(kind, seed, borders):
    arguments = _arguments(kind, seed)
    found = _streamed(kind, arguments, borders)
    assert found == pytest.approx(_expected(kind, arguments), rel=1e-5, abs=1e-6)
    assert found >= 0
    if kind != "relative error":
        assert found <= 1


@pytest.mark.parametrize("kind", MADE)
def test_an_example_of_weight_one_half_twice_is_that_example(kind):
    arguments = _arguments(kind, seed=6)
    once = _streamed(kind, arguments)
    doubled = [np.concatenate([one, one[2:4]]) for one in arguments]
    weights = np.array([1, 1, 0.5, 0.5, 1, 1, 1, 0.5, 0.5], np.float32)
    assert _streamed(kind, doubled, [4, 8], weights) == pytest.approx(once, rel=1e-5)
    assert abs(_streamed(kind, doubled, [4, 8]) - once) > 1e-3


@pytest.mark.parametrize("kind", MADE)
def test_the_same_metric_is_made_from_its_config(kind):
    metric = MADE[kind]()
    again = type(metric).from_config(metric.get_config())
    arguments = _arguments(kind, seed=1)
    again.update_state(*arguments)
    assert float(again.result()) == _streamed(kind, arguments)
    assert again.name == metric.name


@pytest.mark.parametrize("kind", ["iou", "relative error"])
@pytest.mark.parametrize("dtype", [np.float16, np.float64])
def test_other_precisions_are_judged_in_single(kind, dtype):
    """Summed up in half precision the pixels would soon be too many for it."""
    arguments = [np.tile(one, (1, 40, 40, 1)) for one in _arguments(kind, seed=3)]
    converted = [one.astype(dtype) for one in arguments]
    assert _streamed(kind, converted) == pytest.approx(_expected(kind, arguments), rel=2e-3)


# Keras' by hand.


def test_pooled_iou_counts_pixels_not_images():
    full = np.ones((1, 2, 2, 1), np.float32)
    half, one = full * [[[[1.0], [0.0]]]], full * 0
    one[0, 1, 1] = 0.5
    metric = PooledIoU()
    assert float(metric.result()) == 1
    for true, found, expected in (
        (0 * full, 0 * full, 1),  # nothing, and nothing found
        (half, full, 2 / 4),
        (0 * full, one, 2 / 5),
        (full, full * 0.49, 2 / 9),
        (full, full * np.nan, 2 / 13),
    ):
        metric.update_state(true, found)
        assert float(metric.result()) == pytest.approx(expected)


def test_bins_and_their_neighbours():
    true, found = [0, 0, 0, 3, 7, 7], [0, 1, 2, 2, 6, 0]
    for distance, expected in ((0, 1 / 6), (1, 4 / 6), (2, 5 / 6), (7, 1)):
        metric = WithinBins(distance)
        metric.update_state(np.array(true, np.int32), np.array(found))
        assert float(metric.result()) == pytest.approx(expected)
        metric.update_state(np.zeros(6), np.full(6, np.nan, np.float32))
        assert float(metric.result()) == pytest.approx(expected / 2)


def test_the_metrics_work_in_any_keras_model():
    inputs = keras.Input((2, 2, 1))
    model = keras.Model(inputs, keras.layers.Identity()(inputs))
    model.compile(loss="mse", metrics=[PooledIoU()])
    rng = np.random.default_rng(0)
    seen, true = rng.uniform(size=(2, 5, 2, 2, 1)).astype(np.float32)
    found = model.evaluate(seen, true, batch_size=2, verbose=0, return_dict=True)
    assert found["pooled_iou"] == pytest.approx(_expected("iou", [true, seen]))
