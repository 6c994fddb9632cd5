"""An evaluation is taken from disk when nothing that it follows from has changed, and only then."""

import keras
import numpy as np
import pytest
import sphere_corpus

from lime_keras.eval import kept
from lime_keras.eval.accuracy.evaluate import evaluate
from lime_keras.networks import weights


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(tmp_path_factory.mktemp("corpus"), "test", [range(3)], size=32)


@pytest.fixture
def counted(monkeypatch):
    calls = []

    def counting(*arguments, **options):
        calls.append(arguments)
        return evaluate(*arguments, **options)

    monkeypatch.setattr(kept, "evaluate", counting)
    return calls


def test_a_second_call_measures_nothing_and_answers_the_same(corpus, tiny_model, tmp_path, counted):
    first = kept.evaluation(tmp_path, tiny_model, corpus)
    again = kept.evaluation(tmp_path, tiny_model, corpus)
    assert len(counted) == 1
    assert again.architecture == first.architecture
    assert np.array_equal(again.confusion, first.confusion)
    for kind in ("rows", "oracle"):
        one, other = getattr(first, kind), getattr(again, kind)
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one)


def test_photos_other_weights_and_broken_files_are_measured_anew(
    corpus, tiny_model, tmp_path, counted
):
    kept.evaluation(tmp_path, tiny_model, corpus)
    kept.evaluation(tmp_path, tiny_model, corpus, camera=True)
    assert len(counted) == 2
    architecture, subnetworks = weights.load(tiny_model)
    keras.utils.set_random_seed(9)
    head = subnetworks["albedo"].get_layer("albedos")
    head.bias.assign(head.bias + 0.1)
    weights.save(tmp_path / "other", architecture, subnetworks)
    kept.evaluation(tmp_path, tmp_path / "other", corpus)
    assert len(counted) == 3
    path = tmp_path / f"{kept.key(tiny_model, corpus, camera=False)}.npz"
    path.write_bytes(path.read_bytes()[:100])
    kept.evaluation(tmp_path, tiny_model, corpus)
    assert len(counted) == 4
    assert not list(tmp_path.glob("partial-*"))


def test_a_folder_without_a_model_is_named(corpus, tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-train"):
        kept.evaluation(tmp_path, tmp_path / "none", corpus)
