"""The schedule of section 5.4, and the ablations'."""

import dataclasses

import pytest

from lime_keras.networks import PRESETS, Architecture, subnetwork_names
from lime_keras.train.stages import SCHEDULES

PAPER = PRESETS["paper"]


def changed(preset, **changes):
    if "system" in changes:
        changes |= {"dichromatic": False, "hue": False}
    return dataclasses.replace(PRESETS[preset], **changes)


def stage_names(preset, **changes):
    stages = SCHEDULES[preset].stages(changed(preset, **changes))
    return [stage.name for stage in stages]


def test_the_papers_stages_are_in_the_order_of_its_text():
    assert stage_names("paper") == [
        "segmentation",
        "specular",
        "mirror",
        "albedo",
        "exponent",
        "specular+mirror",
        "specular+mirror+exponent",
        "specular+mirror+exponent+albedo",
    ]


@pytest.mark.parametrize("preset", ["nano", "live"])
def test_the_live_presets_learning_rate_falls(preset):
    assert SCHEDULES[preset].cosine


@pytest.mark.parametrize("preset", ["nano", "live"])
def test_muon_trains_all_but_the_lone_mirror(preset):
    stages = SCHEDULES[preset].stages(PRESETS[preset])
    assert [stage.name for stage in stages if stage.optimizer != "muon"] == ["mirror"]
    assert next(stage for stage in stages if stage.name == "mirror").optimizer == "adam"


def test_set_steps_and_rates_are_those_of_every_stage():
    live = dataclasses.replace(SCHEDULES["live"], steps=7, rate=0.5)
    for stage in live.stages(PRESETS["live"]):
        assert (stage.steps, stage.learning_rate) == (7, 0.5)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    "changes",
    [{}, {"mirror": False}, {"exponent": "regression"}, {"system": "reflectance-map"}],
    ids=["full", "no mirror", "regression", "baseline"],
)
def test_each_subnetwork_is_trained_alone_first(preset, changes):
    architecture = changed(preset, **changes)
    found = stage_names(preset, **changes)
    assert sorted(name for name in found if "+" not in name) == sorted(
        subnetwork_names(architecture)
    )
    joined = [name for name in found if "+" in name]
    assert joined
    assert found[len(found) - len(joined) :] == joined


def test_a_scaled_schedule_keeps_all_but_its_lengths():
    scaled = SCHEDULES["paper"].scaled(0.01)
    assert [stage.steps for stage in scaled.stages(PAPER)] == [1000] * 5 + [150] * 3
    assert scaled.scaled(100) == SCHEDULES["paper"]
    assert {stage.steps for stage in scaled.scaled(1e-9).stages(PAPER)} == {1}


def test_scaled_rates_are_those_of_every_stage():
    plain, scaled = (
        SCHEDULES["live"].scaled(1.0, rate).stages(PRESETS["live"]) for rate in (1.0, 0.25)
    )
    assert [stage.learning_rate for stage in scaled] == [stage.learning_rate / 4 for stage in plain]
    assert [stage.steps for stage in scaled] == [stage.steps for stage in plain]


def test_every_preset_has_networks_and_a_schedule():
    assert set(PRESETS) == set(SCHEDULES)


def test_an_unknown_system_is_refused():
    with pytest.raises(ValueError, match="no system reflection"):
        Architecture(32, 1, 1, 1, 1, system="reflection")
