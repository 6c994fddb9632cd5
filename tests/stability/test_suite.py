"""The extremes: every verdict, that the suite turns when something breaks, and the command."""

import json
import math

import numpy as np
import pytest
from keras import ops

from lime_keras import losses
from lime_keras.eval.stability import suite
from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import colour, dynamic_range, masking, shading, shininess
from lime_keras.optics.compositing import compose
from tests.stability import __main__ as command
from tests.stability import page_modules
from tests.stability.cases import every_case, page

CASES = every_case()
COMPILED = {"XLA float32", "SavedModel", "ONNX", "ONNX float16"}
"""Precisions of graphs that are compiled or exported first, which takes most of the time."""


def _takes_long(case):
    """Whole systems in half precision, too."""
    in_half = case.part.startswith("fresh ") and case.precision in ("float16", "bfloat16")
    return in_half or case.precision in COMPILED


SKIPPED = () if page_modules.node() else (page.JAVASCRIPT,)
RUN = [case for case in CASES if case.precision not in SKIPPED]
QUICK = [case for case in RUN if not _takes_long(case)]


@pytest.fixture(scope="module")
def verdicts():
    return {case.id: case.judge() for case in QUICK}


@pytest.fixture(scope="module")
def all_verdicts():
    return {case.id: verdict for case, verdict in zip(RUN, suite.run(RUN), strict=True)}


def parts(cases):
    """The names of the parts that cases are of."""
    return list(dict.fromkeys(case.part for case in cases))


def failed(part, verdicts):
    return {
        name: verdict
        for name, verdict in verdicts.items()
        if verdict.part == part and not verdict.passed
    }


@pytest.mark.parametrize("part", parts(case for case in CASES if not _takes_long(case)))
def test_each_part_holds_at_its_extremes(part, verdicts):
    assert not failed(part, verdicts)
    if any(case.part == part and case.precision in SKIPPED for case in CASES):
        pytest.skip("there is no node: install Node.js 20 or newer")


@pytest.mark.slow
@pytest.mark.parametrize("part", parts(case for case in CASES if _takes_long(case)))
def test_parts_hold_in_what_takes_long_too(part, all_verdicts):
    assert not failed(part, all_verdicts)


@pytest.mark.slow
def test_the_suite_judges_every_case(all_verdicts):
    judged = [(one.part, one.case, one.precision) for one in all_verdicts.values()]
    assert judged == [(case.part, case.name, case.precision) for case in RUN]


def test_no_case_is_told_twice():
    names = [case.id for case in CASES]
    assert len(set(names)) == len(names)


def test_verdicts_have_numbers_or_a_refusal(verdicts):
    for verdict in verdicts.values():
        numbers = (verdict.reference, verdict.error, verdict.tolerance)
        if "refused" in verdict.case:
            assert numbers == (None,) * 3 and verdict.value is None
            assert verdict.note.startswith("refused: ") and len(verdict.note) > 20
        else:
            assert None not in numbers, verdict
            assert not math.isnan(verdict.error) and verdict.tolerance >= 0
            assert verdict.passed == (verdict.error <= verdict.tolerance)


def test_every_precision_format_and_derivative_is_there(verdicts):
    found = {case.precision for case in CASES}
    assert found >= {"float32", "float16", "bfloat16", "XLA float32", "SavedModel", "ONNX"}
    differentiated = {v.part for v in verdicts.values() if v.gradient is not None}
    assert differentiated >= {
        "normaliser",
        "sRGB to linear",
        "compress",
        "expand",
        "Eq. 4",
        "masked mean",
        "compositing loss",
        "cross-entropy",
        "reflectance map",
        "fresh LIME",
    }


