"""An evaluation is taken from disk when nothing that it follows from has changed, and only then."""

import re

import keras
import numpy as np
import pytest
import source_copies
import sphere_corpus

from lime_keras.eval.accuracy import stored
from lime_keras.eval.accuracy.evaluate import evaluate
from lime_keras.eval.source_code import digest, imported
from lime_keras.eval.store import Store
from lime_keras.model import weights


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(tmp_path_factory.mktemp("corpus"), "test", [range(3)], size=32)


@pytest.fixture
def counted(monkeypatch):
    calls = []

    def counting(*arguments, **options):
        calls.append(arguments)
        return evaluate(*arguments, **options)

    monkeypatch.setattr(stored, "evaluate", counting)
    return calls


def test_a_second_call_measures_nothing_and_answers_the_same(corpus, tiny_model, tmp_path, counted):
    first = stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
    again = stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
    assert len(counted) == 1
    assert again.architecture == first.architecture
    assert np.array_equal(again.confusion, first.confusion)
    for kind in ("rows", "true_mask"):
        one, other = getattr(first, kind), getattr(again, kind)
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one)


@pytest.mark.slow
def test_photos_other_weights_and_broken_files_are_measured_anew(
    corpus, tiny_model, tmp_path, counted
):
    stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
    stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus, camera=True)
    assert len(counted) == 2
    architecture, subnetworks = weights.load(tiny_model)
    keras.utils.set_random_seed(9)
    head = subnetworks["albedo"].get_layer("albedos")
    head.bias.assign(head.bias + 0.1)
    weights.save(tmp_path / "other", architecture, subnetworks)
    stored.evaluation(Store(tmp_path / "kept"), tmp_path / "other", corpus)
    assert len(counted) == 3
    for path in (tmp_path / "kept" / "evaluations").glob("*.npz"):
        path.write_bytes(path.read_bytes()[:100])
    stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
    assert len(counted) == 4
    assert not list(tmp_path.rglob("partial-*"))


@pytest.mark.slow
def test_runs_do_not_push_each_other_out(corpus, tiny_model, tmp_path, counted):
    for camera in (False, True, False, True):
        stored.evaluation(Store(tmp_path), tiny_model, corpus, camera=camera)
    assert len(counted) == 2


def test_other_images_are_measured_anew(corpus, tiny_model, tmp_path, counted):
    stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
    other = sphere_corpus.write_split(tmp_path, "test", [range(3)], seed=1, size=32)
    stored.evaluation(Store(tmp_path / "kept"), tiny_model, other)
    assert len(counted) == 2


def test_a_constant_of_the_networks_that_changed_is_measured_anew(
    corpus, tiny_model, tmp_path, counted, monkeypatch
):
    """Nothing else has: the weights, the images and the version are the same."""
    copies = source_copies.write(tmp_path / "source")
    path = copies["lime_keras"] / "networks" / "registry.py"
    source = path.read_text(encoding="utf-8")
    changed = re.sub(r"^MASK_CONTRAST = .*$", "MASK_CONTRAST = 7.0", source, flags=re.MULTILINE)
    for text, evaluated in ((source, 1), (source, 1), (changed, 2), (changed, 2), (source, 3)):
        path.write_text(text, encoding="utf-8")
        now = digest(imported(stored.__name__, copies))
        monkeypatch.setattr(stored, "code_of", lambda *_, now=now: now)
        stored.evaluation(Store(tmp_path / "kept"), tiny_model, corpus)
        assert len(counted) == evaluated
    assert changed != source


def test_a_folder_without_a_model_is_named(corpus, tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-train"):
        stored.evaluation(Store(tmp_path / "kept"), tmp_path / "none", corpus)
