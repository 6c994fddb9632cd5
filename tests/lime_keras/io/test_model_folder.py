"""Where a model's files lie, and what identifies its weights."""

import pytest

from lime_keras.io import model_folder


@pytest.fixture
def run(tmp_path):
    (tmp_path / "run" / "model" / "alone").mkdir(parents=True)
    for name in (
        "architecture.json",
        "albedo.weights.h5",
        "mirror.weights.h5",
        "alone/a.weights.h5",
    ):
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
    (model / "alone" / "a.weights.h5").write_text("changed")
    (run / "onnx").mkdir()
    assert model_folder.digest(run) == before
    seen = {before}
    for name in ("architecture.json", "albedo.weights.h5", "mirror.weights.h5"):
        (model / name).write_text("changed")
        seen.add(model_folder.digest(run))
    (model / "mirror.weights.h5").rename(model / "specular.weights.h5")
    seen.add(model_folder.digest(run))
    assert len(seen) == 5


def test_a_folder_without_a_model_is_told(tmp_path):
    for ask in (model_folder.files, model_folder.digest):
        with pytest.raises(FileNotFoundError, match=r"architecture\.json is missing.*lime-train"):
            ask(tmp_path / "none")
