"""Runs: resumed exactly, refused where they differ, stopped where they break."""

import dataclasses
import itertools
import json
import re
import shutil
import types

import numpy as np
import pytest
import stage_runs
import tensorflow as tf
from PIL import Image
from sphere_corpus import alter, stored, write_split
from stage_runs import ignore

from lime_keras import metrics, networks
from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.io import locking
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import Architecture, subnetwork_names
from lime_keras.optics import shininess
from lime_keras.optics.dynamic_range import compress
from lime_keras.train import cli, stage_model, stage_training, terms, trainer
from lime_keras.train.config import Config, claim, config_path, corpus_sha256
from lime_keras.train.data import Data
from lime_keras.train.devices import Devices
from lime_keras.train.photos import making
from lime_keras.train.stages import SCHEDULES, Stage
from lime_keras.train.state import Checkpoint, means

TINY = Architecture(size=32, unet_width=2, unet_depth=1, encoder_width=2, dense_width=4)
BRIEF = dataclasses.replace(
    stage_runs.BRIEF, batch_size=2, single_steps=2, encoder_steps=2, validation_examples=2
)


@pytest.fixture(scope="module", autouse=True)
def one_stage_traced():
    """Of all stages, specular+mirror alone is traced, as every one is outside of these tests."""
    compiled = stage_model.StageModel.compile

    def compile_(model, **options):
        compiled(model, run_eagerly=set(model.subnetworks) != {"specular", "mirror"}, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage_model.StageModel, "compile", compile_)
        yield


@pytest.fixture(scope="module", autouse=True)
def photos_made_once(tmp_path_factory):
    """All runs keep their photos in one folder, under the hash of what these follow from."""
    folder = tmp_path_factory.mktemp("photos")

    def opened(*arguments):
        data = Data(*arguments)
        data._folder = folder
        return data

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trainer, "Data", opened)
        yield


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return write_split(tmp_path_factory.mktemp("corpus"), "train", [range(6), range(6, 9)])


@pytest.fixture(scope="module")
def config(corpus):
    return Config("tiny", 1.0, TINY, BRIEF, 0, corpus_sha256([corpus]))


@pytest.fixture(scope="module")
def finished(corpus, config, tmp_path_factory):
    run = tmp_path_factory.mktemp("finished")
    trainer.train([corpus], run, config, ignore)
    return run


def _of_options(corpus, run, *options):
    return cli.config_of(cli.parser().parse_args([str(corpus), "--out", str(run), *options]))


def _weights(run):
    _, subnetworks = weights.load(run)
    return {name: network.get_weights() for name, network in subnetworks.items()}


def _same(one, other):
    return all(
        np.array_equal(a, b)
        for name in one.keys() | other.keys()
        for a, b in zip(one[name], other[name], strict=True)
    )


def test_a_run_leaves_a_model_and_its_curves(finished):
    assert set(_weights(finished)) == set(subnetwork_names(TINY))
    curves = sorted(path.name for path in (finished / "curves").iterdir())
    assert curves[0] == "1-segmentation.csv"
    assert len(curves) == 8
    rows = stage_runs.curve(finished, "specular+mirror+exponent+albedo")
    assert [int(row["step"]) for row in rows] == [0, 1, 2, 3, 4]
    assert float(rows[-1]["train_compositing_printed"]) > 0
    assert float(rows[0]["validation_loss"]) > 0
    assert float(rows[-1]["measure_log_exponent_mae"]) > 0


def test_an_evaluation_goes_with_its_system(corpus, config, finished, tmp_path):
    run = _begun(finished, tmp_path / "run", config, before=8)
    (run / "evaluation.json").write_text("{}", encoding="utf-8")
    trainer.train([corpus], run, config, ignore)
    assert json.loads((run / "evaluation.json").read_text(encoding="utf-8"))["examples"]


def test_a_run_that_cannot_learn_is_refused(corpus, config, tmp_path):
    frozen = dataclasses.replace(config, frozen=subnetwork_names(config.architecture))
    with pytest.raises(ValueError, match="--freeze leaves no stage to train"):
        trainer.train([corpus], tmp_path / "run", frozen, ignore)
    linear = dataclasses.replace(config.architecture, linear=True)
    half = dataclasses.replace(config, architecture=linear, precision="float16")
    with pytest.raises(ValueError, match="float16 holds no linear radiance"):
        trainer.train([corpus], tmp_path / "run", half, ignore)
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_measures_are_pooled_over_the_validation_set(corpus, config, tmp_path):
    """Not averaged by batch: the last one here is smaller."""
    run = tmp_path / "run"
    schedule = dataclasses.replace(BRIEF, validation_examples=3)
    more = dataclasses.replace(config, schedule=schedule)
    trainer.train([corpus], run, more, ignore, only=["exponent"])
    last = stage_runs.curve(run, "exponent")[-1]
    network, left = networks.build(TINY)["exponent"], stage_runs.left(run, "exponent")
    network.set_weights([left[f"arr_{i}"] for i in range(len(network.weights))])
    shards = Split(corpus, "train").shard_paths()[1:]
    (batch,) = pipeline.evaluation(shards, size=32, batch_size=3, camera=True).as_numpy_iterator()
    seen = [compress(batch[name]) * batch["mask"] for name in ("specular_shading", "mirror")]
    probabilities = tf.nn.softmax(network.predict_on_batch(seen)).numpy()
    errors = np.abs(np.log10(batch["shininess"]) - shininess.log_expected(probabilities))
    distance = np.abs(np.argmax(probabilities, -1) - shininess.bin_of(batch["shininess"]))
    assert abs(errors.mean() - (errors[:2].mean() + errors[2]) / 2) > 1e-3
    # Kept photos have eight bits, those of `evaluation` more.
    assert float(last["measure_log_exponent_mae"]) == pytest.approx(errors.mean(), rel=5e-4)
    assert float(last["measure_exponent_exact"]) == pytest.approx(np.mean(distance == 0), rel=1e-4)
    assert float(last["measure_exponent_within_one"]) == pytest.approx(np.mean(distance <= 1))


