"""SavedModel and ONNX answer as Keras does, or are not left behind."""

import numpy as np
import pytest
import tensorflow as tf

from lime_keras import export, export_cli, weights
from lime_keras.networks import answers, assemble
from lime_keras.networks.system import OUTPUTS

FORMATS = {
    "savedmodel": ("saved_model", export.run_saved_model),
    "onnx": ("lime.onnx", export.run_onnx),
}


@pytest.fixture(scope="module", params=FORMATS)
def exported(request, tiny_model, tmp_path_factory):
    """A whole model in one format: its folder, file, runner and differences."""
    name, run = FORMATS[request.param]
    folder = tmp_path_factory.mktemp(request.param) / "deep" / "folder"
    return folder, folder / name, run, export.export(folder, request.param, tiny_model)


@pytest.fixture(scope="module")
def network(tiny_model):
    return assemble(weights.load(tiny_model)[1])


def fresh(batch, size=32):
    return np.random.default_rng(batch).uniform(size=(batch, size, size, 3)).astype(np.float32)


def test_differences_are_reported_and_small(exported):
    folder, path, _, differences = exported
    assert set(differences) == set(OUTPUTS)
    assert all(0 <= difference <= 1e-4 for difference in differences.values())
    assert list(folder.iterdir()) == [path]


@pytest.mark.parametrize("batch", [1, 3])
def test_fresh_images_in_any_batch_agree_with_keras(batch, exported, network):
    _, path, run, _ = exported
    expected, found = network(fresh(batch)), run(path, fresh(batch))
    assert set(found) == set(OUTPUTS)
    for name in OUTPUTS:
        assert found[name].dtype == np.float32
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-3, atol=1e-4, err_msg=name)
        if found[name].ndim == 4:
            assert np.ptp(found[name]) > 1e-3, f"{name} says nothing"


def test_names_and_shapes_of_inputs_and_outputs(exported):
    _, path, _, _ = exported
    signature = {"saved_model": saved_model_signature, "lime.onnx": onnx_signature}[path.name]
    assert signature(path) == ({"image": (32, 32, 3)}, set(OUTPUTS))


def saved_model_signature(path):
    served = tf.saved_model.load(str(path)).signatures["serving_default"]
    inputs = served.structured_input_signature[1]
    assert all(spec.dtype == tf.float32 and spec.shape[0] is None for spec in inputs.values())
    shapes = {name: tuple(spec.shape[1:]) for name, spec in inputs.items()}
    return shapes, set(served.structured_outputs)


def onnx_signature(path):
    import onnx
    import onnxruntime

    onnx.checker.check_model(str(path), full_check=True)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    inputs = session.get_inputs()
    assert all(i.type == "tensor(float)" and not isinstance(i.shape[0], int) for i in inputs)
    shapes = {i.name: tuple(i.shape[1:]) for i in inputs}
    return shapes, {output.name for output in session.get_outputs()}


@pytest.mark.parametrize("model_format", FORMATS)
def test_only_what_is_asked_for_is_exported(model_format, tiny_model, tmp_path, network):
    only = ["mask", "specular_albedo"]
    name, run = FORMATS[model_format]
    assert set(export.export(tmp_path, model_format, tiny_model, only)) == set(only)
    found = run(tmp_path / name, fresh(2))
    assert set(found) == set(only)
    for output, expected in network(fresh(2)).items():
        if output in only:
            np.testing.assert_allclose(found[output], expected, rtol=1e-3, atol=1e-4)


def test_an_unknown_output_or_no_model_is_refused(tiny_model, tmp_path):
    with pytest.raises(ValueError, match="normals"):
        export.export(tmp_path / "out", "onnx", tiny_model, ["normals"])
    with pytest.raises(FileNotFoundError, match="lime-train"):
        export.export(tmp_path / "out", "onnx", tmp_path)
    assert not (tmp_path / "out").exists()


# The ablations.


@pytest.mark.parametrize("model_format", FORMATS)
def test_ablations_agree_with_keras(model_format, ablation_model, tmp_path):
    name, run = FORMATS[model_format]
    subnetworks = weights.load(ablation_model)[1]
    differences = export.export(tmp_path, model_format, ablation_model)
    assert set(differences) == set(answers(subnetworks))
    assert all(0 <= difference <= 1e-4 for difference in differences.values())
    images = np.concatenate([export.proof_images(32), fresh(3)])
    expected, found = assemble(subnetworks)(images), run(tmp_path / name, images)
    assert set(found) == set(expected)
    for output, value in expected.items():
        np.testing.assert_allclose(found[output], value, rtol=1e-3, atol=1e-4, err_msg=output)
        assert np.ptp(found[output], axis=0).max() > 1e-4, f"{output} says nothing"


