"""The schedule of section 5.4."""

from lime_keras.networks import PRESETS, SUBNETWORKS
from lime_keras.train.stages import SCHEDULES, SINGLE


def test_each_subnetwork_is_trained_alone_first():
    assert sorted(SINGLE) == sorted(SUBNETWORKS)


def test_the_papers_schedule_is_the_papers():
    stages = SCHEDULES["paper"].stages()
    assert [stage.name for stage in stages] == [
        "segmentation",
        "specular",
        "mirror",
        "albedo",
        "exponent",
        "specular+mirror",
        "specular+mirror+exponent",
        "specular+mirror+exponent+albedo",
    ]
    assert [stage.steps for stage in stages] == [100_000] * 5 + [45_000] * 3
    assert {stage.learning_rate for stage in stages[5:]} == {1e-4}
    assert SCHEDULES["paper"].batch_size == 32


def test_every_preset_has_networks_and_a_schedule():
    assert set(PRESETS) == set(SCHEDULES)
