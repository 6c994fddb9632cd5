"""From a tiny corpus and untrained weights to the four files."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import lifted_heads
import numpy as np
import pytest
import sphere_corpus
import tensorflow as tf
from scipy.special import softmax

from lime_keras.eval import cli, kept, sections
from lime_keras.eval.accuracy import evaluate as evaluation_module
from lime_keras.eval.accuracy import measures
from lime_keras.eval.accuracy.evaluate import confusion, evaluate
from lime_keras.eval.report import examples
from lime_keras.eval.stability import suite
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import Architecture, build
from lime_keras.optics import shininess

pytestmark = pytest.mark.usefixtures("engines_opened_once")
SIZE = 32
COUNT = 7
TINY = Architecture(size=SIZE, unet_width=2, unet_depth=1, encoder_width=2, dense_width=4)
FILES = [
    "confusion.png",
    "examples",
    "images.csv",
    "kept",
    "metrics.json",
    "report.html",
    "sections",
    "table1.md",
]


def _example(index, seed, size):
    """A sphere; index 1 has no object, index 2 is extreme in every number."""
    out = sphere_corpus.example(index, seed, size) | {"shape": "<b>blob</b>", "light": "room"}
    layers = ("diffuse_shading", "specular_shading", "mirror")
    if index == 1:
        out |= {name: 0 * out[name] for name in ("mask", "normal", *layers)}
    if index == 2:
        light = 65504.0 * (out["environment"] > 1)
        out |= {name: 65504.0 * out["mask"] for name in layers}
        out |= {"environment": light, "shininess": 0.0}
    return out


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus")
    shards = [range(4), range(4, COUNT)]
    return sphere_corpus.write_split(folder, "test", shards, size=SIZE, make=_example)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    weights.save(folder / "model", TINY, lifted_heads.lift(build(TINY, seed=4)))
    (folder / "config.json").write_text('{"config": {"preset": "tiny"}}', encoding="utf-8")
    return folder


@pytest.fixture(scope="module", autouse=True)
def evaluated():
    """`evaluate` in batches of 5, each evaluation made once, for the command too."""
    made = {}

    def once(model_dir, corpus, *, camera=False):
        path = model_dir / "model" if (model_dir / "model").exists() else model_dir
        key = (path, corpus, camera)
        if key not in made:
            made[key] = evaluate(model_dir, corpus, camera=camera)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept, "evaluate", once)
        patch.setattr(evaluation_module, "_AT_ONCE", 5)
        yield once


@pytest.fixture(scope="module")
def evaluation(corpus, run, evaluated):
    return evaluated(run, corpus)


@pytest.fixture(scope="module")
def written(corpus, run):
    assert cli.main([str(corpus), "--weights", str(run)]) == 0
    return run / "eval"


@pytest.mark.slow
def test_the_batch_size_changes_no_number(corpus, run, evaluation, monkeypatch):
    monkeypatch.setattr(evaluation_module, "_AT_ONCE", 1)
    one_by_one = evaluate(run, corpus)
    assert np.array_equal(confusion(one_by_one.rows), confusion(evaluation.rows))
    for name, column in evaluation.rows.items():
        if column.dtype.kind == "f":
            assert one_by_one.rows[name] == pytest.approx(column, rel=1e-3, abs=1e-5), name
        else:
            assert np.array_equal(one_by_one.rows[name], column), name
    for name, column in evaluation.true_mask.items():
        assert one_by_one.true_mask[name] == pytest.approx(column, rel=1e-3, abs=1e-5), name


def test_every_example_is_measured_once_in_order(evaluation):
    assert evaluation.rows["index"].tolist() == list(range(COUNT))
    matrix = confusion(evaluation.rows)
    assert matrix.sum() == COUNT
    true_bins = np.bincount(evaluation.rows["bin"], minlength=8)
    assert matrix.sum(axis=1).tolist() == true_bins.tolist()


def test_the_networks_are_also_evaluated_with_the_true_mask(corpus, run, evaluation):
    [example] = examples.read(run, corpus, [examples.Selection(3, "any")])
    truth = {name: np.asarray(value)[None] for name, value in example.truth.items()}
    _, subnetworks = weights.load(run)
    mask = truth["mask"]
    shading = np.asarray(subnetworks["specular"](truth["image"] * mask)) * mask
    albedos = np.asarray(subnetworks["albedo"]([truth["image"] * mask, shading])).clip(0, 1)
    error = np.abs(albedos[0, :3] - truth["diffuse_albedo"][0]).mean()
    assert evaluation.true_mask["diffuse_absolute"][3] == pytest.approx(error, rel=1e-4)
    mirror = np.asarray(subnetworks["mirror"](shading)) * mask
    logits = np.asarray(subnetworks["exponent"]([shading, mirror]))
    log_error = abs(softmax(logits[0]) @ shininess.LOG_MEANS - np.log10(truth["shininess"][0]))
    assert evaluation.true_mask["log_error"][3] == pytest.approx(log_error, rel=1e-3)
    # The system's own mask leads elsewhere, or this test would see nothing.
    assert evaluation.rows["log_error"][3] != pytest.approx(log_error, rel=1e-3)
    assert evaluation.rows["diffuse_absolute"][3] != pytest.approx(error, rel=1e-3)


def test_chosen_examples_cover_the_bins_and_none_comes_twice(evaluation):
    chosen = examples.choose(evaluation.rows)
    positions = [choice.position for choice in chosen]
    assert len(positions) == len(set(positions)) <= COUNT
    assert set(evaluation.rows["bin"]) == set(evaluation.rows["bin"][positions])


def test_read_examples_are_those_of_the_rows(corpus, run, evaluation):
    chosen = [examples.Selection(5, "later shard"), examples.Selection(0, "first")]
    shown = examples.read(run, corpus, chosen)
    for choice, example in zip(chosen, shown, strict=True):
        assert example.choice == choice
        assert example.truth["index"] == choice.position
        found = evaluation.rows["diffuse_found"][choice.position]
        assert example.estimate["diffuse_albedo"] == pytest.approx(found, abs=1e-5)
    # The model answers each image otherwise, or the tests here would see little.
    one, other = (example.estimate for example in shown)
    assert all(np.abs(one[name] - other[name]).max() > 1e-3 for name in one)


def test_the_four_files_are_written_and_nothing_else(written):
    assert sorted(path.name for path in written.iterdir()) == FILES


def test_metrics_hold_every_measure_finite(written):
    text = (written / "metrics.json").read_text(encoding="utf-8")
    found = json.loads(text, parse_constant=lambda constant: pytest.fail(constant))
    assert set(measures.MEASURES) < set(found)
    assert found["count"] == COUNT
    assert set(found["interval"]) == set(measures.MEASURES)
    assert found["floor"] and found["chance"] and found["paper"] and found["true_mask"]


def test_the_report_needs_nothing_else(written):
    page = (written / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://|@import|<link[^>]+stylesheet|<script[^>]+src", page)
    sources = re.findall(r'\bsrc="([^"]*)"', page)
    assert len(sources) > 9 * 2
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "undefined" not in page.lower()


def test_the_report_tells_what_made_it_and_escapes_names(written, corpus):
    page = (written / "report.html").read_text(encoding="utf-8")
    assert f"lime-eval {corpus}" in page
    assert "&lt;b&gt;blob" in page and "<b>blob" not in page
    assert "<b>With the true mask</b>: the same networks without SegmentationNet" in page


# The ablations.

ABLATED = {
    "without MirrorNet": ({"mirror": False}, {"mirror_relative", "mirror_flip"}),
    "regression": ({"exponent": "regression"}, {"log_exponent_mae_winning", "calibration_error"}),
    "baseline": (
        {"system": "reflectance-map"},
        {"specular_shading_relative", "specular_shading_flip", "mirror_relative", "mirror_flip"},
    ),
}
"""What each is, and the measures it does not have."""


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(row, id=name, marks=() if name == "regression" else pytest.mark.slow)
        for name, row in ABLATED.items()
    ],
)
def ablation(request, corpus, tmp_path_factory):
    """An ablation's architecture, run, lacking measures, and the folder of its evaluation."""
    fields, lacking = request.param
    architecture = dataclasses.replace(TINY, **fields)
    run = tmp_path_factory.mktemp("ablation")
    subnetworks = lifted_heads.lift(build(architecture, seed=6))
    weights.save(run / "model", architecture, subnetworks)
    assert cli.main([str(corpus), "--weights", str(run)]) == 0
    return architecture, run, lacking, run / "eval"