def _same_stage(one, other, name):
    a, b = stage_runs.left(one, name), stage_runs.left(other, name)
    return a.keys() == b.keys() and all(np.array_equal(a[key], b[key]) for key in a)


def test_the_whole_system_is_evaluated(corpus, config, finished):
    """By its own mask, on the validation set, as `lime-eval` would."""
    found = json.loads((finished / "evaluation.json").read_text(encoding="utf-8"))
    shards = Split(corpus, "train").shard_paths()[1:]
    dataset = pipeline.evaluation(shards, size=32, batch_size=2, camera=True)
    batch = next(dataset.as_numpy_iterator())
    system = networks.assemble(weights.load(finished)[1])
    outputs = {name: np.asarray(one) for name, one in system(batch["image"]).items()}
    measures = found["measures"]
    assert found["examples"] == len(batch["mask"]) == 2
    overlap = metrics.overlap(batch["mask"], outputs["mask"])
    pooled = metrics.overlap_ratio(*(one.sum() for one in overlap))
    assert measures["mask_iou_pooled"] == pytest.approx(float(pooled), abs=1e-6)
    error = np.abs(batch["diffuse_albedo"] - outputs["diffuse_albedo"]).mean()
    assert measures["diffuse_albedo_mae"] == pytest.approx(error, rel=1e-4)
    logs = shininess.log_of_outputs(outputs)
    error = np.abs(np.log10(batch["shininess"]) - logs).mean()
    assert measures["log_exponent_mae"] == pytest.approx(error, rel=1e-4)
    assert set(measures) == set(terms.metrics_of(subnetwork_names(TINY)))


class Nudge:
    """In place of a stage's training: its last checkpoint, each weight moved by one."""

    def __init__(self, part, *_):
        self._part = part

    def run(self):
        for network in self._part.model.subnetworks.values():
            network.set_weights([value + 1 for value in network.get_weights()])
        self._part.checkpoint.save(self._part.model, self._part.stage.steps)


@pytest.fixture
def nudged(monkeypatch):
    """Where it does not matter how a stage's weights came about."""
    monkeypatch.setattr(trainer, "StageTraining", Nudge)


def _begun(finished, run, config, before):
    """A run that has the finished one's stages up to a number."""
    (run / "stages").mkdir(parents=True)
    shutil.copy(finished / "config.json", run)
    for path in (finished / "stages").iterdir():
        if int(path.name[0]) < before:
            shutil.copy(path, run / "stages")
    return run


def test_the_single_stages_of_a_run_make_a_model_of_their_own(corpus, config, finished, tmp_path):
    """Joined stages that are left out change nothing."""
    run = _begun(finished, tmp_path / "run", config, 6)
    assert trainer.train([corpus], run, config, ignore, only=["segmentation"]) == []
    for name, network in weights.load(run)[1].items():
        left = stage_runs.left(finished, name)
        for index, values in enumerate(network.get_weights()):
            assert np.array_equal(values, left[f"arr_{index}"]), name


@pytest.mark.parametrize(
    "number, name, step",
    [
        pytest.param(3, "mirror", 1, marks=pytest.mark.slow),
        (6, "specular+mirror", 3),
        pytest.param(7, "specular+mirror+exponent", 3, marks=pytest.mark.slow),
    ],
)
def test_an_interrupted_stage_ends_with_the_same_weights(
    number, name, step, corpus, config, finished, tmp_path, monkeypatch
):
    """And with the same state of the optimiser, and the same curve."""
    monkeypatch.setattr(stage_training, "_SECONDS_BETWEEN_CHECKPOINTS", 0)
    run = _begun(finished, tmp_path / "run", config, number)

    def interrupt(progress):
        if (progress.stage.name, progress.step) == (name, step):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer.train([corpus], run, config, interrupt, only=[name])
    trainer.train([corpus], run, config, ignore, only=[name])
    assert _same_stage(run, finished, name)
    rows = [[row["step"] for row in stage_runs.curve(one, name)] for one in (run, finished)]
    assert rows[0] == rows[1]


@pytest.mark.slow
def test_curves_hold_means_over_their_interval(corpus, config, tmp_path, monkeypatch):
    """Not the last batch's losses, which is what Keras tells."""
    monkeypatch.setattr(stage_training, "_CURVE_POINTS", 1)
    seen = []
    longer = dataclasses.replace(config.schedule, single_steps=4, single_learning_rate=0.1)
    trainer.train(
        [corpus],
        tmp_path,
        dataclasses.replace(config, schedule=longer),
        lambda progress: seen.append(progress.losses.get("mask")),
        only=["segmentation"],
    )
    last = stage_runs.curve(tmp_path, "segmentation")[-1]
    # What is told after each step is the mean so far; undo it to have each batch's loss.
    means = np.array(seen[1:], float)
    batches = np.diff(means * np.arange(1, 5), prepend=0)
    assert float(last["train_mask"]) == pytest.approx(batches.mean(), rel=1e-4)
    assert batches.std() > 1e-6


