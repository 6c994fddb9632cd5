"""Every ingredient of the preset `paper` is that of sections 4 to 5.4, and nothing else.

Each test names the section; docs/explanation/paper.md lists them sentence by sentence.
"""

import dataclasses
import itertools

import keras
import numpy as np
import pytest
from sphere_corpus import write_split

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.networks import PRESETS, build
from lime_keras.networks.registry import is_plain
from lime_keras.optics import colour, shininess
from lime_keras.optics.reflectance_map import disc, true_reflectance_map
from lime_keras.train import cli, trainer
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data
from lime_keras.train.photos.kept import INPUT_MASK
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES, Schedule
from lime_keras.train.terms import TERMS, StageOutputs, Units

PAPER = PRESETS["paper"]
SMALL = dataclasses.replace(
    PAPER, size=64, unet_width=2, unet_depth=2, encoder_width=2, dense_width=4
)
ROWS = {
    "full approach": {},
    "without MirrorNet": {"mirror": False},
    "exponent regression": {"exponent": "regression"},
    "reflectance map": {"system": "reflectance-map"},
}
"""The systems of Table 1, by what differs from the preset."""


@pytest.fixture(scope="module")
def subnetworks():
    return build(SMALL, seed=0)


def model(subnetworks, *names, **options):
    chosen = {name: subnetworks[name] for name in names}
    return StageModel(chosen, losses=SCHEDULES["paper"].losses, **options)


def test_the_schedule_is_section_5_4():
    assert SCHEDULES["paper"] == Schedule(
        batch_size=32,
        single_steps=100_000,
        encoder_steps=100_000,
        single_learning_rate=1e-4,
        joint_steps=45_000,
        joint_learning_rate=1e-4,
        validation_examples=1024,
        optimizer="adam",
        cosine=False,
        epsilon=1e-6,
        decay=0.0,
        losses="printed",
        camera=False,
        flips=False,
        repaints=False,
        paints=False,
        found_masks=False,
    )


@pytest.mark.parametrize("row", ROWS)
def test_subnetworks_are_trained_alone_and_then_end_to_end(row):
    stages = SCHEDULES["paper"].stages(dataclasses.replace(PAPER, **ROWS[row]))
    alone = [stage for stage in stages if "+" not in stage.name]
    joined = [stage for stage in stages if "+" in stage.name]
    assert {(stage.steps, stage.learning_rate) for stage in alone} == {(100_000, 1e-4)}
    assert {stage.learning_rate for stage in joined} == {1e-4}
    assert sum(stage.steps for stage in joined) == 45_000
    assert [stage.name for stage in joined] == {
        "full approach": [
            "specular+mirror",
            "specular+mirror+exponent",
            "specular+mirror+exponent+albedo",
        ],
        "without MirrorNet": ["specular+exponent", "specular+exponent+albedo"],
        "exponent regression": [
            "specular+mirror",
            "specular+mirror+exponent",
            "specular+mirror+exponent+albedo",
        ],
        "reflectance map": ["reflectance_map+material"],
    }[row]


@pytest.mark.parametrize("row", ROWS)
def test_every_stage_is_trained_by_adam_with_defaults_at_a_constant_rate(row, subnetworks):
    config = Config("paper", 1.0, SMALL, SCHEDULES["paper"], 0, "")
    for stage in config.schedule.stages(dataclasses.replace(PAPER, **ROWS[row])):
        if not set(stage.subnetworks) <= set(subnetworks):
            continue
        chosen = model(subnetworks, *stage.subnetworks)
        trainer._compile(chosen, stage, config)
        adam = chosen.optimizer
        assert isinstance(adam, keras.optimizers.Adam)
        usual = keras.optimizers.Adam(1e-4, epsilon=1e-6).get_config()
        assert (
            adam.get_config().items()
            >= {name: value for name, value in usual.items() if name != "name"}.items()
        )
        for count in (0, 10_000):
            adam.iterations.assign(count)
            assert float(adam.learning_rate) == pytest.approx(1e-4)


def test_the_decay_that_delta_may_have_been_is_kerass():
    decayed = dataclasses.replace(SCHEDULES["paper"], decay=1e-6)
    stage = decayed.stages(PAPER)[0]
    rate = trainer._learning_rates(stage, decayed)
    assert float(rate(0)) == pytest.approx(1e-4)
    assert float(rate(100_000)) == pytest.approx(1e-4 / 1.1)