def test_an_ablations_metrics_lack_what_it_has_not(ablation):
    architecture, _, lacking, folder = ablation
    text = (folder / "metrics.json").read_text(encoding="utf-8")
    found = json.loads(text, parse_constant=lambda constant: pytest.fail(constant))
    had = set(measures.MEASURES) - lacking
    assert set(found) & set(measures.MEASURES) == had == set(found["interval"])
    assert found["system"] == architecture.description
    of_predicted_mask = ("mask", "specular_shading_flip", "mirror_flip", "log_exponent_bias")
    assert set(found["true_mask"]) == {
        name for name in had if not name.startswith(of_predicted_mask)
    }
    table = (folder / "table1.md").read_text(encoding="utf-8")
    for name, measure in measures.MEASURES.items():
        assert (f"| {measure.title} " in table) == (name in had), name
    assert f"answered by {architecture.description}." in table
    assert "nan" not in table.lower()


def test_an_ablations_report_shows_what_it_has(ablation):
    architecture, _, lacking, folder = ablation
    assert sorted(path.name for path in folder.iterdir()) == FILES
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert f"</b>, {architecture.description}, reads the material" in page
    assert ("Mirror image M" in page) == ("mirror_relative" not in lacking)
    assert ("Specular shading S" in page) == ("specular_shading_relative" not in lacking)
    baseline = architecture.system == "reflectance-map"
    assert ("Reflectance map, true" in page) == baseline
    regresses = architecture.exponent == "regression"
    assert ('<div class="bars">' in page) == (not regresses)
    columns = {"without MirrorNet": 4, "regression": 5, "baseline": 4}
    [expected] = [n for name, n in columns.items() if ABLATED[name][1] == lacking]
    assert f"repeat({expected}, 1fr)" in page