@pytest.mark.parametrize("precision", ["float32", "float16"])
def test_the_learning_rate_falls_along_half_a_cosine(config, precision):
    stage, schedule = Stage(("segmentation",), 4, 0.5), dataclasses.replace(BRIEF, cosine=True)
    network = networks.build(TINY, 0)["segmentation"]
    model = stage_model.StageModel({"segmentation": network})
    falling = dataclasses.replace(config, schedule=schedule, precision=precision)
    trainer._compile(model, stage, falling)
    optimizer = getattr(model.optimizer, "inner_optimizer", model.optimizer)
    rates = []
    for step in range(5):
        optimizer.iterations.assign(step)
        rates.append(float(optimizer.learning_rate))
    expected = [0.5, 0.25 + 0.25 * 0.5**0.5, 0.25, 0.25 - 0.25 * 0.5**0.5, 0.0]
    assert rates == pytest.approx(expected, abs=1e-7)


def test_corpora_are_learnt_from_together(corpus, config, tmp_path, nudged):
    other = write_split(tmp_path / "other", "train", [range(2), range(3)], seed=1, size=64)
    both = dataclasses.replace(config, corpus_sha256=corpus_sha256([corpus, other]))
    assert both.corpus_sha256 not in (config.corpus_sha256, corpus_sha256([other]))
    run = tmp_path / "run"
    data = Data([corpus, other], both, run)
    stage = Stage(("segmentation",), 4, 1e-3)
    batches = itertools.islice(data.training(stage, ["mask"], 0), 4)
    seen = [pair for batch in batches for pair in zip(batch["seed"], batch["index"], strict=True)]
    # Six of one and two of the other are an epoch.
    assert sorted((int(s), int(i)) for s, i in seen) == [
        *((0, i) for i in range(6)),
        (1, 0),
        (1, 1),
    ]
    validation = [int(seed) for batch in data.validation(["seed"]) for seed in batch["seed"]]
    assert validation.count(0) == validation.count(1) == 1
    trainer.train([corpus, other], run, both, ignore, only=["segmentation"])
    record = json.loads((run / "config.json").read_text(encoding="utf-8"))
    assert [one["path"] for one in record["corpora"]] == [str(corpus), str(other)]
    assert [one["description"]["seed"] for one in record["corpora"]] == [0, 1]
    with pytest.raises(ValueError, match="corpus_sha256"):
        trainer.train([corpus], run, config, ignore)


def test_a_finished_run_is_not_trained_again(corpus, config, finished):
    seen = []
    trainer.train([corpus], finished, config, seen.append)
    assert [(told.stage.name, told.step) for told in seen] == [
        (stage.name, stage.steps) for stage in BRIEF.stages(TINY)
    ]


@pytest.mark.slow
def test_another_seed_gives_other_weights(corpus, config, finished, tmp_path):
    other = dataclasses.replace(config, seed=1)
    trainer.train([corpus], tmp_path, other, ignore, only=["exponent"])
    assert not np.array_equal(
        stage_runs.left(tmp_path, "exponent")["arr_0"],
        stage_runs.left(finished, "exponent")["arr_0"],
    )


def test_what_was_run_is_recorded(config, finished):
    record = json.loads((finished / "config.json").read_text(encoding="utf-8"))
    assert record["config"]["corpus_sha256"] == config.corpus_sha256
    assert record["config"]["schedule"]["joint_steps"] == 12
    assert record["corpora"][0]["description"] is not None
    assert record["backend"] == "tensorflow"
    assert {"tensorflow", "jax", "keras", "numpy"} == set(record["packages"])
    beside_the_weights = finished / "model" / "training.json"
    assert json.loads(beside_the_weights.read_text(encoding="utf-8")) == record


def test_a_runs_config_is_read_back(config, finished, tmp_path):
    assert Config.read(finished) == config
    with pytest.raises(FileNotFoundError, match=r"config\.json is missing.*leave out --resume"):
        Config.read(tmp_path)
    for text in ("", "{}", '{"config": {"architecture": {}}}'):
        (tmp_path / "config.json").write_text(text, encoding="utf-8")
        with pytest.raises(
            ValueError, match=r"config\.json cannot be read as a run of this version"
        ):
            Config.read(tmp_path)


# Stages alone, and from other runs.


@pytest.mark.slow
def test_stages_run_apart_are_the_same_as_together(corpus, config, finished, tmp_path):
    for only in (["mirror"], ["specular"], ["specular+mirror"]):
        untrained = trainer.train([corpus], tmp_path, config, ignore, only=only)
        assert _same_stage(tmp_path, finished, *only)
    assert untrained == ["segmentation", "exponent", "albedo"]
    with pytest.raises(FileNotFoundError, match=r"segmentation.weights.h5 is missing"):
        weights.load(tmp_path)


