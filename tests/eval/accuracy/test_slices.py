"""Slices: every example in one part of each kind, parts by hand."""

import numpy as np
import pytest
from evaluations import four

from lime_keras.eval.accuracy import measures, slices


@pytest.fixture(scope="module")
def columns():
    more = {
        "light_contrast": np.array([10.0, 20.0, 3000.0, 40000.0]),
        "saturated": np.zeros(4),
        "shape": np.array([b"cup", b"spoon", b"cup", b"cup"]),
        "light": np.array([b"attic", b"attic", b"attic", b"beach"]),
    }
    return four().rows | more


@pytest.fixture(scope="module")
def found(columns):
    """The cells of each part, by its name."""
    return {cells[0]: cells[1:] for cells in slices.rows(columns)[1:]}


def test_each_kind_holds_every_example_once(found):
    kinds = {}
    for name, (count, *_) in found.items():
        kinds.setdefault(name.partition(":")[0], []).append(int(count))
    assert len(kinds) == 6
    assert all(sum(counts) == 4 and min(counts) > 0 for counts in kinds.values())


def test_a_part_has_the_measures_of_its_own_examples(found, columns):
    count, *cells = found["shape: cup"]
    cups = measures.values({name: column[[0, 2, 3]] for name, column in columns.items()})
    assert count == "3"
    for name, cell in zip(slices.SHOWN, cells, strict=True):
        number = measures.MEASURES[name].unit.number(cups[name])
        assert cell.startswith(f"{number.partition(' ')[0]} ± ")


def test_quarters_keep_equal_values_together_and_say_their_ends(found):
    parts = {
        "saturated": {"0.0%": "4"},
        "light's contrast": dict.fromkeys(("10", "20", "3,000", "40,000"), "1"),
        "coverage": {"10%": "2", "30%": "2"},
    }
    for kind, labels in parts.items():
        counts = {f"{kind}: {label}": count for label, count in labels.items()}
        assert {name: found[name][0] for name in found if name.startswith(kind)} == counts


def test_a_part_of_one_image_has_no_interval(found):
    count, *cells = found["light: beach"]
    assert count == "1" and "±" not in "".join(cells)


def test_what_a_system_lacks_is_left_out(columns):
    without = {name: column for name, column in columns.items() if name != "relit"}
    with_all, without_one = slices.rows(columns), slices.rows(without)
    assert [cells[:-1] for cells in with_all] == without_one