def _fails(capsys, *arguments):
    """The one line that a failing command prints."""
    assert cli.main([str(argument) for argument in arguments]) == 1
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1 and not captured.out and "Traceback" not in captured.err
    return lines[0]


def test_missing_weights_are_named(corpus, tmp_path, capsys):
    line = _fails(capsys, corpus, "--weights", tmp_path / "no-run")
    assert "no-run" in line and "lime-train" in line
    assert not (tmp_path / "no-run").exists()


def test_a_missing_corpus_is_named(run, tmp_path, capsys):
    line = _fails(capsys, tmp_path, "--weights", run)
    assert "manifest.json is missing" in line and "lime-render" in line


def test_a_broken_manifest_is_named(run, tmp_path, capsys):
    (tmp_path / "test").mkdir()
    (tmp_path / "test" / "manifest.json").write_text("{}", encoding="utf-8")
    line = _fails(capsys, tmp_path, "--weights", run)
    assert "manifest.json" in line and "render the split again" in line


def test_an_empty_split_is_refused(run, tmp_path, capsys):
    sphere_corpus.write_split(tmp_path, "test", [], size=SIZE)
    assert "holds no examples" in _fails(capsys, tmp_path, "--weights", run)


def test_out_and_the_table_and_pictures_of_the_user_that_stay_beside_the_examples(
    corpus, run, written, tmp_path, capsys
):
    out = tmp_path / "out"
    (out / "examples").mkdir(parents=True)
    mine = [out / "examples" / name for name in ("1.png", "2024-trip.png", "99999.png")]
    for path in mine:
        path.write_bytes(b"mine")
    command = [str(corpus), "--weights", str(run / "model"), "--out", str(out)]
    assert cli.main(command) == 0
    assert sorted(path.name for path in out.iterdir()) == FILES
    told = capsys.readouterr()
    assert told.out == (out / "table1.md").read_text(encoding="utf-8")
    assert str(out / "report.html") in told.err
    assert all(path.is_file() for path in mine)
    # Now 99999.png counts as an example of the earlier report.
    assert cli.main(command) == 0
    assert [path.is_file() for path in mine] == [True, True, False]
    names = {path.name for path in (written / "examples").iterdir()}
    assert names == {path.name for path in (out / "examples").iterdir()} - {"1.png", mine[1].name}


