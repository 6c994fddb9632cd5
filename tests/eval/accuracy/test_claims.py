"""The paper's conclusions: what holds, what does not, and what cannot be told."""

import numpy as np
import pytest

from lime_keras.eval.accuracy import claims
from lime_keras.eval.accuracy.comparison import FULL, PAPER

NAME = "diffuse_albedo_mae"
ROW = "without perceptual loss"


def run(mean, spread=0.001, seed=0, name=NAME):
    return {name: mean + spread * np.random.default_rng(seed).normal(size=1000)}


def judged(full, without):
    (found,) = claims.judge({FULL: full, ROW: without}, PAPER)
    return found


@pytest.mark.parametrize(
    "full, without, verdict",
    [
        ([0.07], [0.14], "holds"),
        ([0.14], [0.07], "does not"),
        ([0.1], [0.1001], "cannot be told"),
        ([0.07, 0.08], [0.14, 0.13], "holds"),
        # The means differ, but one pair of seeds says the contrary.
        ([0.07, 0.12], [0.14, 0.11], "cannot be told"),
    ],
)
def test_a_claim_needs_the_interval_and_every_pair_of_seeds(full, without, verdict):
    found = judged(
        [run(mean, seed=k) for k, mean in enumerate(full)],
        [run(mean, seed=9 - k) for k, mean in enumerate(without)],
    )
    assert found["verdict"] == verdict and found["pairs"] == len(full) * len(without)
    assert found["paper"] == [0.0674, 0.1406]
    assert found["ours"] == pytest.approx([np.mean(full), np.mean(without)], abs=1e-3)


def test_the_interval_is_that_of_the_paired_difference():
    noise = run(0.0, spread=1.0)[NAME]
    found = judged([{NAME: 0.1 + noise}], [{NAME: 0.11 + noise}])
    assert found["interval"] == pytest.approx([0.01, 0.01]) and found["verdict"] == "holds"


def test_claims_without_runs_are_left_out_and_the_paper_contradicts_none_of_its_own():
    assert claims.judge({FULL: [run(0.1)]}, PAPER) == []
    assert claims.markdown([]) == ""
    printed = {
        row: [{name: np.full(10, value) for name, value in cells.items()}]
        for row, cells in PAPER.items()
    }
    found = claims.judge(printed, PAPER)
    # Figure 7 prints no number.
    assert len(found) == len(claims.CLAIMS) - 1
    assert {one["verdict"] for one in found} == {"holds"}


def test_the_table_shows_the_papers_figures_beside_ours():
    text = claims.markdown([judged([run(0.2)], [run(0.1)])])
    (line,) = [line for line in text.splitlines() if "Eq. 5 lowers the error of m_d" in line]
    for cell in ("0.0674 → 0.1406", "0.2000 → 0.1000", "does not"):
        assert cell in line
    bias = {"log_exponent_bias": np.zeros(10)}
    rows = {FULL: [bias], "exponent regression": [{"log_exponent_bias": np.full(10, 0.2)}]}
    assert "not printed" in claims.markdown(claims.judge(rows, PAPER))