def test_the_command_names_what_an_ablation_answers(
    ablation, ablation_model, tmp_path, stand_in, capsys
):
    stand_in(lambda answer: answer)
    known = answers(weights.load(ablation_model)[1])
    arguments = [str(tmp_path / "out"), "--format", "savedmodel", "--weights", str(ablation_model)]
    for lacking in set(export_cli._OUTPUTS) - set(known):
        assert export_cli.main([*arguments, "--only", f"mask,{lacking}"]) == 1
        told = f"holds {ablation.description}; choose from {', '.join(known)}\n"
        assert capsys.readouterr().err.endswith(told)
        assert not (tmp_path / "out").exists()
    assert export_cli.main(arguments) == 0
    printed = capsys.readouterr().out.splitlines()[1:]
    assert tuple(line.split()[0] for line in printed) == known
    for name in known:
        assert export_cli.main([*arguments, "--only", name]) == 0


# A wrong model is refused. Files stand in for SavedModels, which take seconds to write.


@pytest.fixture
def stand_in(monkeypatch):
    """A function that sets what becomes of Keras' answer in the written model."""

    def change_answers(change):
        held = {}

        def write(network, path):
            held["network"] = network
            path.write_text(" ".join(network.output), encoding="utf-8")

        def run(path, images):
            return change({name: np.array(v) for name, v in held["network"](images).items()})

        monkeypatch.setattr(export, "write_saved_model", write)
        monkeypatch.setattr(export, "run_saved_model", run)

    return change_answers


def one_pixel(answer):
    out = np.zeros_like(answer["mask"])
    out[-1, -1, -1] = 1
    return out


WRONG = {
    "a value": lambda answer: answer | {"specular_albedo": answer["specular_albedo"] + 0.01},
    "one pixel": lambda answer: answer | {"mask": answer["mask"] + 0.01 * one_pixel(answer)},
    "not a number": lambda answer: answer | {"mask": answer["mask"] * np.nan},
    "a missing output": lambda answer: {k: v for k, v in answer.items() if k != "mask"},
    "another output": lambda answer: answer | {"normal": answer["mask"]},
    "a shape": lambda answer: answer | {"mask": answer["mask"][:1]},
}


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_a_model_that_answers_otherwise_is_refused(change, tiny_model, tmp_path, stand_in):
    stand_in(change)
    with pytest.raises(export.ParityError, match=r"differs from Keras|outputs"):
        export.export(tmp_path, "savedmodel", tiny_model)
    assert list(tmp_path.iterdir()) == []


def test_a_refused_or_failing_export_leaves_the_last_good_one(
    tiny_model, tmp_path, stand_in, monkeypatch
):
    stand_in(lambda answer: answer)
    export.export(tmp_path, "savedmodel", tiny_model, ["mask"])
    stand_in(WRONG["a value"])
    with pytest.raises(export.ParityError):
        export.export(tmp_path, "savedmodel", tiny_model, ["specular_albedo"])

    def fails(network, path):
        path.write_text("half a model", encoding="utf-8")
        raise RuntimeError("no space left")

    monkeypatch.setattr(export, "write_saved_model", fails)
    with pytest.raises(RuntimeError, match="no space"):
        export.export(tmp_path, "savedmodel", tiny_model)
    [path] = tmp_path.iterdir()
    assert path.name == "saved_model" and path.read_text(encoding="utf-8") == "mask"


def test_exporting_again_replaces_the_model(tiny_model, tmp_path, stand_in):
    stand_in(lambda answer: answer)
    (tmp_path / "saved_model").mkdir()
    (tmp_path / "partial-saved_model").mkdir()
    for only in ("mask", "specular_albedo"):
        assert export.export(tmp_path, "savedmodel", tiny_model, [only]) == {only: 0}
        [path] = tmp_path.iterdir()
        assert path.name == "saved_model" and path.read_text(encoding="utf-8") == only


def test_differences_are_relative_above_one():
    expected = {"mirror": np.array([0.5, 100.0]), "mask": np.array([0.0])}
    answer = {"mirror": np.array([0.6, 101.0]), "mask": np.array([-0.25])}
    assert export.compare(expected, answer) == pytest.approx({"mirror": 0.1, "mask": 0.25})


@pytest.mark.parametrize("size", [32, 64])
def test_proof_images_are_photos(size):
    images = export.proof_images(size)
    assert images.shape == (6, size, size, 3) and images.dtype == np.float32
    assert images.min() == 0 and images.max() == 1
    np.testing.assert_array_equal(images, export.proof_images(size))
    smooth, noisy = (np.abs(np.diff(image, axis=0)).mean() for image in images[2:4])
    assert 0 < smooth < noisy
