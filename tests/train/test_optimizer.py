"""Watched optimisers: their steps, the gradients' own norms, and no step that is not finite."""

import keras
import numpy as np
import pytest
import tensorflow as tf

from lime_keras.train.optimizer import LossScale, WatchedAdam, WatchedMuon, gradient_norms

SHAPES = [(3, 4), (4,), (2, 3), ()]
GROUPS = [("first", 2), ("second", 2)]


def _weights():
    rng = np.random.default_rng(0)
    return [keras.Variable(rng.normal(size=shape), name=f"w{i}") for i, shape in enumerate(SHAPES)]


def _gradients(step, broken=None, value=np.nan):
    """Of each weight; one element of the weight `broken` is `value`."""
    rng = np.random.default_rng((1, step))
    out = [np.array(rng.normal(size=shape), np.float32) for shape in SHAPES]
    if broken is not None:
        out[broken].flat[-1] = value
    return out


def _apply(optimizer, weights, gradients):
    optimizer.apply([tf.constant(gradient) for gradient in gradients], weights)


def _numbers(variables):
    return [keras.ops.convert_to_numpy(variable) for variable in variables]


def _watched(weights, **options):
    optimizer = WatchedAdam(0.01, GROUPS, **options)
    optimizer.build(weights)
    return optimizer


def test_its_steps_are_adams():
    watched, plain = _weights(), _weights()
    optimizer, adam = _watched(watched), keras.optimizers.Adam(0.01)
    for step in range(4):
        _apply(optimizer, watched, _gradients(step))
        _apply(adam, plain, _gradients(step))
    start = _numbers(_weights())
    for one, other, before in zip(_numbers(watched), _numbers(plain), start, strict=True):
        assert np.array_equal(one, other)
        assert np.all(one != before)


def test_norms_are_those_of_the_last_steps_gradients():
    weights = _weights()
    optimizer = _watched(weights)
    for step in range(2):
        gradients = _gradients(step)
        _apply(optimizer, weights, gradients)
        for name, part in {"first": gradients[:2], "second": gradients[2:]}.items():
            expected = np.linalg.norm(np.concatenate([one.ravel() for one in part]))
            assert optimizer.norms[name] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
@pytest.mark.parametrize("step", [0, 2])
def test_what_is_not_finite_is_seen_and_not_stepped_by(value, step):
    """1e30 is finite, but not when Adam squares it."""
    weights = _weights()
    optimizer = _watched(weights)
    for earlier in range(step):
        _apply(optimizer, weights, _gradients(earlier))
    before = _numbers(weights)
    _apply(optimizer, weights, _gradients(step, broken=3, value=value))
    assert not np.isfinite(optimizer.norms["second"])
    assert np.isfinite(optimizer.norms["first"])
    for one, earlier in zip(_numbers(weights), before, strict=True):
        # Adam's momentum goes on; without any there is no step.
        assert np.array_equal(one, earlier) == (step == 0)
    moments = [one for one in optimizer.variables if one.path.endswith(("_momentum", "_velocity"))]
    assert len(moments) == 2 * len(SHAPES)
    assert all(np.all(np.isfinite(one)) for one in _numbers([*weights, *moments]))


def test_after_a_held_step_it_goes_on_as_after_a_gradient_of_zero():
    held, zero = _weights(), _weights()
    optimizer, adam = _watched(held), keras.optimizers.Adam(0.01)
    nothing = [np.zeros(shape, np.float32) for shape in SHAPES]
    for step in range(4):
        _apply(optimizer, held, _gradients(step, broken=1 if step == 1 else None))
        _apply(adam, zero, nothing if step == 1 else _gradients(step))
    for one, other in zip(_numbers(held), _numbers(zero), strict=True):
        assert np.array_equal(one, other)
    assert all(np.isfinite(list(optimizer.norms.values())))


# Behind a loss scale.


def _scaled(weights, scale):
    optimizer = LossScale(WatchedAdam(0.01, GROUPS), initial_scale=scale)
    optimizer.build(weights)
    return optimizer


def test_a_loss_scale_leaves_norms_and_steps_as_they_are():
    scaled, plain = _weights(), _weights()
    optimizer, adam = _scaled(scaled, 8.0), _watched(plain)
    for step in range(3):
        _apply(optimizer, scaled, [8 * gradient for gradient in _gradients(step)])
        _apply(adam, plain, _gradients(step))
    assert gradient_norms(optimizer) == gradient_norms(adam)
    for one, other in zip(_numbers(scaled), _numbers(plain), strict=True):
        assert np.array_equal(one, other)


def test_an_overflow_halves_the_scale_and_is_no_step():
    weights = _weights()
    optimizer = _scaled(weights, 8.0)
    _apply(optimizer, weights, _gradients(0))
    before, norms = _numbers(weights), gradient_norms(optimizer)
    _apply(optimizer, weights, _gradients(1, broken=2, value=np.inf))
    assert float(optimizer.dynamic_scale) == 4.0
    assert int(optimizer.iterations) == 1
    assert gradient_norms(optimizer) == norms
    for one, earlier in zip(_numbers(weights), before, strict=True):
        assert np.array_equal(one, earlier)


@pytest.fixture(scope="module")
def half_precision():
    """A model in float16 whose loss is the mean of its answer, and its data."""
    layer = keras.layers.Dense(1, dtype="mixed_float16")
    model = keras.Sequential([keras.Input((3,)), layer])
    data = np.random.default_rng(2).uniform(1, 2, (8, 3)).astype(np.float32)
    return model, data


