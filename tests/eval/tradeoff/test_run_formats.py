"""Every format and precision of a run answers as Keras does, as nearly as its bits allow."""

import dataclasses
import shutil

import numpy as np
import onnx
import pytest
import sphere_corpus
from onnx import numpy_helper

from lime_keras.data import pipeline
from lime_keras.eval.store import Store
from lime_keras.eval.tradeoff import runtimes
from lime_keras.eval.tradeoff.run_formats import EVERYTHING, PRECISIONS, Run
from lime_keras.eval.tradeoff.runtimes import KERAS, ONNX, SAVED_MODEL
from lime_keras.eval.tradeoff.samples import Samples
from lime_keras.export import parity, quantisation
from lime_keras.networks.precision import computing_in
from lime_keras.outputs import OUTPUTS

HALF = {"float16": 5e-3, "bfloat16": 5e-2}
"""A few units in the last of 11 and 8 bits."""


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """Without a test split: nothing that decides anything may need it."""
    folder = tmp_path_factory.mktemp("variants") / "corpus"
    return sphere_corpus.write_split(folder, "train", [range(6), range(6, 9)], size=32)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return Store(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="module")
def run(tiny_model, corpus, store):
    return Run("tiny", tiny_model, Samples(corpus, store, camera=False), store)


@pytest.fixture(scope="module")
def images():
    return parity.images(32)


@pytest.fixture(scope="module")
def of_keras(run, images):
    return run.answer(KERAS, "float32")(images)


ALL = [(runtime, name) for runtime, names in PRECISIONS.items() for name in names]
FAST = {("SavedModel", "float32")}
MARKED = [pytest.param(*pair, marks=() if pair in FAST else pytest.mark.slow) for pair in ALL]


@pytest.mark.parametrize(("runtime", "precision"), MARKED)
def test_a_variant_answers_within_its_precision(run, images, of_keras, runtime, precision):
    answer = dict(run.answer(runtime, precision)(images))
    assert all(value.dtype == np.float32 for value in answer.values())
    differences = parity.compare(of_keras, answer)
    largest = max(differences.values())
    if precision == "float32":
        assert largest < 1e-4
    elif precision in HALF:
        assert 1e-5 < largest < HALF[precision]
    else:
        # Eight bits of a network that was not trained for them.
        assert 1e-3 < largest < 0.5
        harm = quantisation.relative_error(of_keras, answer)
        assert 1e-4 < max(harm.values()) < 0.2


def test_kernels_have_the_bits_that_the_precision_says(run):
    def size(precision):
        tensors = onnx.load(run.path(ONNX, precision)).graph.initializer
        arrays = [numpy_helper.to_array(tensor) for tensor in tensors]
        return sum(array.nbytes for array in arrays if array.ndim >= 2)

    # Beside the kernels there are a few shapes and constants.
    assert size("float32") == pytest.approx(2 * size("float16"), rel=0.01)
    assert size("float32") / 4 < size("int8") < size("float16")


@pytest.mark.slow
def test_the_size_is_that_of_what_is_shipped(run):
    weights = 4 * run.costs["parts"][EVERYTHING]["parameters"]
    sizes = {pair: run.file_size(*pair) for pair in ALL}
    assert sizes[KERAS, "float32"] == sizes[KERAS, "bfloat16"] > weights
    assert sizes[SAVED_MODEL, "float32"] > weights < sizes[ONNX, "float32"]
    [folder] = {run.path(SAVED_MODEL, "float32")}
    assert sizes[SAVED_MODEL, "float32"] > (folder / "saved_model.pb").stat().st_size


def _kernels(path):
    """Bits of the heads' kernels in an ONNX file."""
    return {
        tensor.name: numpy_helper.to_array(tensor).dtype.itemsize * 8
        for tensor in onnx.load(path).graph.initializer
        if any(part.startswith(tuple(quantisation.HEADS)) for part in tensor.name.split("/"))
        and ("convolution/ReadVariableOp" in tensor.name or "Cast/ReadVariableOp" in tensor.name)
        and not tensor.name.endswith(("_scale", "_zero_point"))
    }


def test_heads_stay_in_floating_point(run):
    assert list(_kernels(run.path(ONNX, "int8")).values()) == [32] * 5


def test_a_part_answers_what_is_asked_of_it_and_no_more(run, images, of_keras):
    parts = run.costs["parts"]
    assert set(parts[EVERYTHING]["outputs"]) == set(OUTPUTS) - {"log_exponent", "reflectance_map"}
    for name in ("mask", "albedo"):
        answer = runtimes.open_answer(ONNX, run.part(name), "float32")(images)
        assert set(answer) == set(parts[name]["outputs"])
        expected = {output: of_keras[output] for output in answer}
        assert max(parity.compare(expected, dict(answer)).values()) < 1e-4
    costs = [parts[name]["gflop"] for name in ("mask", "specular", "mirror", "exponent")]
    assert costs == sorted(set(costs)) and costs[-1] < parts[EVERYTHING]["gflop"]
    sizes = [run.part(name).stat().st_size for name in ("mask", "albedo", EVERYTHING)]
    assert sizes == sorted(set(sizes))


def test_a_subnetwork_stands_alone(run):
    session = runtimes.session(run.subnetwork("albedo"))
    inputs = {one.name: one.shape[1:] for one in session.get_inputs()}
    assert inputs == {"masked_image": [32, 32, 3], "specular_shading": [32, 32, 1]}
    counted = sum(costs["gflop"] for costs in run.costs["subnetworks"].values())
    assert counted == pytest.approx(run.costs["parts"][EVERYTHING]["gflop"])


def test_an_ablation_has_the_parts_that_it_can_answer(ablation, ablation_model, corpus, tmp_path):
    store = Store(tmp_path)
    run = Run("ablation", ablation_model, Samples(corpus, store, camera=False), store)
    parts = run.costs["parts"]
    assert ("mirror" in parts) == (ablation.mirror and ablation.system == "lime")
    assert ("reflectance_map" in parts) == (ablation.system == "reflectance-map")
    assert run.costs["architecture"] == dataclasses.asdict(ablation)


def test_calibration_images_are_trained_on(run, corpus):
    trained, _ = pipeline.training_shards(corpus)
    [expected] = pipeline.evaluation(trained, size=32, batch_size=9).as_numpy_iterator()
    np.testing.assert_array_equal(run.samples.calibration(32), expected["image"])


def test_other_weights_are_another_run(run, tiny_model, tmp_path):
    copy = shutil.copytree(tiny_model, tmp_path / "model")
    before = Run("tiny", copy, run.samples, run._store)
    assert before.depends_on == run.depends_on
    (copy / "mirror.weights.h5").write_bytes(b"other")
    after = Run("tiny", copy, run.samples, run._store)
    assert after.depends_on != run.depends_on


def test_a_folder_without_a_model_is_refused(tmp_path, run):
    with pytest.raises(FileNotFoundError, match="holds no trained model"):
        Run("nothing", tmp_path, run.samples, run._store)


def test_keras_policy_is_put_back(run):
    import keras

    before = keras.config.dtype_policy()
    with pytest.raises(ZeroDivisionError), computing_in("bfloat16"):
        assert keras.config.dtype_policy().compute_dtype == "bfloat16"
        raise ZeroDivisionError
    assert keras.config.dtype_policy() == before
