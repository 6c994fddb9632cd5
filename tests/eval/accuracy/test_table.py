"""The table as text."""

import dataclasses

import pytest
from evaluations import LIME

from lime_keras.eval.accuracy import table
from lime_keras.eval.accuracy.measures import MEASURES


@pytest.fixture
def summary():
    numbers = dict.fromkeys(MEASURES, 0.25)
    return numbers | {
        "count": 7,
        "lobe": "furnace",
        "interval": {name: [0.2, 0.3] for name in MEASURES},
        "true_mask": {"exponent_exact": 0.6},
        "paper": {"exponent_exact": 0.4507, "specular_albedo_mae": 0.2158},
        "chance": {"exponent_exact": 0.125},
        "floor": {"log_exponent_mae_winning": 0.09375},
    }


def test_shares_are_per_cent_and_errors_are_not(summary):
    known = [name for name in MEASURES if name in summary]
    rows = dict(zip(known, table.rows(summary), strict=True))
    exact = ("Exponent, right bin ↑", "25.00 ± 5.00 %", "60.00 %", "45.07 %", "12.50 %", "–")
    assert rows["exponent_exact"] == exact
    specular = ("Specular albedo, MAE ↓", "0.2500 ± 0.0500", "–", "0.2158", "–", "–")
    assert rows["specular_albedo_mae"] == specular
    assert rows["exponent_adjacent"][0] == "Exponent, neighbouring bin"
    assert rows["log_exponent_mae_winning"][-1] == "0.0938"


def test_an_exponent_is_told_by_how_it_is_answered(tiny):
    regressed = dataclasses.replace(tiny, exponent="regression")
    assert "eight classes" in table.exponent_in_words(tiny)
    assert "answers log10 s itself" in table.exponent_in_words(regressed)


def test_the_unit_of_m_s_stands_below(summary):
    assert "the paper's m_s has another unit" in table.markdown(summary, LIME)
    assert "in the paper's unit" in table.markdown(summary | {"lobe": "printed"}, LIME)


def test_markdown_is_a_rectangular_table(summary):
    text = table.markdown(summary, LIME)
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == len(MEASURES) + 2
    # No cell holds a bar, which would split it in two.
    assert {line.count("|") for line in lines} == {len(table.HEADER) + 1}
    assert len({len(line) for line in lines}) == 1
    assert "7 test images, answered by LIME." in text
    assert "With the true mask |" in lines[0]
    assert "winning bin" in text


@pytest.mark.parametrize(
    "fields, told",
    [
        ({"mirror": False}, "the expected value over the eight classes"),
        ({"exponent": "regression"}, "the system answers log10 s itself"),
    ],
)
def test_an_ablations_table_says_what_it_is_and_leaves_out_what_it_has_not(fields, told, summary):
    architecture = dataclasses.replace(LIME, **fields)
    del summary["mirror_relative"], summary["mirror_flip"]
    text = table.markdown(summary, architecture)
    assert f"answered by {architecture.description}." in text and told in text
    assert "Mirror image" not in text and "Specular shading" in text
    known = [m.title for name, m in MEASURES.items() if not name.startswith("mirror_")]
    assert [row[0].rstrip(" ↑↓") for row in table.rows(summary)] == known
