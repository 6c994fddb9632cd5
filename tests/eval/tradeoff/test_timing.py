"""What a process of its own says, and how rounds of it are pooled."""

import math

import pytest
import static_page

from lime_keras.eval.tradeoff import browser, cases, models, timing
from lime_keras.eval.tradeoff.cases import TimedUse
from lime_keras.eval.tradeoff.measure import PICTURE

QUICK = {"warm_up": 2, "seconds": 0.01, "least": 3, "most": 20}


@pytest.mark.parametrize(
    "case",
    [
        TimedUse("tiny", cases.PHOTO, "material"),
        TimedUse("tiny", cases.STREAM, "with the light"),
        pytest.param(
            TimedUse("tiny", cases.NETWORKS, "everything", cases.KERAS), marks=pytest.mark.slow
        ),
    ],
    ids=lambda case: case.kind,
)
def test_a_process_answers_for_itself_alone(case, tiny_model):
    measured = timing.measure(case, tiny_model, PICTURE, QUICK)
    for name in ("seconds", "networks_s"):
        assert QUICK["least"] <= len(measured[name]) <= QUICK["most"]
        assert all(0 < seconds < 60 for seconds in measured[name])
    assert measured["cold_start_s"] > 0 and 0 < measured["busy"] < 2
    assert 10 < measured["peak_memory_mib"] < 4096


@pytest.mark.slow
def test_a_page_answers_in_a_browser(tmp_path):
    if browser.missing() or not static_page.RUNTIME.is_dir():
        pytest.skip("there is no Chromium, or no onnxruntime-web")
    case = TimedUse("live", cases.PAGE, "material", cases.BROWSER)
    measured = timing.measure(case, static_page.write(tmp_path), PICTURE, QUICK)
    assert QUICK["least"] <= len(measured["seconds"]) <= QUICK["most"]
    assert timing.pooled([measured]).keys() == {
        *("ms", "p95_ms", "samples", "spread", "cold_start_s")
    }


def test_a_process_that_fails_says_why(tmp_path):
    case = TimedUse("none", cases.PHOTO, "mask")
    with pytest.raises(RuntimeError, match=r"none-photo-mask.* cannot be timed: .*is missing"):
        timing.measure(case, tmp_path, PICTURE, QUICK)


@pytest.mark.parametrize(
    ("effort", "calls"),
    [
        ({"seconds": 0, "least": 4, "most": 9}, 4),
        ({"seconds": math.inf, "least": 4, "most": 9}, 9),
        ({"seconds": 0, "least": 9, "most": 4}, 4),
    ],
)
def test_the_effort_bounds_the_calls(effort, calls):
    called = []
    seconds, busy = timing._repeated(lambda: called.append(1), effort)
    assert len(called) == len(seconds) == calls and busy >= 0


def test_rounds_are_pooled_by_hand():
    first = {"seconds": [0.1, 0.2, 0.3], "networks_s": [0.1], "cold_start_s": 3.0}
    second = {"seconds": [0.4, 0.5], "networks_s": [0.2, 0.3], "cold_start_s": 5.0}
    first |= {"busy": 1.5, "peak_memory_mib": 100}
    second |= {"busy": 0.5, "peak_memory_mib": 120}
    assert timing.pooled([first, second]) == pytest.approx(
        {
            "ms": 300,
            "p95_ms": 480,
            "networks_ms": 200,
            "samples": 5,
            "spread": (0.45 - 0.2) / 0.3,
            "cold_start_s": 4.0,
            "busy": 1.0,
            "peak_memory_mib": 120,
        }
    )


def test_every_case_is_there_once_and_the_paper_is_timed_alone():
    listed = list(cases.of_model("best", cores=8))
    assert len(listed) == len(set(listed)) == 2 * (3 * 8 + 4) + 2
    assert {case.threads for case in listed} == {1, 2}
    assert len({case.name for case in listed}) == len(listed)
    paper = list(cases.of_model(cases.PAPER, cores=1))
    assert len(paper) == 4 and {case.precision for case in paper} == {"float32"}


def test_without_a_browser_a_page_is_left_out(tmp_path, tiny_model, monkeypatch):
    monkeypatch.setattr(browser, "missing", lambda: "there is no Chromium")
    use = TimedUse("tiny", cases.PAGE, "mask", cases.BROWSER)
    with pytest.raises(models.Unavailable, match="no Chromium"):
        models.path(use, {"tiny": tiny_model}, tmp_path, tmp_path)
