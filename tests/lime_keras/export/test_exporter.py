"""SavedModel and ONNX answer as Keras does, or are not left behind."""

import functools
import json
import shutil

import numpy as np
import onnxruntime
import pytest

from lime_keras import __version__
from lime_keras.commands import export as export_cli
from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.export import exporter, formats, parity, quantisation
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file, weights
from lime_keras.networks import assemble, output_names
from lime_keras.optics import gloss
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime import onnx_graphs
from lime_keras.runtime.keras_engine import KerasEngine
from lime_keras.runtime.saved_model import SERVED, SavedModel

FORMATS = ("savedmodel", "onnx")
# A SavedModel takes long to write, and is no other for an ablation or a part of the outputs.
ONE_IS_SLOW = (pytest.param("savedmodel", marks=pytest.mark.slow), "onnx")

OF_LIME = set(OUTPUTS) - {"log_exponent", "reflectance_map"}


def opened(folder, model_format, only=None):
    """What answers everything in an exported model."""
    path = exporter.target(folder, model_format, only=only)
    if model_format == "onnx":
        return onnx_graphs.open_file(path)
    return SavedModel(path)


def answers(engine, images):
    return engine.run(engine.outputs, {"image": images})


@pytest.fixture(scope="module", params=FORMATS)
def exported(request, tiny_export):
    """A whole model in one format: its folder, format and differences."""
    folder, differences = tiny_export(request.param)
    return folder, request.param, differences


@pytest.fixture(scope="module")
def network(tiny_model):
    return assemble(weights.load(tiny_model)[1])


def fresh(batch, size=32):
    return np.random.default_rng(batch).uniform(size=(batch, size, size, 3)).astype(np.float32)


def test_differences_are_reported_and_small(exported):
    folder, model_format, differences = exported
    assert set(differences) == {"extremes"} and set(differences["extremes"]) == OF_LIME
    assert all(0 <= difference <= 1e-4 for difference in differences["extremes"].values())
    expected = {"savedmodel": "saved_model/1", "onnx": "lime.onnx"}[model_format]
    path = exporter.target(folder, model_format)
    assert path == folder / expected and path.exists()
    assert len(list(folder.iterdir())) == len(list(path.parent.iterdir())) == 1


@pytest.mark.parametrize("batch", [1, 3])
def test_fresh_images_in_any_batch_agree_with_keras(batch, exported, network):
    folder, model_format, _ = exported
    expected, found = network(fresh(batch)), answers(opened(folder, model_format), fresh(batch))
    assert set(found) == OF_LIME
    for name in OF_LIME:
        assert found[name].dtype == np.float32
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-3, atol=1e-4, err_msg=name)
        if found[name].ndim == 4:
            assert np.ptp(found[name]) > 1e-3, f"{name} says nothing"


def test_the_file_describes_itself(exported, tiny):
    folder, model_format, _ = exported
    found = description(exporter.target(folder, model_format))
    assert found["version"] == __version__ and found["precision"] == "float32"
    assert found["architecture"]["unet_width"] == tiny.unet_width
    assert set(found["outputs"]) == OF_LIME


def description(path):
    """The model card, read without this package."""
    if path.is_dir():
        return json.loads((path / "assets.extra" / "lime.json").read_text(encoding="utf-8"))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    texts = session.get_modelmeta().custom_metadata_map
    plain = ("package", "version", "description", "precision", "input_layout", "colour_space")
    plain = (*plain, "normalisation", "lobe")
    return {k: text if k in plain else json.loads(text) for k, text in texts.items()}


@pytest.mark.parametrize("model_format", ONE_IS_SLOW)
def test_only_what_is_asked_for_is_exported(model_format, tiny_model, tmp_path, network):
    only = ["mask", "specular_albedo"]
    differences = exporter.export(tmp_path, model_format, tiny_model, only)
    assert set(differences["extremes"]) == set(only)
    found = answers(opened(tmp_path, model_format, only), fresh(2))
    assert set(found) == set(only)
    for output, expected in network(fresh(2)).items():
        if output in only:
            np.testing.assert_allclose(found[output], expected, rtol=1e-3, atol=1e-4)


