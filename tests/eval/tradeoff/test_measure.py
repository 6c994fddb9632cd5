"""Which times are kept, and which are measured again."""

import shutil

import pytest

from lime_keras.eval.tradeoff import cases, measure, models, timing
from lime_keras.eval.tradeoff.cases import TimedUse
from lime_keras.model import folder as model_folder

CASES = [TimedUse(name, cases.PHOTO, "mask") for name in ("live", "best")]
INTERRUPTED_AT = 5  # of the 6 measurements of both cases


@pytest.fixture
def timed(tiny_model, tmp_path, monkeypatch):
    """Time some of the cases; returns the names of those that were, and when that was."""
    runs = {one.model: shutil.copytree(tiny_model, tmp_path / one.model) for one in CASES}
    monkeypatch.setattr(models, "size", lambda case, path: 0)

    def run(*chosen):
        measured = []

        def once(case, path, picture):
            measured.append(case.model)
            if len(measured) == INTERRUPTED_AT:
                raise KeyboardInterrupt
            return {"seconds": [0.1], "cold_start_s": 1.0}

        monkeypatch.setattr(timing, "measure", once)
        chosen_runs = {case.model: runs[case.model] for case in chosen}
        try:
            rows, at = measure._timed(dict.fromkeys(chosen), chosen_runs, tmp_path / "kept")
        except KeyboardInterrupt:
            return measured, None
        assert [row["model"] for row in rows] == [case.model for case in chosen]
        return measured, at

    return run


def test_a_stopped_command_goes_on_and_says_from_when_to_when(timed):
    measured, _ = timed(*CASES)
    assert measured == ["live", "best", "live", "best", "live"]
    measured, (first, last) = timed(*CASES)
    assert measured == ["live", "best"]
    assert first <= last and first.endswith("+00:00")
    assert timed(*CASES) == ([], [first, last])


def test_another_list_of_models_is_timed_anew(timed):
    assert timed(CASES[0])[0] == ["live"] * 3
    timed(*CASES)
    assert timed(CASES[0])[0] == []
    assert timed(CASES[1])[0] == ["best"] * 3


def test_graphs_are_written_again_by_other_code(tiny_model, tmp_path, monkeypatch):
    written = []

    def export(home, kind, run, *, precision, corpus):
        written.append(models.kept.code())
        target = model_folder.graphs(home, precision)
        shutil.copytree(model_folder.graphs(run), target, dirs_exist_ok=True)

    monkeypatch.setattr(models.exporter, "export", export)
    case = TimedUse("tiny", cases.PHOTO, "mask", precision="float16")
    for version in ("1", "1", "2"):
        monkeypatch.setattr(models.kept, "code", lambda version=version: version)
        assert models.path(case, {"tiny": tiny_model}, tmp_path, tmp_path) == tmp_path / "tiny"
    assert written == ["1", "2"]
