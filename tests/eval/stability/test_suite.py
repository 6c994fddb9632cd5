"""The suite of whole systems: its tables, what it refuses, and that it turns when one breaks."""

import json
import math

import keras
import numpy as np
import pytest

from lime_keras.estimate import pictures
from lime_keras.eval.stability import suite
from lime_keras.eval.stability.verdicts import Verdict
from lime_keras.export import exporter
from lime_keras.networks import registry, wiring
from lime_keras.runtime import onnx_graphs
from lime_keras.runtime.keras_engine import KerasEngine
from tests.stability.cases import exponent, networks

CASES = networks.cases()


@pytest.fixture(scope="module")
def verdicts():
    """Verdicts with and without derivatives, and refusals, of two parts."""
    precisions = {"cross-entropy": ("float32",), "bins": ("NumPy float32", "NumPy float64")}
    chosen = [c for c in exponent.cases() if c.precision in precisions.get(c.part, ())]
    return {case.id: case.judge() for case in chosen}


def test_the_tables_hold_every_verdict(verdicts):
    text = suite.markdown(list(verdicts.values()))
    rows = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in text.splitlines()]
    for verdict in verdicts.values():
        assert any(row[:2] == [verdict.case, verdict.precision] for row in rows), verdict.case
    tables = [line for line in text.splitlines() if line.startswith("|")]
    parts = len({verdict.part for verdict in verdicts.values()})
    # Each table has a header and a rule, the first a row for each part and their sum.
    assert len(tables) == len(verdicts) + 2 * (parts + 1) + parts + 1
    assert ["all", str(len(verdicts)), str(len(verdicts)), "0"] in rows
    for table in text.split("\n\n"):
        assert len({len(line) for line in table.splitlines()}) == 1


def test_json_holds_every_verdict(verdicts):
    kept = json.loads(json.dumps(suite.to_json(verdicts.values()), allow_nan=False))
    assert len(kept) == len(verdicts)
    for row, verdict in zip(kept, verdicts.values(), strict=True):
        numbers = {
            name: float(x) if x in ("nan", "inf", "-inf") else x
            for name, x in row.items()
            if name not in ("part", "case", "note")
        }
        again = Verdict(**row | numbers)
        assert again == verdict or math.isnan(again.value)


def test_failures_are_told_apart():
    broken = Verdict("lobe", "s = 1", "float32", 1.0, None, 2.0, 1.0, 0.1, passed=False)
    right = Verdict("lobe", "s = 2", "float32", 2.0, None, 2.0, 0.0, 0.1, passed=True)
    assert suite.failures([broken, right]) == [broken]
    rows = [line.split() for line in suite.markdown([broken, right]).replace("|", " ").splitlines()]
    assert ["all", "2", "1", "1"] in rows
    assert [row for row in rows if "FAILED" in row and "1" in row] and "passed" in str(rows)


def test_a_folder_without_a_model_is_refused_before_anything_is_tried(tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-train"):
        suite.cases(tmp_path)


def test_another_backend_is_refused(monkeypatch):
    monkeypatch.setattr(keras.backend, "backend", lambda: "jax")
    with pytest.raises(ValueError, match="unset KERAS_BACKEND"):
        suite.run(CASES)


def test_a_trained_model_is_tried(tiny_model):
    assert {case.part for case in suite.cases(tiny_model)} == {"trained system"}
    tried = [
        case.judge()
        for case in suite.cases(tiny_model)
        if case.name in ("constant", "black") and case.precision == "float32"
    ]
    assert len(tried) == 2 and not suite.failures(tried)


# The suite can fail. Each of these is a mistake that could be made, and the case that it breaks.


class Careless:
    """NumPy to which all values look right."""

    def __getattr__(self, name):
        return getattr(np, name)

    def all(self, values):
        return True


BROKEN = {
    "estimates unchecked": ("a NaN pixel, refused", pictures, "np", Careless()),
    "a network that answers compressed": (
        "constant",
        wiring,
        "OUTPUT_ROWS",
        registry.OUTPUT_ROWS | {"mirror": registry.OutputRow("mirror")},
    ),
}


@pytest.mark.parametrize("name, module, replaced, broken", BROKEN.values(), ids=BROKEN)
def test_a_mistake_turns_verdicts(name, module, replaced, broken, monkeypatch):
    monkeypatch.setattr(module, replaced, broken)
    sought = ("fresh LIME", name, "float32")
    [case] = [c for c in networks.cases() if (c.part, c.name, c.precision) == sought]
    assert suite.failures([case.judge()])


def test_an_export_that_answers_otherwise_turns_verdicts(monkeypatch):
    class Shifted(KerasEngine):
        def run(self, outputs, given):
            return {name: value + 1e-3 for name, value in super().run(outputs, given).items()}

    [case] = [c for c in networks.cases() if c.precision == "ONNX" and c.name == "constant"]
    trial = case.measure.args[0]
    monkeypatch.setattr(exporter, "export", lambda *_: None)
    monkeypatch.setattr(onnx_graphs, "open_file", lambda path: Shifted(trial.folder))
    assert suite.failures([case.judge()])