def test_a_run_begins_with_what_another_has_trained_yet(corpus, config, tmp_path, nudged, capsys):
    some = tmp_path / "some"
    untrained = trainer.train([corpus], some, config, ignore, only=["specular", "segmentation"])
    assert untrained == ["mirror", "exponent", "albedo"]
    on = dataclasses.replace(config, begun_from=model_folder.digest(some))
    seen = _first_weights(corpus, tmp_path / "run", on, start_from=some)
    _, trained = weights.load(some, whole=False)
    assert sorted(trained) == ["segmentation", "specular"]
    for expected, found in zip(
        trained["segmentation"].get_weights(), seen["segmentation"], strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    expected = "continued: segmentation, specular; fresh: mirror, exponent, albedo"
    assert expected in capsys.readouterr().out
    # --fresh leaves some of it out: a run of its own, with weights of its own.
    but = dataclasses.replace(on, fresh=("segmentation",))
    fresh = _first_weights(corpus, tmp_path / "fresh", but, start_from=some)["segmentation"]
    assert "continued: specular; fresh: segmentation, mirror" in capsys.readouterr().out
    assert not all(map(np.array_equal, fresh, seen["segmentation"]))
    assert Config.read(tmp_path / "fresh") == but
    with pytest.raises(ValueError, match="fresh None there"):
        trainer.train([corpus], tmp_path / "run", but, ignore, start_from=some)


@pytest.mark.parametrize(
    "fresh, words", [("lens", "--fresh lens: this run has segmentation, spec"), ("mirror", None)]
)
def test_fresh_names_what_would_take_other_weights(
    corpus, config, finished, tmp_path, fresh, words
):
    on = dataclasses.replace(config, fresh=(fresh,))
    with pytest.raises(ValueError, match="--fresh is for --start-from: pass it, or leave"):
        trainer.train([corpus], tmp_path / "run", on, ignore)
    on = dataclasses.replace(
        on, begun_from=model_folder.digest(finished), frozen=None if words else (fresh,)
    )
    with pytest.raises(ValueError, match=words or "--freeze mirror: this run begins with a"):
        trainer.train([corpus], tmp_path / "run", on, ignore, start_from=finished)


@pytest.mark.slow
def test_joined_training_may_skip_the_single_stages(corpus, config, finished, tmp_path):
    name = "specular+mirror"
    untrained = trainer.train([corpus], tmp_path, config, ignore, only=[name])
    assert untrained == ["segmentation", "exponent", "albedo"]
    assert len(list((tmp_path / "stages").iterdir())) == 1
    assert not _same_stage(tmp_path, finished, name)
    # Trained from nothing, it does not follow from the stages that now come before it.
    expected = rf"6-{re.escape(name)}\.npz was trained from other weights.*delete it"
    with pytest.raises(ValueError, match=expected):
        trainer.train([corpus], tmp_path, config, ignore, reuse=finished)


def test_an_unknown_stage_is_refused_with_those_there_are(corpus, config, tmp_path):
    with pytest.raises(ValueError, match=r"no stage speculative: this run has segmentation, spec"):
        trainer.train([corpus], tmp_path, config, ignore, only=["speculative"])
    assert not (tmp_path / "config.json").exists()


# Begun with another run's weights.


def _first_weights(corpus, run, config, **options):
    """What the first stage's network had before its first step."""
    seen = {}

    def look(part, *rest):
        network = part.model.subnetworks[part.stage.name]
        seen.setdefault(part.stage.name, [value.copy() for value in network.get_weights()])
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trainer, "StageTraining", look)
        with pytest.raises(KeyboardInterrupt):
            trainer.train([corpus], run, config, ignore, **options)
    return seen


