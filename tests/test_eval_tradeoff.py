"""The trade from two runs to its tables, with stand-ins for the processes that measure."""

import json
import shutil

import keras
import numpy as np
import pytest
import sphere_corpus

from lime_keras.eval import cases, fidelity, machine, tradeoff, variants, yardsticks
from lime_keras.eval.cases import SUBNETWORK, YARDSTICK, is_crossed, is_whole
from lime_keras.eval.runtimes import KERAS, ONNX

PRECISIONS = {KERAS: ("float32", "bfloat16"), ONNX: ("float32", "int8", "int8, float heads")}


def _classifier(weights, input_shape):
    image = keras.Input(input_shape)
    x = keras.layers.GlobalAveragePooling2D()(keras.layers.Conv2D(3, 3)(image))
    return keras.Model(image, keras.layers.Dense(5)(x))


class Counted:
    """Stand-ins that count: what was timed, and what was evaluated."""

    def __init__(self):
        self.timed, self.evaluations = [], 0

    def measure(self, job):
        """Faster on more threads, and in fewer bits."""
        self.timed.append(job)
        bits = 0.5 if "int8" in job.path else 1.0
        seconds = 0.004 * job.batch * bits / job.threads + 0.001 * (job.runtime == KERAS)
        assert job.images is None or np.load(job.images).shape[1:] == (32, 32, 3)
        return {
            "seconds": [seconds, seconds, 2 * seconds],
            "cold_start_s": 1.0,
            "import_s": 0.5,
            "load_s": 0.25,
            "first_s": 0.125,
            "busy": 1.0,
            "peak_memory_mib": 100.0,
        }

    def evaluate(self, *arguments, **options):
        self.evaluations += 1
        return EVALUATE(*arguments, **options)


EVALUATE = fidelity.evaluate


@pytest.fixture(scope="module")
def measured(tiny_model, tmp_path_factory):
    """A corpus, two runs of the same weights, where results are kept, and a way to measure."""
    home = tmp_path_factory.mktemp("trade")
    corpus = home / "corpus"
    sphere_corpus.write_split(corpus, "train", [range(3), range(3, 5)], size=32)
    sphere_corpus.write_split(corpus, "test", [range(4)], seed=1, size=32)
    runs = {name: shutil.copytree(tiny_model, home / name / "model").parent for name in "ab"}

    def measure(chosen=("a", "b"), **options):
        counted = Counted()
        with pytest.MonkeyPatch.context() as patched:
            for module in (variants, cases, tradeoff):
                patched.setattr(module, "PRECISIONS", PRECISIONS)
            small = {"small": _classifier}
            patched.setattr(yardsticks, "NETWORKS", small)
            patched.setattr(cases, "NETWORKS", small)
            patched.setattr(machine, "cores", lambda: 2)
            patched.setattr(tradeoff.timing, "measure", counted.measure)
            patched.setattr(fidelity, "evaluate", counted.evaluate)
            chosen = {name: runs[name] for name in chosen}
            return tradeoff.measure(
                chosen, corpus, home / "out", progress=False, **options
            ), counted

    return measure


@pytest.fixture(scope="module")
def first(measured):
    return measured()


def _rows(result, **wanted):
    return [r for r in result["rows"] if all(r[name] == value for name, value in wanted.items())]


def test_every_variant_is_crossed_and_the_rest_changes_one_at_a_time(first):
    result, _ = first
    crossed = [row for row in result["rows"] if is_crossed(row, 2)]
    names = {(row["model"], row["runtime"], row["precision"]) for row in crossed}
    every = {(runtime, name) for runtime, names in PRECISIONS.items() for name in names}
    assert names == {(model, *variant) for model in "ab" for variant in every}
    assert len(crossed) == len(names) == 10
    whole = {"model": "a", "part": "everything", "kind": "system"}
    assert {row["batch"] for row in _rows(result, **whole)} == {1, 8, 32}
    assert {row["threads"] for row in _rows(result, **whole, precision="int8")} == {1, 2}
    parts = {row["part"] for row in _rows(result, model="b", kind="system")}
    assert parts == {"everything", "mask", "specular", "mirror", "albedo", "exponent", "diffuse"}
    assert len(_rows(result, model="b", kind=SUBNETWORK)) == 5
    assert [row["model"] for row in _rows(result, kind=YARDSTICK)] == ["small"]
    keys = [tuple(row[name] for name in tradeoff.Case.__annotations__) for row in result["rows"]]
    assert len(set(keys)) == len(keys)


