"""Slices: every example in one part of each kind, parts by hand."""

import numpy as np
import pytest
from evaluations import four

from lime_keras.eval.accuracy import measures
from lime_keras.eval.accuracy.slices import SHOWN, slices


@pytest.fixture(scope="module")
def rows():
    more = {
        "light_contrast": np.array([10.0, 20.0, 3000.0, 40000.0]),
        "saturated": np.zeros(4),
        "shape": np.array([b"cup", b"spoon", b"cup", b"cup"]),
        "light": np.array([b"attic", b"attic", b"attic", b"beach"]),
    }
    return four().rows | more


@pytest.fixture(scope="module")
def found(rows):
    return slices(rows)


def test_each_kind_holds_every_example_once(found, rows):
    kinds = dict.fromkeys(part.by for part in found)
    assert len(kinds) == 6
    for kind in kinds:
        assert sum(part.count for part in found if part.by == kind) == len(rows["bin"])
    assert all(part.count > 0 for part in found)


def test_a_part_has_the_measures_of_its_own_examples(found, rows):
    [spoon] = [part for part in found if part.label == "spoon"]
    assert spoon.count == 1
    assert spoon.value["log_exponent_mae"] == pytest.approx(0.2)
    assert spoon.interval["relighting_psnr"] == [30.0, 30.0]
    [cups] = [part for part in found if part.label == "cup"]
    chosen = {name: column[[0, 2, 3]] for name, column in rows.items()}
    assert cups.value == {name: measures.values(chosen)[name] for name in SHOWN}


def test_quarters_keep_equal_values_together_and_say_their_ends(found):
    saturated = [part for part in found if part.by.startswith("saturated")]
    assert [(part.count, part.label) for part in saturated] == [(4, "0.0%")]
    contrast = [part.label for part in found if part.by.startswith("light's contrast")]
    assert contrast == ["10", "20", "3,000", "40,000"]
    coverage = [part.label for part in found if part.by.startswith("coverage")]
    assert coverage == ["10%", "30%"]


def test_what_a_system_lacks_is_left_out(rows):
    without = {name: column for name, column in rows.items() if name != "relit"}
    assert all("relighting_psnr" not in part.value for part in slices(without))
