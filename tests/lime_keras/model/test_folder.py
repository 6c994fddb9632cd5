"""Where a model's files lie, and what identifies its weights."""

import dataclasses
from pathlib import Path

import pytest

from lime_keras.model import folder as model_folder
from lime_keras.model.folder import Description, Graph


@pytest.fixture
def run(tmp_path):
    (tmp_path / "run" / "model").mkdir(parents=True)
    for name in ("architecture.json", "albedo.weights.h5", "mirror.weights.h5"):
        (tmp_path / "run" / "model" / name).write_text(name)
    return tmp_path / "run"


def test_a_run_and_its_model_are_the_same_model(run):
    model = run / "model"
    assert model_folder.folder(run) == model_folder.folder(model) == model
    assert model_folder.graphs(run) == model_folder.graphs(model) == run / "onnx"
    assert model_folder.digest(run) == model_folder.digest(model)
    other = model.rename(run / "weights")
    assert model_folder.folder(other) == other
    assert model_folder.graphs(other) == other / "onnx"


def test_the_digest_is_of_all_that_is_run_and_of_nothing_else(run):
    model, before = run / "model", model_folder.digest(run)
    (model / "training.json").write_text("{}")
    (run / "onnx").mkdir()
    assert model_folder.digest(run) == before
    seen = {before}
    for name in ("architecture.json", "albedo.weights.h5", "mirror.weights.h5"):
        (model / name).write_text("changed")
        seen.add(model_folder.digest(run))
    (model / "mirror.weights.h5").rename(model / "specular.weights.h5")
    seen.add(model_folder.digest(run))
    assert len(seen) == 5


def test_the_lobe_is_that_of_the_record(run):
    assert model_folder.lobe(run) == "furnace"
    record = run / "model" / "training.json"
    for text, lobe in (
        ("{}", "furnace"),
        ('{"config": {}}', "furnace"),
        ('{"config": {"lobe": "printed"}}', "printed"),
    ):
        record.write_text(text)
        assert model_folder.lobe(run) == lobe
    assert model_folder.training_config(run / "model") == {"lobe": "printed"}
    for text in ("[]", '{"config": 3}', "{"):
        record.write_text(text)
        with pytest.raises(ValueError, match=r"training\.json"):
            model_folder.lobe(run)
    (run / "config.json").write_text('{"config": {"seed": 3}}')
    assert model_folder.training_config(run) == {"seed": 3}


def test_a_folder_without_a_model_is_told(tmp_path):
    for ask in (model_folder.files, model_folder.digest):
        with pytest.raises(FileNotFoundError, match=r"architecture\.json is missing.*lime-train"):
            ask(tmp_path / "none")


# Sets that come with the package.


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with the sets `live` and `nano`, and other things beside them."""
    folder = tmp_path / "package"
    for name in ("nano", "live"):
        (folder / name / "model").mkdir(parents=True)
        (folder / name / "model" / "architecture.json").write_text("{}")
    (folder / "not one").mkdir()
    (folder / "README.md").write_text("")
    monkeypatch.setattr(model_folder, "PRETRAINED", folder)
    return folder


def test_sets_are_what_lies_there(package):
    assert model_folder.shipped() == {name: package / name for name in ("live", "nano")}


def test_a_set_is_found_by_its_name_and_anything_else_is_a_folder(package, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert model_folder.find("nano") == package / "nano"
    for other in ("runs/nano", "./nano", "not one", "README.md", "", "none", package / "nano"):
        assert model_folder.find(other) == Path(other)
    (tmp_path / "nano").mkdir()
    assert model_folder.find("nano") == package / "nano"
    (tmp_path / "nano" / "architecture.json").write_text("{}")
    assert model_folder.find("nano") == Path("nano")


def test_a_name_that_there_is_not_is_told_with_those_that_there_are(package):
    with pytest.raises(FileNotFoundError, match=r"with the package: live, nano$"):
        model_folder.files(model_folder.find("micro"))


def test_the_defaults_are_sets_that_are_there():
    assert model_folder.DEFAULT == model_folder.shipped()["live"]
    assert model_folder.FOR_PHOTOS in model_folder.shipped().values()


# Weights that lie in the graphs alone.


@pytest.fixture
def exported(run):
    """A run whose weights lie in its graphs alone."""
    (run / "onnx").mkdir()
    graphs = {"segmentation": Graph(("image",), ("mask",), "of its file")}
    model_folder.write_description(run / "onnx", Description("of before", 32, "LIME", graphs))
    (run / "onnx" / "segmentation.onnx").write_text("graph")
    assert not model_folder.has_weights_in_graphs(run)
    for path in (run / "model").glob("*.h5"):
        path.unlink()
    return run


def test_weights_in_graphs_are_the_models_files_and_keep_its_digest(exported):
    model = exported / "model"
    for path in (exported, model):
        assert model_folder.has_weights_in_graphs(path) and model_folder.digest(path) == "of before"
        assert model_folder.files(path) == [
            model / "architecture.json",
            exported / "onnx" / "segmentation.onnx",
        ]


MASK = Graph(("image",), ("mask",), "of its file")
UNSOUND = {
    "no size": {"size": 0},
    "a size in words": {"size": "32"},
    "a truth value": {"size": True},
    "no mask": {"graphs": {"segmentation": Graph(("image",), ("soft_mask",), "of its file")}},
    "read too early": {
        "graphs": {"mirror": Graph(("specular_shading",), ("mirror",), "its"), "mask": MASK}
    },
    "a digest that is no text": {"weights": 7},
    "a system that is no text": {"system": None},
    "a file's digest that is no text": {
        "graphs": {"segmentation": dataclasses.replace(MASK, sha256=7)}
    },
}


@pytest.mark.parametrize("change", [{}, *UNSOUND.values()], ids=["sound", *UNSOUND])
def test_a_description_that_is_not_sound_counts_as_none(change, tmp_path):
    sound = Description("digest", 32, "LIME", {"segmentation": MASK})
    model_folder.write_description(tmp_path, dataclasses.replace(sound, **change))
    assert model_folder.read_description(tmp_path) == (None if change else sound)


@pytest.mark.parametrize("text", ["", "[]", "{}", '"text"', "7", "[[" * 4])
def test_graphs_without_a_description_of_theirs_are_told(exported, text):
    (exported / "onnx" / "graphs.json").write_text(text)
    with pytest.raises(ValueError, match=r"graphs\.json is damaged"):
        model_folder.digest(exported)
