"""Refusals: what counts as one."""

import pytest

from lime_keras.eval.stability.verdicts import Case
from tests.stability.refusals import UnrefusedError, refusal


def judged(outcome):
    return Case("part", "case", "float32", lambda: outcome).judge()


def raising(error):
    def action():
        raise error

    return action


def test_a_refusal_passes_with_its_words():
    outcome = refusal(raising(ValueError("3 pixels are NaN: repair\nthem")), "NaN", "repair")
    verdict = judged(outcome)
    assert verdict.passed and verdict.note == "refused: 3 pixels are NaN: repair"
    assert (verdict.value, verdict.reference, verdict.error) == (None, None, None)


def test_a_refusal_in_other_words_or_none_fails():
    with pytest.raises(UnrefusedError, match=r"without saying \['NaN'\]"):
        refusal(raising(ValueError("no")), "NaN")
    with pytest.raises(UnrefusedError, match="answered with a float"):
        refusal(lambda: 1.0)
    with pytest.raises(KeyError):
        refusal(raising(KeyError("shape")))