def test_an_unknown_output_or_no_model_is_refused(tiny_model, tmp_path):
    with pytest.raises(ValueError, match="normals"):
        exporter.export(tmp_path / "out", "onnx", tiny_model, ["normals"])
    with pytest.raises(FileNotFoundError, match="lime-train"):
        exporter.export(tmp_path / "out", "onnx", tmp_path)
    assert not (tmp_path / "out").exists()


# Fewer bits, and a corpus.


@pytest.mark.parametrize("precision", [pytest.param("float16", marks=pytest.mark.slow), "int8"])
def test_fewer_bits_are_compared_on_pictures_and_on_extremes(
    precision, tiny_model, network, corpus, tmp_path
):
    differences = exporter.export(
        tmp_path, "onnx", tiny_model, ["mask", "mirror"], precision=precision, corpus=corpus
    )
    assert set(differences) == {"extremes", "pictures"}
    for of_each in differences.values():
        assert set(of_each) == {"mask", "mirror"}
        assert 0 < max(of_each.values()) < parity.GROSS[precision]
    path = tmp_path / f"lime-mask+mirror-{precision}.onnx"
    assert list(tmp_path.iterdir()) == [path]
    assert path == exporter.target(tmp_path, "onnx", precision, ["mask", "mirror"])
    assert description(path)["precision"] == precision
    images = parity.images(32)
    expected = {name: np.array(value) for name, value in network(images).items()}
    expected = {name: expected[name] for name in ("mask", "mirror")}
    harm = quantisation.relative_error(expected, answers(onnx_graphs.open_file(path), images))
    assert harm == pytest.approx(differences["extremes"], rel=0.05)


def test_eight_bits_are_calibrated_on_what_was_trained_on(
    tiny_model, corpus, tmp_path, monkeypatch
):
    seen = []

    def unchanged(source, path, reader, **_):
        seen.append(np.concatenate([one["image"] for one in iter(reader.get_next, None)]))

    monkeypatch.setattr(quantisation.quantization, "quantize_static", unchanged)
    exporter.export(tmp_path, "onnx", tiny_model, ["mask"], precision="int8", corpus=corpus)
    [images] = seen
    np.testing.assert_array_equal(images, exporter.corpus_pictures(corpus, "train", 32))
    # The second shard is held out.
    assert images.shape == (4, 32, 32, 3)


def test_pictures_are_those_of_the_test_split(tiny_model, corpus, tmp_path, stand_in):
    shown = []
    stand_in(lambda answer: answer, seen=shown)
    differences = exporter.export(tmp_path, "savedmodel", tiny_model, ["mask"], corpus=corpus)
    assert set(differences) == {"extremes", "pictures"}
    assert all(value["mask"] < 1e-6 for value in differences.values())
    shards = Split(corpus, "test").shard_paths()
    shots = pipeline.evaluation(shards, size=32, batch_size=9, camera=True, features=("image",))
    [batch] = shots.as_numpy_iterator()
    assert len(batch["image"]) == 4
    np.testing.assert_array_equal(np.concatenate(shown)[-4:], batch["image"])


def test_weights_in_half_the_space_are_used_as_any(tiny_model, network, tmp_path, capsys):
    out, record = tmp_path / "small", '{"config": {}}'
    run = tmp_path / "run"
    shutil.copytree(tiny_model, run / "model")
    (run / "model" / "training.json").write_text(record, encoding="utf-8")
    (run / "model" / gloss_file.NAME).write_text('{"even": 1.5, "slope": 2.5}', encoding="utf-8")
    tiny_model = run
    arguments = [str(out), "--format", "weights", "--weights", str(tiny_model)]
    assert export_cli.main(arguments) == 0
    assert "small/model, float16" in capsys.readouterr().out
    _, narrow = weights.load(out)
    found = assemble(narrow)(fresh(2))
    differences = [np.abs(found[name] - x).max() for name, x in network(fresh(2)).items()]
    assert 0 < max(differences) < 0.01
    card = json.loads((out / "model" / "lime.json").read_text(encoding="utf-8"))
    assert card["precision"] == "float16" and card["colour_space"] == "sRGB"
    assert (out / "model" / "training.json").read_text(encoding="utf-8") == record
    assert gloss_file.read(out) == gloss.Calibration(1.5, 2.5)
    with pytest.raises(ValueError, match="leave out what is to be answered"):
        exporter.export(out, "weights", tiny_model, ["mask"])
    with pytest.raises(ValueError, match="the format weights is float16, not float32"):
        exporter.export(out, "weights", tiny_model, precision="float32")


