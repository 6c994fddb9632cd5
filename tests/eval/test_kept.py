"""A result is taken from disk while what it follows from is the same, and only then."""

import numpy as np
import pytest
import sphere_corpus

from lime_keras.eval import kept
from lime_keras.eval.accuracy.evaluate import evaluate

pytestmark = pytest.mark.usefixtures("engines_opened_once")


@pytest.fixture
def counted(monkeypatch):
    calls = []

    def counting(*arguments, **options):
        calls.append(arguments)
        return evaluate(*arguments, **options)

    monkeypatch.setattr(kept, "evaluate", counting)
    return calls


def test_a_second_call_measures_nothing_and_answers_the_same(
    corpus, tiny_model, tmp_path, counted, monkeypatch
):
    first = kept.evaluation(tmp_path, tiny_model, corpus)
    again = kept.evaluation(tmp_path, tiny_model, corpus)
    assert len(counted) == 1 and again.architecture == first.architecture
    for kind in ("rows", "true_mask"):
        one, other = getattr(first, kind), getattr(again, kind)
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one)
    [file] = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:100])
    kept.evaluation(tmp_path, tiny_model, corpus)
    assert len(counted) == 2
    monkeypatch.setattr(kept, "code", lambda: "changed")
    kept.evaluation(tmp_path, tiny_model, corpus)
    assert len(counted) == 3


def test_other_images_are_measured_anew(corpus, tiny_model, tmp_path, counted):
    other = sphere_corpus.write_split(tmp_path / "other", "test", [range(3)], seed=2, size=32)
    for images in (corpus, other, corpus, other):
        kept.evaluation(tmp_path / "kept", tiny_model, images)
    assert len(counted) == 2


def test_a_value_follows_from_its_inputs_and_the_version(tmp_path, monkeypatch):
    made = []

    def make():
        made.append(1)
        return {"pair": (len(made), 2)}

    for _ in range(2):
        assert kept.value(tmp_path, "x/y", {"a": (1, 2)}, make) == {"pair": [1, 2]}
    assert kept.value(tmp_path, "x/y", {"a": 2}, make) == {"pair": [2, 2]}
    monkeypatch.setattr(kept, "__version__", "of another day")
    assert kept.value(tmp_path, "x/y", {"a": 2}, make) == {"pair": [3, 2]}
    for path in (tmp_path / "x").iterdir():
        path.write_text("{", encoding="utf-8")
    assert kept.value(tmp_path, "x/y", {"a": 2}, make) == {"pair": [4, 2]}
    with pytest.raises(ValueError):
        kept.value(tmp_path, "nan", {}, lambda: float("nan"))


def test_a_folder_without_a_model_is_named(corpus, tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-train"):
        kept.evaluation(tmp_path, tmp_path / "none", corpus)