def number(found):
    return Case("lobe", f"{found:g}", "float32", lambda: Outcome(Compared(found, 1.0, 1.0, 0.0)))


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command with one case of a function, and without Node."""

    def run(found, *arguments):
        scripted = Case("page", "colour", page.JAVASCRIPT, lambda: pytest.fail("without Node"))
        monkeypatch.setattr("tests.stability.cases.every_case", lambda: [number(found), scripted])
        monkeypatch.setattr(suite, "cases", lambda folder: [number(1.0)])
        monkeypatch.setattr(page_modules, "node", lambda: None)
        return command.main([*arguments, "--out", str(tmp_path)])

    return run


def test_the_command_writes_the_tables_and_says_what_it_skips(quick, tmp_path, capsys):
    assert quick(1.0) == 0
    said = capsys.readouterr()
    assert said.out == (tmp_path / "stability.md").read_text(encoding="utf-8")
    assert "skipped: 1 checks of the live page: there is no Node.js\n" in said.err
    assert "report.html" in said.err
    [row] = json.loads((tmp_path / "stability.json").read_text(encoding="utf-8"))
    assert row["part"] == "lobe" and row["passed"] is True
    assert (tmp_path / "report.html").is_file()


def test_the_command_tries_a_run_too(quick, tmp_path):
    assert quick(1.0, "--weights", "nano") == 0
    assert len(json.loads((tmp_path / "stability.json").read_text(encoding="utf-8"))) == 2


def test_the_command_fails_where_a_check_fails(quick, capsys):
    assert quick(2.0) == 1
    assert "FAILED" in capsys.readouterr().out


# The suite can fail. Each of these is a mistake that could be made, and the part that it breaks.


def lobe_without_a_horizon(normal, view, exponent, light, energy):
    half = light + view
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-6)
    return np.abs(np.sum(half * normal, axis=-1)) ** exponent * shading.normaliser(exponent)


def srgb_without_a_select_before_the_power(srgb):
    high = ((srgb + 0.055) / 1.055) ** 2.4
    return ops.where(srgb <= 0.04045, srgb / 12.92, high)


def masked_mean_of_nothing(values, mask):
    weight = ops.sum(mask, axis=(1, 2, 3)) * values.shape[-1]
    return ops.sum(ops.where(mask > 0, values, 0.0) * mask, axis=(1, 2, 3)) / weight


def masked_mean_in_half(values, mask):
    """As it was: float16 adds up to no more than 65,504."""
    weight = ops.sum(mask, axis=(1, 2, 3)) * values.shape[-1]
    inside = ops.where(mask > 0, values, ops.zeros_like(values))
    return ops.sum(inside * mask, axis=(1, 2, 3)) / ops.maximum(weight, 1e-6)


def two_sided_compositing(image, mask, m_d, m_s, m_a, diffuse, compressed, clipped):
    composed = compose(m_d, m_s, m_a, diffuse, dynamic_range.expand(compressed))
    error = ops.abs(composed - colour.srgb_to_linear(image))
    return masking.masked_mean(error, ops.cast(mask >= 1, error.dtype))


def cross_entropy_of_probabilities(exponent_bin, logits):
    """As it was: a probability below 1e-7 taught nothing."""
    chosen = ops.take_along_axis(ops.softmax(logits), exponent_bin[:, None], axis=-1)[:, 0]
    return -ops.log(ops.maximum(chosen, 1e-7))


def bins_without_slack(exponent):
    log = np.log10(np.maximum(np.asarray(exponent, np.float64), 1))
    return np.clip(np.floor(log / 0.375), 0, 7).astype(int)


BROKEN = {
    "a lobe without a horizon": ("lobe: ", shading, "specular", lobe_without_a_horizon),
    "a power of what is negative": (
        "sRGB to linear: ",
        colour,
        "srgb_to_linear",
        srgb_without_a_select_before_the_power,
    ),
    "a mean of nothing": ("masked mean: ", masking, "masked_mean", masked_mean_of_nothing),
    "two-sided compositing": (
        "compositing loss: ",
        losses,
        "compositing_l1",
        two_sided_compositing,
    ),
    "cross-entropy of probabilities": (
        "cross-entropy: ",
        losses,
        "exponent_cross_entropy",
        cross_entropy_of_probabilities,
    ),
    "bins without slack": ("bins: ", shininess, "bin_of", bins_without_slack),
}


@pytest.mark.parametrize("beginning, module, name, broken", BROKEN.values(), ids=BROKEN)
def test_a_mistake_turns_verdicts(beginning, module, name, broken, monkeypatch):
    monkeypatch.setattr(module, name, broken)
    assert suite.failures(judged(beginning, ("float32", "NumPy float32")))


def test_a_sum_in_half_precision_turns_verdicts(monkeypatch):
    monkeypatch.setattr(masking, "masked_mean", masked_mean_in_half)
    assert suite.failures(judged("masked mean: ", ("float16",)))
    assert not suite.failures(judged("masked mean: ", ("float32",)))


def judged(beginning, precisions):
    """Verdicts on the cases whose id begins like this."""
    chosen = [c for c in CASES if c.id.startswith(beginning)]
    chosen = [case for case in chosen if case.precision in precisions]
    assert chosen
    return [case.judge() for case in chosen]