def test_a_broken_picture_is_named(corpus, run, tmp_path, capsys):
    """The record's checksum is right, so only decoding finds it."""
    shutil.copytree(corpus, tmp_path / "corpus")
    shard = tmp_path / "corpus" / "test" / "00001.tfrecord"
    stored = sphere_corpus.stored(shard)
    message = tf.train.Example.FromString(stored[1])
    message.features.feature["mirror"].bytes_list.value[:] = [b"no picture"]
    sphere_corpus.store(shard, [stored[0], message.SerializeToString(), stored[2]])
    sphere_corpus.record_checksums(shard.parent)
    line = _fails(capsys, tmp_path / "corpus", "--weights", run, "--out", tmp_path)
    assert f"{shard} is broken: record 1" in line and "lime-render" in line


def test_the_camera_is_used_only_if_asked(corpus, run, written, evaluation, tmp_path):
    out = tmp_path / "deep" / "photos"
    assert cli.main([str(corpus), "--weights", str(run), "--out", str(out), "--camera"]) == 0
    clean, asked = (
        json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        for folder in (written, out)
    )
    assert not clean["camera"] and asked["camera"]
    assert clean["diffuse_albedo_mae"] != asked["diffuse_albedo_mae"]
    assert clean["diffuse_albedo_mae"] == pytest.approx(evaluation.rows["diffuse_absolute"].mean())


def test_the_examples_shown_are_the_photos_that_were_measured(corpus, run, evaluated):
    photographed = evaluated(run, corpus, camera=True)
    chosen = [examples.Selection(5, "later shard"), examples.Selection(0, "first")]
    for example in examples.read(run, corpus, chosen, camera=True):
        found = photographed.rows["diffuse_found"][example.choice.position]
        assert example.estimate["diffuse_albedo"] == pytest.approx(found, abs=1e-5)
        [clean] = examples.read(run, corpus, [example.choice])
        assert not np.array_equal(clean.photo_srgb, example.photo_srgb)


def test_images_that_the_model_cannot_take_are_refused(corpus, tmp_path, capsys):
    larger = Architecture(size=64, unet_width=1, unet_depth=1, encoder_width=1, dense_width=1)
    weights.save(tmp_path, larger, build(larger))
    line = _fails(capsys, corpus, "--weights", tmp_path)
    assert "32 pixels" in line and "--size 64" in line


def test_broken_weights_are_refused(corpus, tmp_path, capsys, monkeypatch):
    subnetworks = build(TINY)
    albedos = subnetworks["albedo"].get_layer("albedos")
    albedos.set_weights([np.full_like(value, np.nan) for value in albedos.get_weights()])
    weights.save(tmp_path, TINY, subnetworks)
    line = _fails(capsys, corpus, "--weights", tmp_path)
    assert "albedo.weights.h5 cannot be read: albedos/kernel holds NaN" in line
    # What is finite in the file may be not in its answers.
    monkeypatch.setattr(weights, "_check_finite", lambda path, network: None)
    line = _fails(capsys, corpus, "--weights", tmp_path)
    assert "is not finite for test example 0" in line and str(tmp_path) in line


def test_a_file_in_the_place_of_out_is_refused_at_once(corpus, run, tmp_path, capsys):
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    line = _fails(capsys, corpus, "--weights", run, "--out", tmp_path / "taken")
    assert "taken" in line and "--out" in line
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"