@pytest.mark.slow
def test_a_run_begins_with_another_models_weights(corpus, config, finished, tmp_path):
    given = tmp_path / "given"
    shutil.copytree(finished / "model", given)
    on = dataclasses.replace(config, begun_from=model_folder.digest(given))
    run = tmp_path / "run"
    seen = _first_weights(corpus, run, on, start_from=given)
    for found, expected in zip(
        seen["segmentation"], _weights(finished)["segmentation"], strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    with pytest.raises(FileNotFoundError, match="began with another model: pass its --start-from"):
        trainer.train([corpus], run, on, ignore)
    left = trainer.train([corpus], run, on, ignore, only=["segmentation"], start_from=given)
    assert left == []
    # What it does not train stays as it was.
    kept, before = _weights(run), _weights(finished)
    for name in before:
        same = all(map(np.array_equal, kept[name], before[name]))
        assert same == (name != "segmentation"), name
    with np.load(run / "stages" / "1-segmentation.npz") as stored:
        after = [stored[f"arr_{index}"] for index in range(len(seen["segmentation"]))]
    steps = [np.abs(a - b).max() for a, b in zip(after, seen["segmentation"], strict=True)]
    # Two steps of Adam at 1e-3 from where it began.
    assert 0 < max(steps) < 0.01


def test_at_another_size_all_subnetworks_go_on(corpus, config, finished, tmp_path, capsys):
    larger = dataclasses.replace(TINY, size=64)
    digest = model_folder.digest(finished)
    on = dataclasses.replace(config, architecture=larger, begun_from=digest)
    corpus_of_64 = write_split(tmp_path / "corpus", "train", [range(3), range(3, 5)], size=64)
    on = dataclasses.replace(on, corpus_sha256=corpus_sha256([corpus_of_64]))
    _first_weights(corpus_of_64, tmp_path / "run", on, start_from=finished)
    assert "fresh: none" in capsys.readouterr().out


def test_a_model_of_which_nothing_fits_is_refused(corpus, config, finished, tmp_path):
    wider = dataclasses.replace(TINY, unet_width=3, encoder_width=3)
    digest = model_folder.digest(finished)
    on = dataclasses.replace(config, architecture=wider, begun_from=digest)
    with pytest.raises(ValueError, match=r"none of the subnetworks .* has the layers"):
        trainer.train([corpus], tmp_path, on, ignore, start_from=finished)


def test_the_folder_of_a_recipe_is_refused(corpus, config, tmp_path):
    (tmp_path / "recipe.json").touch()
    with pytest.raises(ValueError, match="holds a run of a recipe: pass another --out"):
        trainer.train([corpus], tmp_path, config, ignore)


def test_weights_of_another_lobe_are_refused(corpus, config, finished, tmp_path):
    given = tmp_path / "given"
    shutil.copytree(finished / "model", given)
    record = json.loads((given / "training.json").read_text())
    record["config"]["lobe"] = "printed"
    (given / "training.json").write_text(json.dumps(record))
    on = dataclasses.replace(config, begun_from=model_folder.digest(given))
    with pytest.raises(ValueError, match="with --lobe printed, and the corpora have furnace"):
        trainer.train([corpus], tmp_path / "run", on, ignore, start_from=given)


def test_another_beginning_is_another_run(corpus, config, finished, tmp_path):
    shutil.copytree(finished, tmp_path / "run")
    on = dataclasses.replace(config, begun_from=model_folder.digest(finished))
    with pytest.raises(ValueError, match="begun_from None there"):
        trainer.train([corpus], tmp_path / "run", on, ignore, start_from=finished)


def test_a_run_to_reuse_must_be_there(corpus, config, tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing holds no stages of a run to take over"):
        trainer.train([corpus], tmp_path, config, ignore, reuse=tmp_path / "nothing")


def test_a_checkpoint_cut_off_is_named(corpus, config, finished, tmp_path):
    run = _begun(finished, tmp_path / "run", config, 6)
    path = run / "stages" / "2-specular.npz"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ValueError, match=r"2-specular\.npz cannot be read: .*delete it to train"):
        trainer.train([corpus], run, config, ignore, only=["specular"])


def test_a_damaged_array_of_a_checkpoint_is_named(finished, tmp_path):
    path = tmp_path / "stages" / "1-segmentation.npz"
    path.parent.mkdir()
    shutil.copy(finished / "stages" / path.name, path)
    content = bytearray(path.read_bytes())
    content[content.index(b"arr_0.npy") + 200] ^= 255
    path.write_bytes(content)
    network = networks.build(TINY)["segmentation"]
    model = types.SimpleNamespace(subnetworks={"segmentation": network}, compiled=False)
    with pytest.raises(ValueError, match=r"segmentation\.npz cannot be read .*delete it to train"):
        Checkpoint(tmp_path, "1-segmentation", "").restore(model)


def test_a_run_that_another_process_trains_is_refused(corpus, config, tmp_path):
    with (
        locking.lock_folder(tmp_path / "run", "lime-train is training"),
        pytest.raises(RuntimeError, match=r"another lime-train is training .*run: wait for it"),
    ):
        trainer.train([corpus], tmp_path / "run", config, ignore)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("content", ["{", "[]", "{}", '{"config": 3}', "[" * 100_000])
def test_a_record_of_a_run_that_is_none_is_named(content, corpus, config, tmp_path):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(
        ValueError, match=r"config\.json cannot be read as the record of a run.*another --out"
    ):
        trainer.train([corpus], tmp_path, config, ignore)
    with pytest.raises(
        ValueError, match=r"config\.json cannot be read as a run of this version.*another --out"
    ):
        Config.read(tmp_path)


def _trained_anew(corpus, run, config, **options):
    """Names of the stages that took a step."""
    steps = []
    trainer.train(
        [corpus], run, config, lambda told: steps.append((told.stage.name, told.step)), **options
    )
    return {name for name, step in steps if (name, step - 1) in steps}


@pytest.mark.slow
def test_ablations_take_over_what_is_the_same(corpus, config, finished, tmp_path):
    """And end as if they had trained all of it themselves."""
    one, two = tmp_path / "one", tmp_path / "two"
    no_mirror = dataclasses.replace(config, architecture=dataclasses.replace(TINY, mirror=False))
    joined = {"specular+exponent", "specular+exponent+albedo"}
    assert _trained_anew(corpus, one, no_mirror, reuse=finished) == {"exponent"} | joined
    curves = sorted(path.name for path in (one / "curves").iterdir())
    assert curves[:4] == ["1-segmentation.csv", "2-specular.csv", "3-albedo.csv", "4-exponent.csv"]
    assert set(_weights(one)) == {"segmentation", "specular", "albedo", "exponent"}
    alone = {"specular", "exponent", "specular+exponent"}
    assert _trained_anew(corpus, two, no_mirror, only=alone) == alone
    assert all(_same_stage(one, two, name) for name in alone)


def test_photographs_count_for_the_mask_and_for_all_that_follows_from_it(corpus, config, tmp_path):
    schedule = dataclasses.replace(BRIEF, found_masks=True)

    def signatures(cutouts):
        changed = dataclasses.replace(config, schedule=schedule, cutouts=cutouts)
        data = Data([corpus], changed, tmp_path, photographs=(tmp_path, tmp_path))
        run = trainer._Run(tmp_path, changed, data, Devices(1), ignore, None, None, None)
        return [part.checkpoint._signature for part in run._parts]

    assert all(a != b for a, b in zip(signatures(None), signatures("a hash"), strict=True))


@pytest.mark.parametrize(
    "change, anew",
    [
        (
            {"architecture": dataclasses.replace(TINY, exponent="regression")},
            {"exponent", "specular+mirror+exponent", "specular+mirror+exponent+albedo"},
        ),
        ({"compositing": False}, {"albedo", "specular+mirror+exponent+albedo"}),
        (
            {"architecture": dataclasses.replace(TINY, system="reflectance-map")},
            {"reflectance_map", "material", "reflectance_map+material"},
        ),
        (
            {"schedule": dataclasses.replace(BRIEF, joint_steps=1)},
            {stage.name for stage in BRIEF.stages(TINY)[5:]},
        ),
        (
            {"schedule": dataclasses.replace(BRIEF, camera=False)},
            {stage.name for stage in BRIEF.stages(TINY)},
        ),
        ({"seed": 1}, {stage.name for stage in BRIEF.stages(TINY)}),
        ({"precision": "bfloat16"}, {stage.name for stage in BRIEF.stages(TINY)}),
        ({"schedule": dataclasses.replace(BRIEF, validation_examples=1)}, set()),
    ],
    ids=["regression", "perceptual", "baseline", "steps", "camera", "seed", "precision", "none"],
)
def test_only_what_differs_is_trained(corpus, config, finished, tmp_path, change, anew):
    changed = dataclasses.replace(config, **change)
    taken = []
    trainer.train([corpus], tmp_path, changed, taken.append, only=[], reuse=finished)
    assert all(told.step == told.stage.steps for told in taken)
    stages = changed.schedule.stages(changed.architecture)
    assert {told.stage.name for told in taken} == {stage.name for stage in stages} - anew


# Where it breaks.


def _altered(corpus, folder, row, feature, value):
    """A copy of a corpus with another number in an example of its first shard."""
    shutil.copytree(corpus, folder)
    alter(folder / "train", row, feature, value)
    return folder


def test_the_example_that_breaks_a_step_is_named(corpus, config, tmp_path):
    """Its numbers are finite, but what comes of them is not."""
    broken = _altered(corpus, tmp_path / "corpus", 3, "ambient", 3e38)
    third = stored(broken / "train" / "00000.tfrecord")[3]
    features = tf.train.Example.FromString(third).features.feature
    seed, index = (features[name].int64_list.value[0] for name in ("seed", "index"))
    expected = (
        rf"stage albedo, step \d: .*compositing.* not finite; from example {index} of seed {seed} "
        "of the train split: render it again.*last checkpoint is from before"
    )
    longer = dataclasses.replace(BRIEF, encoder_steps=9, camera=False)
    digest = corpus_sha256([broken])
    unseen = dataclasses.replace(config, schedule=longer, corpus_sha256=digest)
    with pytest.raises(RuntimeError, match=expected):
        trainer.train([broken], tmp_path / "run", unseen, ignore, only=["albedo"])
    assert not (tmp_path / "run" / "model").exists()


def test_a_record_that_holds_no_number_is_named(corpus, config, tmp_path):
    broken = _altered(corpus, tmp_path / "corpus", 3, "ambient", np.nan)
    expected = r"00000\.tfrecord is broken: record 3 .*ambient is not finite"
    of_it = dataclasses.replace(config, corpus_sha256=corpus_sha256([broken]))
    with pytest.raises(ValueError, match=expected):
        trainer.train([broken], tmp_path / "run", of_it, ignore, only=["exponent"])


@pytest.mark.slow
def test_a_weight_that_is_no_number_is_blamed_on_no_example(corpus, config, tmp_path, monkeypatch):
    boundless = dataclasses.replace(terms.TERMS["specular"], weight=np.inf)
    monkeypatch.setitem(terms.TERMS, "specular", boundless)
    with pytest.raises(RuntimeError, match=r"stage specular, step 1: loss, .*not finite; from ex"):
        trainer.train([corpus], tmp_path, config, ignore, only=["specular"])
    assert not (tmp_path / "stages" / "2-specular.npz").exists()


def test_the_camera_is_on_unless_refused(corpus, config, finished, tmp_path, monkeypatch):
    assert _of_options(corpus, tmp_path, "--preset", "smoke").schedule.camera
    refused = _of_options(corpus, tmp_path, "--preset", "smoke", "--no-camera")
    assert not refused.schedule.camera
    clean = dataclasses.replace(config, schedule=dataclasses.replace(BRIEF, camera=False))
    with pytest.raises(ValueError, match="camera True there, False asked"):
        trainer.train([corpus], finished, clean, ignore)
    trainer.train([corpus], tmp_path, clean, ignore, only=["specular"])
    rows = [stage_runs.curve(run, "specular")[-1] for run in (tmp_path, finished)]
    # Training and validation photos are taken alike; exposure changes S itself.
    for losses in ("train_specular", "validation_specular"):
        assert rows[0][losses] != rows[1][losses]


def test_one_shard_cannot_be_split(config, tmp_path):
    corpus = write_split(tmp_path, "train", [range(2)])
    config = dataclasses.replace(config, corpus_sha256=corpus_sha256([corpus]))
    with pytest.raises(ValueError, match="at least 2"):
        trainer.train([corpus], tmp_path / "run", config, ignore)
    assert not (tmp_path / "run" / "config.json").exists(), "the mended corpus would be refused"


def test_the_command_names_what_is_missing(tmp_path, capsys):
    status = cli.main([str(tmp_path), "--out", str(tmp_path / "run"), "--preset", "smoke"])
    assert status == 1
    assert "lime-render" in capsys.readouterr().err


@pytest.fixture
def brief_smoke(monkeypatch):
    monkeypatch.setitem(networks.PRESETS, "smoke", TINY)
    monkeypatch.setitem(SCHEDULES, "smoke", BRIEF)


def test_the_record_of_another_version_is_refused_by_name(tmp_path, brief_smoke, corpus):
    config = _of_options(corpus, tmp_path, "--preset", "smoke")
    claim(tmp_path, [corpus], config)
    record = json.loads(config_path(tmp_path).read_text())
    del record["config"]["rate_scale"]
    config_path(tmp_path).write_text(json.dumps(record))
    with pytest.raises(ValueError, match=r"another run: rate_scale None there, 1\.0 asked"):
        claim(tmp_path, [corpus], config)
    record["config"]["schedule"] |= {"papers": True}
    record["config"]["minutes"] = 22.0
    config_path(tmp_path).write_text(json.dumps(record))
    with pytest.raises(ValueError, match=r"minutes 22\.0 there, None asked.*papers True there"):
        claim(tmp_path, [corpus], config)
    del record["config"]["schedule"]["papers"], record["config"]["minutes"]
    record["config"]["lens"] = "wide"
    config_path(tmp_path).write_text(json.dumps(record))
    with pytest.raises(ValueError, match=r"a run of this version.*lens"):
        Config.read(tmp_path)


def test_the_command_trains_some_stages_and_resumes(corpus, tmp_path, brief_smoke, capsys):
    run = ["--out", str(tmp_path / "run")]
    begun = [str(corpus), *run, "--preset", "smoke", "--scale-steps", "2", "--without", "mirror"]
    begun += ["--scale-rate", "0.25"]
    assert cli.main([*begun, "--stages", "exponent"]) == 0
    told = capsys.readouterr()
    assert "no whole model yet: segmentation, specular, albedo not trained" in told.out
    assert re.search(r"exponent +4 +\d+\.\d +exponent_binary +\d\.\d{4} +\d\.\d{4}", told.out)
    assert re.search(r"\n +exponent_within_one +[01]\.\d{4} +[01]\.\d{4}\n", told.out)
    assert "4/6 exponent: 100%" in told.err and "data=" in told.err
    held = Config.read(tmp_path / "run")
    assert held.architecture == dataclasses.replace(TINY, mirror=False)
    assert held.schedule == BRIEF.scaled(2, 0.25)
    assert (held.steps_scale, held.rate_scale) == (2, 0.25)
    resumed = [str(corpus), *run, "--resume", "--stages", "exponent"]
    assert cli.main(resumed) == 0
    assert cli.main([*resumed, "--seed", "4", "--no-camera"]) == 1
    assert re.search(
        r"holds another run: schedule.camera True there, False asked; seed 0 there, 4 asked",
        capsys.readouterr().err,
    )


def test_the_commands_ablations(corpus, tmp_path):
    def config(*options):
        return _of_options(corpus, tmp_path, "--preset", "paper", *options)

    full = config()
    no_loss = config("--without", "perceptual")
    assert not no_loss.compositing and no_loss.architecture == full.architecture
    neither = config("--without", "perceptual", "mirror")
    assert not neither.compositing and not neither.architecture.mirror
    assert config("--exponent", "regression").architecture.exponent == "regression"
    assert config("--baseline", "reflectance-map").architecture.system == "reflectance-map"
    with pytest.raises(ValueError, match=r"the preset paper shows the materials that .* holds"):
        config("--materials", "natural")
    assert config("--precision", "bfloat16").precision == "bfloat16"
    larger = dataclasses.replace(SCHEDULES["paper"], batch_size=256)
    assert config("--batch-size", "256").schedule == larger
    assert config("--batch-size", "256", "--scale-steps", "2").schedule == larger.scaled(2)
    with pytest.raises(ValueError, match="one ablation at a time"):
        config("--baseline", "reflectance-map", "--without", "mirror")


@pytest.mark.parametrize(
    "part", ["mirror", "dichromatic", "dichromatic-shading", "hue", "pretrained"]
)
def test_the_command_puts_parts_in_and_leaves_them_out(corpus, tmp_path, part):
    for preset in ("paper", "live"):

        def architecture(*options, preset=preset):
            return _of_options(corpus, tmp_path, "--preset", preset, *options).architecture

        plain = networks.PRESETS[preset]
        assert architecture() == plain
        for option, there in (("--with", True), ("--without", False)):
            changed = dataclasses.replace(plain, **{part.replace("-", "_"): there})
            assert architecture(option, part) == changed
        assert architecture("--with", part) != architecture("--without", part)


def test_parts_are_put_in_or_left_out_but_not_both(corpus, tmp_path):
    def config(*options):
        return _of_options(corpus, tmp_path, "--preset", "live", *options)

    twice = config("--without", "mirror", "--without", "dichromatic", "perceptual")
    assert not (twice.architecture.mirror or twice.architecture.dichromatic or twice.compositing)
    with pytest.raises(ValueError, match="--with and --without mirror: take one"):
        config("--with", "mirror", "dichromatic", "--without", "mirror")
    with pytest.raises(ValueError, match="--with dichromatic: the reflectance-map baseline"):
        config("--baseline", "reflectance-map", "--with", "dichromatic")


def test_the_baseline_of_every_preset_is_the_papers_kind(corpus, tmp_path):
    for preset in ("paper", "live"):
        options = ["--preset", preset, "--baseline", "reflectance-map"]
        found = _of_options(corpus, tmp_path, *options).architecture
        assert (found.system, found.dichromatic, found.hue) == ("reflectance-map", False, False)


def test_the_command_learns_masks_from_cut_outs(corpus, tmp_path, brief_smoke, capsys, monkeypatch):
    make = making.make
    # As processes do, which keep what they have read by the laws of the photos.
    monkeypatch.setattr(making, "make", lambda laws, *rest: (hash(laws), make(laws, *rest)))
    for name in ("things", "places"):
        (tmp_path / name).mkdir()
    pixels = np.random.default_rng(0).integers(0, 256, (80, 80, 4), dtype=np.uint8)
    pixels[..., 3] = 0
    pixels[5:75, 5:75, 3] = 255
    Image.fromarray(pixels).save(tmp_path / "things" / "some.png")
    Image.fromarray(pixels[..., :3]).save(tmp_path / "places" / "some.png")
    folders = ["--cutouts", str(tmp_path / "things"), str(tmp_path / "places")]
    stage = ["--stages", "segmentation"]
    plain, seen = ([str(corpus), "--out", str(tmp_path / name)] for name in ("plain", "seen"))
    assert cli.main([*plain, "--preset", "smoke", *stage]) == 0
    assert cli.main([*seen, "--preset", "smoke", *folders, *stage]) == 0
    weights = [
        stage_runs.left(tmp_path / name, "segmentation")["arr_0"] for name in ("plain", "seen")
    ]
    assert not np.array_equal(*weights)
    assert cli.main([*seen, "--resume", *folders, *stage]) == 0
    capsys.readouterr()
    assert cli.main([*seen, "--resume", *stage]) == 1
    assert "this run learns from cut-outs: pass its --cutouts again" in capsys.readouterr().err
    Image.fromarray(pixels[::-1, :, :3]).save(tmp_path / "places" / "other.png")
    assert cli.main([*seen, "--resume", *folders, *stage]) == 1
    assert "holds another run: cutouts" in capsys.readouterr().err


def test_the_commands_sizes(corpus, tmp_path, brief_smoke, nudged, capsys):
    """In place of the preset's, kept by a run that is resumed, and refused where they differ."""
    run = [str(corpus), "--out", str(tmp_path / "run")]
    stage = ["--stages", "specular"]
    sizes = ["--width", "3", "--size", "64"]
    assert cli.main([*run, "--preset", "smoke", *sizes, *stage]) == 0
    architecture = dataclasses.replace(TINY, unet_width=3, size=64)
    assert Config.read(tmp_path / "run").architecture == architecture
    assert stage_runs.left(tmp_path / "run", "specular")["arr_0"].shape == (3, 3, 3, 3)
    assert _of_options(corpus, tmp_path / "run", "--resume") == Config.read(tmp_path / "run")
    capsys.readouterr()
    assert cli.main([*run, "--resume", "--width", "4", *stage]) == 1
    assert "architecture.unet_width 3 there, 4 asked" in capsys.readouterr().err
    assert cli.main([*run, "--preset", "smoke", "--size", "64", *stage]) == 1
    assert "architecture.unet_width 3 there, 2 asked" in capsys.readouterr().err


@pytest.mark.parametrize(
    "size, found", [("80", "take a multiple of 32"), ("96", "train with a --size that divides 64")]
)
def test_a_size_that_cannot_be_is_refused(size, found, corpus, tmp_path, capsys):
    run = [str(corpus), "--out", str(tmp_path / "run"), "--preset", "smoke"]
    assert cli.main([*run, "--size", size]) == 1
    assert found in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--preset", "smoke", "--resume"],
        ["--preset", "smoke", "--scale-steps", "0"],
        ["--preset", "smoke", "--width", "0"],
        ["--preset", "smoke", "--size", "1.5"],
        ["--preset", "smoke", "--minutes", "5"],
        ["--preset", "smoke", "--batch-size", "0"],
    ],
)
def test_wrong_usage(options, tmp_path):
    with pytest.raises(SystemExit) as stopped:
        cli.main([str(tmp_path), "--out", str(tmp_path / "run"), *options])
    assert stopped.value.code == 2