def test_graphs_of_another_model_replace_the_first_ones_records(tmp_path):
    def model(name, *files):
        (tmp_path / name / "model").mkdir(parents=True)
        for file in files:
            (tmp_path / name / "model" / file).write_text(name, encoding="utf-8")
        return tmp_path / name

    def there(run):
        return {path.name: path.read_text() for path in (run / "model").iterdir()}

    first = model("first", "architecture.json", "gloss.json", "mask.weights.h5")
    second, out = model("second", "architecture.json"), tmp_path / "out"
    exporter._complete(out, first, is_other=True)
    assert there(out) == {"architecture.json": "first", "gloss.json": "first"}
    (out / "model" / "gloss.json").write_text("fitted", encoding="utf-8")
    exporter._complete(out, first, is_other=False)
    assert there(out)["gloss.json"] == "fitted"
    exporter._complete(out, second, is_other=True)
    assert there(out) == {"architecture.json": "second"}
    before = there(first)
    for source in (first, second):  # a model with weights of its own, and the same folder
        exporter._complete(first, source, is_other=True)
        assert there(first) == before
    exporter._complete(second, second / "model", is_other=True)
    assert there(second) == {"architecture.json": "second"}


@pytest.mark.slow
def test_without_weights_the_packages_own_are_exported(tmp_path):
    assert export_cli.main([str(tmp_path), "--format", "weights"]) == 0
    found, _ = weights.load(tmp_path)
    assert found == weights.load(model_folder.DEFAULT)[0]


@pytest.mark.slow
def test_a_set_is_put_into_the_package(sets, tiny_model, tmp_path, capsys):
    """As `make ship` and, again and again, `make graphs` do; the graphs stay the same bytes."""
    package, run = sets("live"), tmp_path / "run"
    weights.save(run / "model", *weights.load(tiny_model), half=True)
    made = package / "nano"
    assert export_cli.main([str(made), "--format", "weights", "--weights", str(run)]) == 0
    graphs = ["--format", "graphs", "--weights"]
    assert export_cli.main([str(made), *graphs, str(made)]) == 0
    for path in (made / "model").glob("*.weights.h5"):
        path.unlink()
    expected = weights.load(run)[1]
    held = {path.name: path.read_bytes() for path in (made / "onnx").iterdir()}
    for _ in range(2):
        found = weights.load(model_folder.find("nano"))[1]
        for name, network in expected.items():
            pairs = zip(found[name].get_weights(), network.get_weights(), strict=True)
            assert all(np.array_equal(one, other) for one, other in pairs), name
        assert export_cli.main([str(made), *graphs, "nano"]) == 0
        assert held == {path.name: path.read_bytes() for path in (made / "onnx").iterdir()}
        assert model_folder.has_weights_in_graphs(made)


def test_a_precision_that_cannot_be_had_is_refused(tiny_model, tmp_path, capsys):
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="the format savedmodel is float32, not float16"):
        exporter.export(out, "savedmodel", tiny_model, precision="float16")
    with pytest.raises(ValueError, match="int8 is calibrated"):
        exporter.export(out, "onnx", tiny_model, precision="int8")
    arguments = [str(out), "--weights", str(tiny_model), "--precision", "int8", "--format"]
    for model_format, told in (("savedmodel", "is for --format onnx"), ("onnx", "--corpus")):
        with pytest.raises(SystemExit) as stopped:
            export_cli.main([*arguments, model_format])
        assert stopped.value.code == 2 and told in capsys.readouterr().err
    assert not out.exists()


def test_a_corpus_that_is_not_rendered_is_told(tiny_model, tmp_path, capsys):
    arguments = [str(tmp_path / "out"), "--format", "onnx", "--weights", str(tiny_model)]
    assert export_cli.main([*arguments, "--corpus", str(tmp_path / "nothing")]) == 1
    assert "lime-render" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


# The ablations.


