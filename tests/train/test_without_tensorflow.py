"""A machine that has JAX alone trains on photos that are made, and says what it cannot do."""

import shutil

import pytest
import without_tensorflow
from sphere_corpus import write_split

from lime_keras import networks
from lime_keras.model import weights
from lime_keras.train import cli
from lime_keras.train.stages import SCHEDULES, Schedule


@pytest.mark.parametrize(
    "backend, expected",
    [
        pytest.param(
            *("jax", "making photos needs tensorflow: pip install"), marks=pytest.mark.slow
        ),
        ("tensorflow", "this command needs tensorflow: pip install"),
    ],
)
def test_what_needs_tensorflow_says_so(backend, expected, tmp_path):
    if backend == "jax":
        pytest.importorskip("jax")
    corpus = write_split(tmp_path / "corpus", "train", [range(2), range(2)], size=32)
    done = without_tensorflow.start(
        corpus, "--out", tmp_path / "run", "--preset", "smoke", backend=backend
    )
    assert done.returncode == 1
    assert f"error: {expected}" in done.stderr


def test_kept_photos_are_trained_on(tmp_path, monkeypatch):
    pytest.importorskip("jax")
    monkeypatch.setitem(
        networks.PRESETS, "smoke", networks.Architecture(*without_tensorflow.ARCHITECTURE)
    )
    monkeypatch.setitem(SCHEDULES, "smoke", Schedule(*without_tensorflow.SCHEDULE))
    corpus = write_split(tmp_path / "corpus", "train", [range(4), range(4, 7)], size=32)
    options = ["--preset", "smoke", "--stages", "exponent"]
    assert cli.main([str(corpus), "--out", str(tmp_path / "made"), *options]) == 0
    shutil.copytree(tmp_path / "made" / "photos", tmp_path / "run" / "photos")
    done = without_tensorflow.start(corpus, "--out", tmp_path / "run", *options)
    assert done.returncode == 0, done.stderr[-4000:]
    _, trained = weights.load(tmp_path / "run", whole=False)
    assert list(trained) == ["exponent"]
