"""A run begins with the weights of a model, whatever form that has."""

from dataclasses import replace

import numpy as np
import pytest

from lime_keras.model import weights
from lime_keras.networks import build
from lime_keras.train import initial_weights


@pytest.mark.parametrize("form", ["run", "graphs"])
def test_a_run_begins_with_the_weights_of_a_run_or_a_set(form, tiny, tiny_model, sets, tmp_path):
    architecture, subnetworks = weights.load(tiny_model)
    given = sets("nano") / "nano" if form == "graphs" else tmp_path / "given"
    if form == "run":
        weights.save(given / "model", architecture, subnetworks)
    begun = build(tiny, seed=5)
    assert initial_weights.load(given, begun) == list(subnetworks)
    for name, network in subnetworks.items():
        pairs = zip(begun[name].get_weights(), network.get_weights(), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs), name


def test_an_encoder_begins_with_weights_of_another_image_size(tiny, tmp_path):
    small = build(tiny, seed=3)
    large = build(replace(tiny, size=2 * tiny.size), seed=5)
    weights.save(tmp_path / "given" / "model", tiny, small)
    assert set(initial_weights.load(tmp_path / "given", large)) == set(small)
    # The sum over the cells is what an even image sees.
    kernels = [
        next(w for w in nets["albedo"].weights if w.path.endswith("dense1/kernel")).numpy()
        for nets in (small, large)
    ]
    cells = [net["albedo"].get_layer("flatten").input.shape[1:] for net in (small, large)]
    sums = [
        kernel.reshape(-1, shape[-1], kernel.shape[1]).sum(0)
        for kernel, shape in zip(kernels, cells, strict=True)
    ]
    np.testing.assert_allclose(*sums, atol=1e-5)
    assert kernels[1].shape[0] == 4 * kernels[0].shape[0]


def test_radiance_in_another_unit_is_no_beginning(tiny, tmp_path):
    """Linear, or its logarithm: the layers differ in the names of heads and inputs alone."""
    weights.save(tmp_path / "given" / "model", tiny, build(tiny, seed=3))
    begun = initial_weights.load(tmp_path / "given", build(replace(tiny, linear=True), seed=5))
    assert begun == ["segmentation"]
