"""The trade from two runs to its tables, with stand-ins for the processes that measure."""

import json
import shutil

import numpy as np
import pytest
import sphere_corpus

from lime_keras.eval.accuracy import measures
from lime_keras.eval.accuracy.evaluate import evaluate
from lime_keras.eval.store import Store
from lime_keras.eval.tradeoff import fidelity, machine, run_formats, timing
from lime_keras.eval.tradeoff.cases import SUBNETWORK, TimedCase, compares_runtimes, is_whole
from lime_keras.eval.tradeoff.measure import ROUNDS, measure
from lime_keras.eval.tradeoff.recommendation import SCORED
from lime_keras.eval.tradeoff.runtimes import KERAS, ONNX
from lime_keras.eval.tradeoff.samples import Samples
from lime_keras.eval.tradeoff.table import markdown
from lime_keras.export import parity

# `test_sections` has the faster sibling, from the command to its table and its picture.
pytestmark = pytest.mark.slow

PRECISIONS = {KERAS: ("float32", "bfloat16"), ONNX: ("float32", "int8")}


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

    def evaluate(self, folder, corpus, *, camera, answer):
        """Errors that the answers decide."""
        self.evaluations += 1
        answers = answer(parity.images(32))
        return {name: float(np.mean(answers["mirror"])) + camera for name in SCORED}

    @staticmethod
    def summarise(errors):
        interval = {name: [error - 0.1, error + 0.1] for name, error in errors.items()}
        chance = dict.fromkeys(SCORED, 1.0)
        return {**errors, "interval": interval, "chance": chance, "count": 4, "system": "LIME"}


@pytest.fixture(scope="module")
def home(tiny_model, tmp_path_factory):
    """Folder of a corpus and of two runs with the same weights."""
    folder = tmp_path_factory.mktemp("trade")
    sphere_corpus.write_split(folder / "corpus", "train", [range(3), range(3, 5)], size=32)
    sphere_corpus.write_split(folder / "corpus", "test", [range(4)], seed=1, size=32)
    for name in "ab":
        shutil.copytree(tiny_model, folder / name / "model")
    return folder


def _once(method, made):
    """A method of `Run` that is called on the first run alone: the others' weights are the same."""

    def answer(run, *arguments):
        key = (method.__name__, *arguments)
        if key not in made:
            made[key] = method(run, *arguments)
        return made[key]

    return answer


def _stand_in(patched, home, made):
    """What takes long and is tested elsewhere becomes a file, a copy, or is made once."""
    write_onnx = run_formats.Run._write_onnx

    def whole(run, path):
        if not (home / "whole.onnx").exists():
            write_onnx(run, home / "whole.onnx")
        shutil.copyfile(home / "whole.onnx", path)

    def subnetwork(run, name):
        path = home / f"{run.name}-{name}.onnx"
        path.write_bytes(b"subnetwork")
        return path

    def write_int8(prepared, path, images):
        shutil.copyfile(prepared, path)

    for name in ("_count_costs", "answer"):
        patched.setattr(run_formats.Run, name, _once(getattr(run_formats.Run, name), made))
    patched.setattr(run_formats.Run, "_write_onnx", whole)
    patched.setattr(run_formats.Run, "subnetwork", subnetwork)
    patched.setattr(run_formats.quantisation, "write_int8", write_int8)
    for module in ("run_formats", "cases", "measure"):
        patched.setattr(f"lime_keras.eval.tradeoff.{module}.PRECISIONS", PRECISIONS)
    patched.setattr(machine, "cores", lambda: 2)


@pytest.fixture(scope="module")
def measured(home):
    """A way to measure both runs, or some."""
    made = {}

    def of_runs(chosen="ab", **options):
        counted = Counted()
        with pytest.MonkeyPatch.context() as patched:
            _stand_in(patched, home, made)
            patched.setattr(timing, "measure", counted.measure)
            patched.setattr(fidelity, "evaluate", counted.evaluate)
            patched.setattr(fidelity.measures, "summarise", counted.summarise)
            runs = {name: home / name for name in chosen}
            corpus, store = home / "corpus", Store(home / "out")
            return measure(runs, corpus, store, **options), counted

    return of_runs


@pytest.fixture(scope="module")
def first(measured):
    return measured()


def _rows(result, **wanted):
    return [r for r in result["rows"] if all(r[name] == value for name, value in wanted.items())]


def test_every_variant_is_crossed_and_the_rest_changes_one_at_a_time(first):
    result, _ = first
    crossed = [row for row in result["rows"] if compares_runtimes(row, 2)]
    names = {(row["model"], row["runtime"], row["precision"]) for row in crossed}
    every = {(runtime, name) for runtime, names in PRECISIONS.items() for name in names}
    assert names == {(model, *variant) for model in "ab" for variant in every}
    assert len(crossed) == len(names) == 8
    whole = {"model": "a", "part": "everything", "kind": "system"}
    assert {row["batch"] for row in _rows(result, **whole)} == {1, 8, 32}
    assert {row["threads"] for row in _rows(result, **whole, precision="int8")} == {1, 2}
    parts = {row["part"] for row in _rows(result, model="b", kind="system")}
    assert parts == {"everything", "mask", "specular", "mirror", "albedo", "exponent", "diffuse"}
    assert len(_rows(result, model="b", kind=SUBNETWORK)) == 5
    keys = [tuple(row[name] for name in TimedCase.__annotations__) for row in result["rows"]]
    assert len(set(keys)) == len(keys)