@pytest.mark.parametrize("model_format", ONE_IS_SLOW)
def test_ablations_agree_with_keras(model_format, ablation_model, tmp_path):
    subnetworks = weights.load(ablation_model)[1]
    differences = exporter.export(tmp_path, model_format, ablation_model)["extremes"]
    assert set(differences) == set(output_names(subnetworks))
    assert all(0 <= difference <= 1e-4 for difference in differences.values())
    images = np.concatenate([parity.images(32), fresh(3)])
    expected, found = assemble(subnetworks)(images), answers(opened(tmp_path, model_format), images)
    assert set(found) == set(expected)
    for output, value in expected.items():
        np.testing.assert_allclose(found[output], value, rtol=1e-3, atol=1e-4, err_msg=output)
        assert np.ptp(found[output], axis=0).max() > 1e-4, f"{output} says nothing"


def test_the_command_names_what_an_ablation_answers(
    ablation, ablation_model, tmp_path, stand_in, capsys
):
    stand_in(lambda answer: answer)
    known = output_names(weights.load(ablation_model)[1])
    arguments = [str(tmp_path / "out"), "--format", "savedmodel", "--weights", str(ablation_model)]
    for lacking in set(OUTPUTS) - set(known):
        assert export_cli.main([*arguments, "--only", f"mask,{lacking}"]) == 1
        told = f"holds {ablation.description}; choose from {', '.join(known)}\n"
        assert capsys.readouterr().err.endswith(told)
        assert not (tmp_path / "out").exists()
    assert export_cli.main(arguments) == 0
    title, columns, *rows = capsys.readouterr().out.splitlines()
    assert title.startswith(f"{tmp_path / 'out' / 'saved_model' / '1'}, float32, ")
    assert columns.split() == ["extremes"]
    assert tuple(line.split()[0] for line in rows) == known
    assert all(float(line.split()[1]) < 1e-6 for line in rows)
    assert export_cli.main([*arguments, "--only", ",".join(known)]) == 0


# A wrong model is refused. Files stand in for SavedModels, which take seconds to write, and what
# they are compared with is loaded once.


@pytest.fixture(scope="module")
def loaded():
    return functools.cache(KerasEngine)


@pytest.fixture
def stand_in(loaded, monkeypatch):
    """A function that sets what becomes of Keras' answer in the written model."""

    def change_answers(change, signature=None, seen=None):
        """Of one signature, or of all; `seen` collects what they are shown."""
        held = {}

        def write(network, path):
            held.clear()
            held["network"] = network
            path.mkdir()
            (path / "outputs").write_text(" ".join(network.output), encoding="utf-8")

        def answer(name, images):
            if seen is not None:
                seen.append(images)
            if images.tobytes() not in held:
                found = {key: np.array(v) for key, v in held["network"](images).items()}
                held[images.tobytes()] = found
            found = held[images.tobytes()]
            if name != SERVED:
                found = {name: found[name]}
            return change(found) if signature in (None, name) else found

        class Written:
            def __init__(self, path):
                images = parity.images(held["network"].input.shape[1])[:1]
                found = {key: np.array(v) for key, v in held["network"](images).items()}
                self.outputs = tuple(found if signature == "mask" else change(found))

            def run(self, outputs, given):
                whole = len(outputs) == len(self.outputs)
                return answer(SERVED if whole else outputs[0], given["image"])

        monkeypatch.setattr(formats, "write_saved_model", write)
        monkeypatch.setattr(exporter, "SavedModel", Written)
        monkeypatch.setattr(exporter, "KerasEngine", loaded)

    return change_answers


def left_in(folder):
    """What the models in a folder, standing in, answer, by the names of their folders."""
    assert {path.name for base in folder.iterdir() for path in base.iterdir()} == {"1"}
    return {base.name: (base / "1" / "outputs").read_text() for base in folder.iterdir()}


def half_a_per_cent(answer):
    return answer | {"specular_albedo": answer["specular_albedo"] + 0.005}


def test_a_model_that_answers_otherwise_is_refused(tiny_model, tmp_path, stand_in):
    stand_in(half_a_per_cent, signature=SERVED)
    with pytest.raises(parity.ParityError, match=r"differs from Keras.*specular_albedo"):
        exporter.export(tmp_path, "savedmodel", tiny_model)
    assert list(tmp_path.iterdir()) == []


