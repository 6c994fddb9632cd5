"""A machine without TensorFlow says what it cannot do."""

import pytest
import without_tensorflow
from sphere_corpus import write_split


@pytest.mark.parametrize("backend", ["jax", "tensorflow"])
def test_what_needs_tensorflow_says_so(backend, tmp_path):
    if backend == "jax":
        pytest.importorskip("jax")
    corpus = write_split(tmp_path / "corpus", "train", [range(1)], size=32)
    done = without_tensorflow.start(
        corpus, "--out", tmp_path / "run", "--preset", "smoke", backend=backend
    )
    assert done.returncode == 1
    assert "error: TensorFlow is not installed: install it to read the records" in done.stderr