def _trained(model, data, optimizer, steps):
    """Weights and scale after each step, from the same beginning."""
    model.set_weights([np.ones((3, 1)), np.zeros(1)])
    model.compile(optimizer=optimizer, loss=lambda _, found: keras.ops.mean(found))
    optimizer.build(model.trainable_variables)
    out = []
    for _ in range(steps):
        loss = model.train_on_batch(data, np.zeros((len(data), 1)))
        assert np.isfinite(loss)
        out.append((model.get_weights(), float(optimizer.dynamic_scale)))
    return out


def test_a_scale_that_overflows_at_first_comes_down_and_training_begins(half_precision):
    model, data = half_precision
    # float16 ends at 65504: the gradient in the layer's answers, scale / 8, and then its sums.
    optimizer = LossScale(WatchedAdam(0.01, [("layer", 2)]), initial_scale=2.0**21)
    steps = _trained(model, data, optimizer, 12)
    scales = [scale for _, scale in steps]
    taken = [step for step, scale in enumerate(scales[1:], 1) if scale == scales[step - 1]]
    assert scales[0] == 2.0**20
    assert 3 <= taken[0] <= 8
    assert taken == list(range(taken[0], 12))
    for step, (weights, _) in enumerate(steps):
        assert all(np.all(np.isfinite(one)) for one in weights)
        assert np.array_equal(weights[0], np.ones((3, 1))) == (step < taken[0])
    # What the loss is made of by hand: the data's mean, and 1 for the bias.
    expected = np.sqrt(np.sum(data.mean(axis=0) ** 2) + 1)
    assert gradient_norms(optimizer)["layer"] == pytest.approx(expected, rel=2e-3)


def test_a_broken_example_leaves_half_precision_weights_alone(half_precision):
    model, data = half_precision
    optimizer = LossScale(WatchedAdam(0.01, [("layer", 2)]), initial_scale=64.0)
    (before, _) = _trained(model, data, optimizer, 1)[-1]
    broken = data.copy()
    broken[3, 1] = np.nan
    loss = model.train_on_batch(broken, np.zeros((len(data), 1)))
    assert np.isnan(loss)
    for one, earlier in zip(model.get_weights(), before, strict=True):
        assert np.array_equal(one, earlier)


MUON_SHAPES = [(3, 3, 3, 8), (3, 3, 8, 16), (16,), (1, 1, 16, 2), (6, 5)]


def _muon(shapes, name="all"):
    rng = np.random.default_rng(0)
    variables = [
        keras.Variable(rng.normal(size=shape), name=f"v{i}") for i, shape in enumerate(shapes)
    ]
    optimizer = WatchedMuon(0.01, [(name, len(shapes))])
    optimizer.build(variables)
    return optimizer, variables


def test_muon_moves_inner_kernels_along_orthogonal_matrices():
    """All singular values of a step are near one another; its size is 0.2 √(larger side) × rate."""
    optimizer, variables = _muon(MUON_SHAPES)
    before = _numbers(variables)
    rng = np.random.default_rng(1)
    gradients = [np.asarray(rng.normal(size=shape), np.float32) for shape in MUON_SHAPES]
    _apply(optimizer, variables, gradients)
    step = (before[1] - _numbers(variables)[1]).reshape(72, 16)
    values = np.linalg.svd(step, compute_uv=False) / (0.01 * 0.2 * np.sqrt(72))
    assert values.min() > 0.6 and values.max() < 1.3
    # A step downhill.
    assert np.sum(step * gradients[1].reshape(72, 16)) > 0


@pytest.mark.parametrize(("name", "moved"), [("all", [1]), ("mirror", [])])
def test_muon_leaves_everything_else_to_adam(name, moved):
    optimizer, variables = _muon(MUON_SHAPES, name)
    _, plain = _muon(MUON_SHAPES)
    adam = keras.optimizers.Adam(0.01)
    rng = np.random.default_rng(2)
    for _ in range(3):
        gradients = [np.asarray(rng.normal(size=shape), np.float32) for shape in MUON_SHAPES]
        _apply(optimizer, variables, gradients)
        _apply(adam, plain, gradients)
    for index, (one, other) in enumerate(zip(_numbers(variables), _numbers(plain), strict=True)):
        same = np.allclose(one, other, rtol=1e-5, atol=1e-6)
        assert same == (index not in moved), MUON_SHAPES[index]


@pytest.mark.parametrize("kind", [WatchedAdam, WatchedMuon])
def test_pretrained_layers_take_a_tenth_of_adams_step(kind):
    variables = []
    for layer in ("up1_conv", "lite0_block1_project"):
        with keras.name_scope(layer):
            variables.append(keras.Variable(np.ones((3, 3, 8, 16)), name="kernel"))
    optimizer = kind(0.01, [("segmentation", 2)])
    optimizer.build(variables)
    rng = np.random.default_rng(5)
    gradients = rng.uniform(0.5, 1.5, (2, 3, 3, 8, 16)) * rng.choice([-1, 1], (2, 3, 3, 8, 16))
    _apply(optimizer, variables, gradients.astype(np.float32))
    decoder, encoder = (np.abs(weight - 1) for weight in _numbers(variables))
    # The first step of Adam is the rate, whatever the gradient; that of Muon is not.
    np.testing.assert_allclose(encoder, 0.001, rtol=0.01)
    assert np.allclose(decoder, 0.01, rtol=0.01) == (kind is WatchedAdam)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, 1e30])
def test_muon_survives_any_gradient(value):
    """A gradient that is not finite counts as zero, and a huge one is made orthogonal."""
    optimizer, variables = _muon(MUON_SHAPES)
    gradients = [np.full(shape, value, np.float32) for shape in MUON_SHAPES]
    _apply(optimizer, variables, gradients)
    assert all(np.isfinite(weight).all() for weight in _numbers(variables))
    assert np.isfinite(list(gradient_norms(optimizer).values())).all() == (abs(value) < 1e20)