def test_the_terms_are_those_of_the_text_each_of_weight_one(subnetworks):
    every = [name for name in subnetworks]
    assert set(model(subnetworks, *every).terms) == {
        "mask",
        "specular",
        "mirror",
        "exponent_binary",
        "diffuse_albedo",
        "specular_albedo",
        "compositing_printed",
    }
    without = model(subnetworks, *every, compositing=False).terms
    assert "compositing_printed" not in without and len(without) == 6
    regression = build(dataclasses.replace(SMALL, exponent="regression"), seed=0)
    assert model(regression, "exponent").terms == ["log_exponent_l1"]
    baseline = build(dataclasses.replace(SMALL, system="reflectance-map"), seed=0)
    assert set(model(baseline, "reflectance_map", "material").terms) == {
        "reflectance_map_l2",
        "diffuse_albedo",
        "specular_albedo",
        "exponent_binary",
    }
    assert {TERMS[name].weight for name in TERMS if TERMS[name].family != "robust"} == {1.0}


def batch(size=8):
    """Random features of two examples, of which every loss can be computed by hand."""
    rng = np.random.default_rng(3)
    images = {
        name: rng.uniform(0.1, 2.0, (2, size, size, channels)).astype(np.float32)
        for name, channels in (("diffuse_shading", 1), ("specular_shading", 1), ("mirror", 1))
    }
    return images | {
        "image": rng.uniform(size=(2, size, size, 3)).astype(np.float32),
        "mask": (rng.uniform(size=(2, size, size, 1)) > 0.4).astype(np.float32),
        "diffuse_albedo": rng.uniform(size=(2, 3)).astype(np.float32),
        "specular_albedo": rng.uniform(size=2).astype(np.float32),
        "ambient": np.array([0.01, 0.04], np.float32),
        "shininess": np.array([3.0, 400.0], np.float32),
        "exponent_bin": shininess.bin_of(np.array([3.0, 400.0])),
        "painted": np.zeros((2, size, size, 1), np.float32),
    }


def test_each_loss_is_the_texts_by_hand():
    truth, rng = batch(), np.random.default_rng(4)
    raw = {
        "mask": rng.normal(size=truth["mask"].shape),
        "specular_shading": rng.normal(size=truth["mask"].shape),
        "mirror": rng.normal(size=truth["mask"].shape),
        "albedos": rng.normal(0.5, 0.2, (2, 4)),
        "exponent_bin_probabilities": rng.normal(size=(2, 8)),
        "log_exponent": rng.normal(1.5, 1, (2, 1)),
    }
    raw = {name: value.astype(np.float32) for name, value in raw.items()}
    specular = rng.uniform(size=truth["mask"].shape).astype(np.float32)
    answer = StageOutputs(raw, {"specular_shading": np.log1p(specular)}, {})
    units = Units(linear=PAPER.linear)
    inside = truth["mask"] / truth["mask"].sum((1, 2, 3), keepdims=True)
    p = np.exp(raw["exponent_bin_probabilities"])
    p /= p.sum(-1, keepdims=True)
    one_hot = np.eye(8)[truth["exponent_bin"]]
    m_d, m_s = raw["albedos"][:, None, None, :3], raw["albedos"][:, None, None, 3:]
    m_a = truth["ambient"][:, None, None, None]
    composed = m_a + m_d * truth["diffuse_shading"] + m_s * specular
    residual = truth["mask"] * (colour.srgb_to_linear(truth["image"]) - composed)
    axes = (1, 2, 3)
    expected = {
        "mask": np.square(raw["mask"] - truth["mask"]).mean(axes),
        "specular": (inside * np.abs(raw["specular_shading"] - truth["specular_shading"])).sum(
            axes
        ),
        "mirror": (inside * np.abs(raw["mirror"] - truth["mirror"])).sum(axes),
        "diffuse_albedo": np.square(raw["albedos"][:, :3] - truth["diffuse_albedo"]).mean(-1),
        "specular_albedo": np.square(raw["albedos"][:, 3] - truth["specular_albedo"]),
        "exponent_binary": -(one_hot * np.log(p) + (1 - one_hot) * np.log(1 - p)).mean(-1),
        "log_exponent_l1": np.abs(raw["log_exponent"][:, 0] - np.log10(truth["shininess"])),
        "compositing_printed": np.square(residual).mean(axes),
    }
    for name, value in expected.items():
        found = np.array(TERMS[name].loss(truth, answer, units))
        np.testing.assert_allclose(found, value, rtol=1e-4, err_msg=name)