def test_the_bars_show_losses_and_the_wait_for_data(capsys):
    first, second = BRIEF.stages(TINY)[:2]
    with cli._Bars(BRIEF.stages(TINY)) as bars:
        bars.tell(stage_training.Progress(first, 0, {}, 0.0))
        bars.tell(stage_training.Progress(first, 2, {"mask": 0.25}, 0.1))
        bars.tell(stage_training.Progress(second, 1, {}, 0.0))
    shown = capsys.readouterr().err
    assert "1/8 segmentation: 100%" in shown and "mask=0.25, data=10%" in shown
    assert "2/8 specular:  50%" in shown


def test_means():
    assert means([{"mask": value} for value in (1.0, 2.0, 6.0)]) == {"mask": 3.0}


def test_validation_weighs_examples_and_not_batches():
    class Model:
        reset_measures = staticmethod(lambda: None)
        measured = staticmethod(dict)

        def test_on_batch(self, batch, **options):
            return {"loss": float(batch["mask"].mean())}

    class One:
        split = weights = staticmethod(lambda batch: batch)

    batches = [{"mask": np.full(4, 1.0)}, {"mask": np.full(1, 6.0)}]
    assert stage_training.evaluate(Model(), batches, One()) == ({"loss": 2.0}, {}, 5)


