"""Fixtures of the tests of evaluations."""

import functools

import pytest


@pytest.fixture(scope="module")
def engines_opened_once():
    """Each model is loaded and traced once for all evaluations and reports of a module."""
    from lime_keras.eval.accuracy import evaluate
    from lime_keras.eval.report import examples
    from lime_keras.runtime.keras_engine import KerasEngine

    opened = functools.cache(KerasEngine)
    with pytest.MonkeyPatch.context() as patch:
        for module in (evaluate, examples):
            patch.setattr(module, "KerasEngine", opened)
        yield