def test_the_baselines_map_has_the_squared_error_of_what_is_compressed():
    rng, size = np.random.default_rng(5), 8
    light = rng.uniform(size=(2, 64, 128, 1)).astype(np.float32)
    truth = batch(size) | {"environment": light}
    raw = rng.normal(size=(2, size, size, 3)).astype(np.float32)
    answer = StageOutputs({"reflectance_map": raw}, {}, {})
    found = np.array(TERMS["reflectance_map_l2"].loss(truth, answer, Units()))
    difference = raw - np.log1p(np.array(true_reflectance_map(truth)))
    inside = disc(size)[..., 0] > 0
    expected = np.square(difference)[:, inside].mean((1, 2))
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_the_networks_are_those_of_section_5(subnetworks):
    reads = {name: [tensor.name for tensor in one.inputs] for name, one in subnetworks.items()}
    assert reads == {
        "segmentation": ["image"],
        "specular": ["masked_image"],
        "mirror": ["linear_specular_shading"],
        "albedo": ["masked_image", "linear_specular_shading"],
        "exponent": ["linear_specular_shading", "linear_mirror"],
    }
    assert not (PAPER.pretrained or PAPER.dichromatic or PAPER.hue or PAPER.mask_contrast)
    assert PAPER.mirror and PAPER.exponent == "classification" and PAPER.size == 256
    # No contrast of the mask, and S and M in linear radiance.
    assert all(is_plain(subnetworks[name]) for name in ("segmentation", "specular", "mirror"))


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return write_split(tmp_path_factory.mktemp("paper"), "train", [range(4), range(4, 6)])


def test_the_command_takes_the_recipe_as_it_is(corpus, tmp_path):
    options = [str(corpus), "--out", str(tmp_path), "--preset", "paper"]
    config = cli.config_of(cli.parser().parse_args(options))
    assert (config.schedule, config.architecture) == (SCHEDULES["paper"], PAPER)
    assert config.compositing and config.precision == "float32" and config.materials is None
    assert (config.begun_from, config.frozen, config.cutouts) == (None, None, None)
    small = [*options, "--size", "64", "--width", "16", "--encoder-width", "16"]
    halved = cli.config_of(cli.parser().parse_args([*small, "--scale-steps", "0.1"]))
    assert halved.architecture == dataclasses.replace(
        PAPER, size=64, unet_width=16, encoder_width=16, dense_width=128
    )
    assert [stage.steps for stage in trainer.stages_of(halved)] == [10_000] * 5 + [1_500] * 3


def test_batches_are_the_records_as_rendered(corpus, tmp_path):
    """No camera, no flip, no paint, true masks, m_a as rendered: each image is a stored one."""
    schedule = dataclasses.replace(SCHEDULES["paper"], batch_size=4, validation_examples=2)
    config = Config("paper", 1.0, SMALL, schedule, 0, corpus_sha256([corpus]))
    data = Data([corpus], config, tmp_path)
    shards = Split(corpus, "train").shard_paths()
    (stored,) = pipeline.evaluation(shards, size=64, batch_size=6).as_numpy_iterator()
    for stage in schedule.stages(SMALL)[-1:]:
        features = data.with_input_mask(stage, model(build(SMALL, 0), *stage.subnetworks).features)
        assert INPUT_MASK not in features
        for found in itertools.islice(data.training(stage, features, 0), 2):
            assert not np.any(found["painted"])
            for row, index in enumerate(np.array(found["index"])):
                for name in ("image", "mask", "ambient", "diffuse_albedo"):
                    expected = stored[name][index]
                    np.testing.assert_allclose(found[name][row], expected, rtol=1e-3, atol=1e-6)
                # In 8 bits.
                kept, true = (
                    np.sqrt(np.log1p(one))
                    for one in (found["specular_shading"][row], stored["specular_shading"][index])
                )
                np.testing.assert_allclose(kept, true, atol=0.51 / 255 * true.max())