def test_every_case_is_timed_in_rounds_in_which_all_have_a_turn(first):
    result, counted = first
    cases = len(result["rows"])
    assert len(counted.timed) == ROUNDS * cases
    turns = [counted.timed[round * cases : (round + 1) * cases] for round in range(3)]
    assert turns[0] == turns[1] == turns[2] and len(set(turns[0])) == cases
    assert all(row["samples"] == 9 and row["model_mib"] > 0 for row in result["rows"])


def test_what_is_numerically_distinct_is_evaluated_and_nothing_else(first):
    """Of each run: Keras in two precisions and ONNX Runtime in eight bits."""
    result, counted = first
    assert counted.evaluations == 2 * 3
    for row in filter(is_whole, result["rows"]):
        own = row["precision"] == "int8"
        assert row["measured_on"] == (ONNX if own else KERAS)
        assert row["score"] > 0 and row["count"] == 4
    assert all("errors" not in row for row in result["rows"] if not is_whole(row))


def test_twins_are_equal_in_all_but_name(first):
    result = json.loads(json.dumps(first[0]))
    for one, other in zip(_rows(result, model="a"), _rows(result, model="b"), strict=True):
        assert one == other | {"model": "a"}


def test_errors_are_those_of_the_evaluation(home, tmp_path):
    store = Store(tmp_path)
    run = run_formats.Run("a", home / "a", Samples(home / "corpus", store, camera=False), store)
    found = fidelity.Fidelity(run, store).errors(KERAS, "float32")
    expected = measures.values(evaluate(home / "a", home / "corpus").rows)
    assert found["errors"] == pytest.approx(expected) and found["count"] == 4
    assert set(found["interval"]) == set(expected) > set(SCORED)


def test_the_result_is_json_and_its_tables_say_it(first):
    result, _ = first
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    text = markdown(result)
    assert result["machine"]["processor"] in text and "4 test images" in text
    for said in ("13.72", "all 2 threads of this machine within 33.3 ms", "only"):
        assert said in text
    table = text.split("## The trade")[1].split("##")[0]
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    times = [float(line.split("|")[6]) for line in lines]
    assert len(times) == 8 and times == sorted(times)
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


def test_of_fewer_runs_all_is_known(first, measured):
    alone, counted = measured("a")
    assert counted.timed == [] and counted.evaluations == 0
    assert {row["model"] for row in alone["rows"]} == {"a"}


def test_a_camera_is_another_matter_for_errors(first, measured):
    result, _ = first
    seen, counted = measured("a", camera=True)
    assert counted.evaluations == 3
    of = {"model": "a", "runtime": KERAS, "precision": "float32"}
    assert _rows(seen, **of)[0]["errors"] != _rows(result, **of)[0]["errors"]


@pytest.mark.parametrize("names", [[], [""], ["runs/full"], [".."]])
def test_names_that_are_no_files_are_refused(names, tmp_path):
    with pytest.raises(ValueError, match="pass at least one"):
        measure(dict.fromkeys(names, tmp_path), tmp_path, Store(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_budget_that_is_not_met_is_said_in_words(first):
    result, _ = first
    unmet = result["recommendations"][0] | {"within": False, "cost": 99.0}
    text = markdown(result | {"recommendations": [unmet]})
    assert "**nothing measured meets the budget**; nearest is" in text and "99.0 ms" in text


def test_it_is_said_which_weights_to_take_for_what(first):
    result, _ = first
    assert result["purposes"] and f"**{result['purposes'][0]['model']}**" in markdown(result)
    slow = {"model": "slow", "latency_ms": 24.0, "score": 0.5, "beaten": ["other"]}
    fast = {"model": "fast", "latency_ms": 6.0, "score": 0.6, "beaten": []}
    text = markdown(result | {"purposes": [slow, fast]})
    told = "Take **slow** where errors count: it errs least (24.0 ms, 42 images/s, score 0.500)"
    assert f"- {told}; other is neither faster nor better.\n" in text
    told = "Take **fast** where time counts: 4.0 times as fast as slow, and worse by 0.100"
    assert told in text


def test_a_missing_train_split_is_told_before_anything_is_measured(tmp_path, monkeypatch):
    monkeypatch.setattr("lime_keras.eval.tradeoff.measure.Samples", None)
    with pytest.raises(FileNotFoundError, match=r"train.manifest\.json is missing: `lime-render"):
        measure({"run": tmp_path}, tmp_path, Store(tmp_path / "out"))
