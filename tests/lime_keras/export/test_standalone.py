"""Subnetworks as models of their own, which exchange what `assemble` passes between them."""

import dataclasses

import lifted_heads
import numpy as np
import pytest

from lime_keras.export.standalone import parts, standalone
from lime_keras.networks import assemble, build
from lime_keras.networks.registry import OUTPUT_ROWS

EXCHANGED = {
    "segmentation": (["image"], ["mask"]),
    "specular": (["image", "mask"], ["compressed_specular_shading", "specular_shading"]),
    "mirror": (["compressed_specular_shading", "mask"], ["compressed_mirror", "mirror"]),
    "exponent": (
        ["compressed_mirror", "compressed_specular_shading"],
        ["exponent_bin_probabilities"],
    ),
    "albedo": (
        ["compressed_specular_shading", "image", "mask"],
        ["diffuse_albedo", "specular_albedo"],
    ),
}


def test_a_part_reads_no_more_than_it_needs(tiny):
    for name, network in build(tiny).items():
        alone = standalone(name, network)
        assert (sorted(alone.input), sorted(alone.output)) == EXCHANGED[name]


def with_split(architecture):
    return dataclasses.replace(architecture, dichromatic=True, hue=True)


def test_the_split_is_computed_once_for_all_that_read_it(tiny):
    found = parts(build(with_split(tiny)))
    assert list(found) == [
        "segmentation",
        "dichromatic",
        "specular",
        "mirror",
        "exponent",
        "albedo",
    ]
    alone = found["dichromatic"]
    assert (sorted(alone.input), list(alone.output)) == (["image", "mask"], ["dichromatic"])
    reading = {name for name, one in found.items() if "dichromatic" in one.input}
    assert reading == {"specular", "exponent", "albedo"}
    assert "dichromatic" not in parts(build(tiny))


def test_the_parts_of_an_ablation_together_have_all_outputs(ablation):
    parts = [standalone(name, network) for name, network in build(ablation).items()]
    read = set().union(*(alone.input for alone in parts)) - {"image"}
    answered = set().union(*(alone.output for alone in parts))
    assert read <= answered
    assert answered & set(OUTPUT_ROWS) == set(assemble(build(ablation)).output)


@pytest.mark.parametrize("split", [False, True])
def test_joined_by_name_they_answer_what_the_whole_answers(tiny, split):
    subnetworks = lifted_heads.lift(build(with_split(tiny) if split else tiny, seed=4))
    images = np.random.default_rng(0).uniform(size=(3, 32, 32, 3)).astype(np.float32)
    values = {"image": images}
    for alone in parts(subnetworks).values():
        values |= alone.predict_on_batch({key: values[key] for key in alone.input})
    for name, expected in assemble(subnetworks).predict_on_batch(images).items():
        assert np.ptp(expected) > 1e-3, name
        np.testing.assert_allclose(values[name], expected, rtol=1e-5, atol=1e-6)