def test_a_stage_ends_with_the_optimisers_average(corpus, config, tmp_path):
    """Of two steps and a momentum of 1/4: a quarter of the first weights, the rest of the last."""

    def trained(name, steps, average):
        schedule = dataclasses.replace(BRIEF, steps=steps, average=average, decay=0.5)
        # As many photos, whatever the steps: their first batch is the same.
        own = dataclasses.replace(config, schedule=schedule, photos=2)
        trainer.train([corpus], tmp_path / name, own, ignore, only=["exponent"])
        left = stage_runs.left(tmp_path / name, "exponent")
        count = len(networks.build(TINY)["exponent"].weights)
        return [left[f"arr_{index}"] for index in range(count)]

    first, last = trained("one", 1, None), trained("two", 2, None)
    averaged = trained("averaged", 2, 0.25)
    assert not all(map(np.array_equal, first, last))
    for one, two, mean in zip(first, last, averaged, strict=True):
        assert mean == pytest.approx(0.25 * one + 0.75 * two, abs=1e-7)


@pytest.mark.slow
def test_frozen_subnetworks_keep_their_weights(corpus, config, finished, tmp_path):
    held = dataclasses.replace(
        config, begun_from=model_folder.digest(finished), frozen=("specular", "mirror")
    )
    joined = "specular+mirror+exponent"
    assert [stage.name for stage in trainer.stages_of(held)] == [
        *("segmentation", "albedo", "exponent", joined, f"{joined}+albedo")
    ]
    only = [joined, f"{joined}+albedo"]
    assert not trainer.train(
        [corpus], tmp_path / "run", held, ignore, only=only, start_from=finished
    )
    before, after = _weights(finished), _weights(tmp_path / "run")
    for name in before:
        pairs = zip(before[name], after[name], strict=True)
        same = all(np.array_equal(one, other) for one, other in pairs)
        assert same == (name not in ("albedo", "exponent")), name
    assert Config.read(tmp_path / "run") == held


@pytest.mark.parametrize(
    "name, words", [("mirror", "did not begin with its"), ("lens", "no such part")]
)
def test_only_what_a_run_begins_with_is_frozen(corpus, config, tmp_path, name, words):
    held = dataclasses.replace(config, frozen=(name,))
    with pytest.raises(ValueError, match=f"--freeze {name}: .*{words}"):
        trainer.train([corpus], tmp_path / "run", held, ignore)
    assert not (tmp_path / "run" / "config.json").exists(), "the mended options would be refused"