def test_every_case_is_timed_in_rounds_in_which_all_have_a_turn(first):
    result, counted = first
    cases = len(result["rows"])
    assert len(counted.timed) == tradeoff.ROUNDS * cases
    turns = [counted.timed[round * cases : (round + 1) * cases] for round in range(3)]
    assert turns[0] == turns[1] == turns[2] and len(set(turns[0])) == cases
    assert all(row["samples"] == 9 and row["model_mib"] > 0 for row in result["rows"])


def test_what_is_numerically_distinct_is_evaluated_and_nothing_else(first):
    """Of each run: Keras in two precisions and ONNX Runtime in two of eight bits."""
    result, counted = first
    assert counted.evaluations == 2 * 4
    for row in filter(is_whole, result["rows"]):
        own = row["precision"].startswith("int8")
        assert row["measured_on"] == (ONNX if own else KERAS)
        assert row["score"] > 0 and row["count"] == 4
    assert all("errors" not in row for row in result["rows"] if not is_whole(row))


def test_twins_are_equal_in_all_but_name(first):
    result, _ = first
    for one, other in zip(_rows(result, model="a"), _rows(result, model="b"), strict=True):
        assert one == other | {"model": "a"}


def test_the_result_is_json_and_its_tables_say_it(first):
    result, _ = first
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    text = tradeoff.markdown(result)
    assert result["machine"]["processor"] in text and "4 test images" in text
    for said in ("13.72", "No network published", "(assumed, not measured)", "small", "only"):
        assert said in text
    table = text.split("## The trade")[1].split("##")[0]
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    times = [float(line.split("|")[6]) for line in lines]
    assert len(times) == 10 and times == sorted(times)
    fronts = [line.split("|")[1].strip() == "◆" for line in lines]
    assert sum(fronts) == sum(row.get("front", False) for row in result["rows"]) > 0
    for section in text.split("\n\n"):
        if section.startswith("|"):
            assert len({line.count("|") for line in section.splitlines()}) == 1


def test_a_rerun_measures_nothing_again(first, measured):
    result, _ = first
    again, counted = measured()
    assert counted.timed == [] and counted.evaluations == 0
    assert again["rows"] == result["rows"]


def test_a_run_more_is_measured_alone(first, measured):
    alone, counted = measured(["a"])
    assert counted.timed == [] and counted.evaluations == 0
    assert {row["model"] for row in alone["rows"]} == {"a", "small"}


def test_a_camera_is_another_matter_for_errors(first, measured):
    result, _ = first
    seen, counted = measured(["a"], camera=True)
    assert counted.evaluations == 4
    of = {"model": "a", "runtime": KERAS, "precision": "float32"}
    assert _rows(seen, **of)[0]["errors"] != _rows(result, **of)[0]["errors"]


@pytest.mark.parametrize("names", [[], [""], ["runs/full"], [".."]])
def test_names_that_are_no_files_are_refused(names, tmp_path):
    with pytest.raises(ValueError, match="pass at least one"):
        tradeoff.measure(dict.fromkeys(names, tmp_path), tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_budget_that_is_not_met_is_said_in_words(first):
    result, _ = first
    unmet = result["recommendations"][0] | {"within": False, "cost": 99.0}
    text = tradeoff.markdown(result | {"recommendations": [unmet]})
    assert "**nothing measured meets the budget**; nearest is" in text and "99.0 ms" in text