def test_one_signature_that_answers_otherwise_is_enough(tiny_model, tmp_path, stand_in):
    def change(by):
        return lambda answer: {"mask": answer["mask"] + by}

    stand_in(change(0.01), signature="mask")
    with pytest.raises(parity.ParityError, match="differs from Keras"):
        exporter.export(tmp_path, "savedmodel", tiny_model)
    assert list(tmp_path.iterdir()) == []
    stand_in(change(5e-4), signature="mask")
    differences = exporter.export(tmp_path, "savedmodel", tiny_model)["extremes"]
    assert differences.pop("mask") == pytest.approx(5e-4, rel=1e-3)
    assert max(differences.values()) < 1e-6


def test_a_refused_or_failing_export_leaves_the_last_good_one(
    tiny_model, tmp_path, stand_in, monkeypatch
):
    stand_in(lambda answer: answer)
    exporter.export(tmp_path, "savedmodel", tiny_model, ["mask"])
    stand_in(half_a_per_cent)
    with pytest.raises(parity.ParityError):
        exporter.export(tmp_path, "savedmodel", tiny_model, ["specular_albedo"])
    with pytest.raises(parity.ParityError):
        exporter.export(tmp_path, "savedmodel", tiny_model)

    def fails(network, path):
        path.write_text("half a model", encoding="utf-8")
        raise RuntimeError("no space left")

    monkeypatch.setattr(formats, "write_saved_model", fails)
    with pytest.raises(RuntimeError, match="no space"):
        exporter.export(tmp_path, "savedmodel", tiny_model, ["mask"])
    assert left_in(tmp_path) == {"saved_model-mask": "mask"}


@pytest.mark.parametrize(
    ("model_format", "place"),
    [
        ("weights", "model"),
        ("graphs", "onnx"),
        ("graphs", "model"),
        ("savedmodel", "saved_model/1"),
    ],
)
def test_what_is_no_export_is_not_replaced(tiny_model, tmp_path, model_format, place):
    (tmp_path / place).mkdir(parents=True)
    (tmp_path / place / "thesis.json").touch()
    with pytest.raises(ValueError, match=f"{place} holds other files, which would be lost: pass"):
        exporter.export(tmp_path, model_format, tiny_model)
    assert [path.name for path in tmp_path.rglob("*.*")] == ["thesis.json"]


def test_graphs_lie_beside_no_other_weights(tiny_model, tmp_path):
    shutil.copytree(tiny_model, tmp_path / "model")
    [path, *_] = (tmp_path / "model").glob("*.weights.h5")
    path.write_bytes(path.read_bytes() + b"others")
    with pytest.raises(ValueError, match="model holds other weights: pass --weights"):
        exporter.export(tmp_path, "graphs", tiny_model)


def test_exporting_again_replaces_the_model(tiny_model, tmp_path, stand_in):
    stand_in(lambda answer: answer)
    (tmp_path / "saved_model" / "1").mkdir(parents=True)
    (tmp_path / "saved_model" / "partial-1").mkdir()
    everything = " ".join(output_names(weights.load(tiny_model)[1]))
    for _ in range(2):
        exporter.export(tmp_path, "savedmodel", tiny_model)
        assert left_in(tmp_path) == {"saved_model": everything}
        (tmp_path / "saved_model" / "1" / "outputs").write_text("of before")


def test_a_part_of_a_model_takes_the_place_of_no_other(tiny_model, tmp_path, stand_in):
    stand_in(lambda answer: answer)
    for only in (None, ["mask"], ["specular_albedo", "mask"]):
        exporter.export(tmp_path, "savedmodel", tiny_model, only)
    assert left_in(tmp_path) == {
        "saved_model": " ".join(output_names(weights.load(tiny_model)[1])),
        "saved_model-mask": "mask",
        "saved_model-mask+specular_albedo": "specular_albedo mask",
    }
    names = [
        exporter.target(tmp_path, "onnx", precision, only).name
        for precision in ("float32", "int8")
        for only in (None, ["exponent_bin_probabilities", "mask"], ("mask", "mask"))
    ]
    assert names == [
        *("lime.onnx", "lime-mask+exponent_bin_probabilities.onnx", "lime-mask.onnx"),
        "lime-int8.onnx",
        *("lime-mask+exponent_bin_probabilities-int8.onnx", "lime-mask-int8.onnx"),
    ]
