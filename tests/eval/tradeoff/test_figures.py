"""The picture of the trade, and its tables."""

import io

import numpy as np
import pytest
import trade
from PIL import Image

from lime_keras.eval.tradeoff import recommendation, table
from lime_keras.eval.tradeoff.cases import PAGE
from lime_keras.eval.tradeoff.figures import pareto

RESULT = {
    "machine": {
        **{"processor": "P", "cores": 2, "instructions": ["avx2"], "memory_gib": 8.0},
        **{"system": "S", "python": "3.11", "packages": {"numpy": "2"}},
    },
    "timed": ["2026-01-01T10:00+00:00", "2026-01-01T11:00+00:00"],
    "load": 0.1,
    "corpus": "corpus",
    "camera": False,
    "count": 1000,
    "rounds": 3,
    "scored": ["log_exponent_mae"],
    "rows": trade.ROWS,
    "refused": {"nano in int8": "too far"},
    "advice": recommendation.advise(trade.ROWS),
}


def test_the_picture_follows_the_rows():
    whole = np.asarray(Image.open(io.BytesIO(pareto(RESULT))))
    slower = [
        row | {"ms": 3 * row["ms"] if row["model"] == "best" else row["ms"]} for row in trade.ROWS
    ]
    assert pareto(RESULT | {"rows": slower}) != pareto(RESULT)
    without = [row for row in trade.ROWS if row["kind"] != PAGE]
    narrow = np.asarray(Image.open(io.BytesIO(pareto(RESULT | {"rows": without}))))
    assert narrow.shape[1] / whole.shape[1] == pytest.approx(2 / 3, abs=0.01)


def test_the_tables_have_every_row_once():
    text = table.markdown(RESULT)
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert sum(line.startswith("| paper ") for line in lines) == 2
    assert sum("with the light" in line for line in lines) == 7
    assert "lime-live --weights live-int8 --precision int8" in text
    assert sum(line.count(" 137.0 ") for line in lines) == 1, "the page has a table of its own"
    assert "nothing measured" not in text and "nano in int8 is left out: too far." in text