def test_a_corpus_alone_measures_the_packages_own_model(corpus, run, tmp_path, monkeypatch):
    measured = []
    monkeypatch.setattr("lime_keras.model.folder.DEFAULT", run)
    monkeypatch.setattr(
        sections, "evaluation", lambda out, model, *_, **__: measured.append(model) or ""
    )
    assert cli.main([str(corpus), "--out", str(tmp_path)]) == 0
    assert measured == [run]


def test_the_trade_without_runs_is_of_all_sets(corpus, sets, tmp_path, monkeypatch):
    package, measured = sets("live", "nano"), []
    monkeypatch.setattr(sections, "trade", lambda out, runs, *_, **__: measured.append(runs) or "")
    out = ["--out", str(tmp_path / "out")]
    assert cli.main([str(corpus), *out, "--tradeoff"]) == 0
    assert cli.main([str(corpus), *out, "--tradeoff", "nano", "runs/mine"]) == 0
    assert measured == [[package / "live", package / "nano"], [package / "nano", Path("runs/mine")]]
    assert set(sections.names(measured[0])) == {"live", "nano"}


def test_a_set_is_measured_by_its_name_and_nothing_is_written_into_it(
    corpus, sets, tmp_path, monkeypatch
):
    package, measured = sets("live", "nano"), []
    monkeypatch.setattr(
        sections, "evaluation", lambda _, run, *__, **___: measured.append(run) or ""
    )
    assert cli.main([str(corpus), "--weights", "nano", "--out", str(tmp_path / "out")]) == 0
    assert measured == [package / "nano"]
    monkeypatch.chdir(tmp_path)
    assert cli.main([str(corpus), "--weights", "nano"]) == 0
    assert (tmp_path / "results" / "nano" / "report.html").is_file()
    assert not (package / "nano" / "eval").exists()


@pytest.mark.parametrize("passed", [True, False])
def test_the_extremes_take_weights(passed, run, tmp_path, monkeypatch, capsys):
    def stability(out, cases, *, command):
        assert {case.part for case in cases} == {"trained system"}
        return "tables\n", passed

    monkeypatch.setattr(sections, "stability", stability)
    arguments = ["--stability", "--weights", str(run), "--out", str(tmp_path)]
    assert cli.main(arguments) == (0 if passed else 1)
    assert capsys.readouterr().out == "tables\n"


def test_the_extremes_without_weights_are_those_of_the_default_set(tmp_path, monkeypatch):
    tried = []
    monkeypatch.setattr(suite, "cases", lambda folder: tried.append(folder) or [])
    monkeypatch.setattr(sections, "stability", lambda out, cases, *, command: ("", True))
    assert cli.main(["--stability", "--out", str(tmp_path)]) == 0
    assert tried == [model_folder.DEFAULT]


def test_an_interrupt_leaves_a_short_line_and_status_130(corpus, run, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_evaluate", interrupted)
    assert cli.main([str(corpus), "--weights", str(run)]) == 130
    told = "\ninterrupted: each file is whole or was not written\n"
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["corpus", "--weights", "run", "--fast"],
        ["--weights", "run"],
        ["--table1", "run", "--out", "here"],
        ["--predictions", "answers", "--out", "here"],
        ["corpus", "--predictions", "answers", "--camera", "--out", "here"],
        ["corpus", "--stability", "--out", "here"],
    ],
)
def test_wrong_usage_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    assert "usage: lime-eval" in capsys.readouterr().err


def test_runs_of_one_name_are_named_after_their_parents(tmp_path):
    runs = [tmp_path / "a" / "live", tmp_path / "b" / "live", tmp_path / "b" / "nano"]
    assert list(sections.names(runs)) == ["a-live", "b-live", "nano"]
    for same in ([runs[0], runs[0]], [runs[0], tmp_path / "c" / "a" / "live"]):
        with pytest.raises(ValueError, match="rename a folder of"):
            sections.names(same)
