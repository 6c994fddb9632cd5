"""The picture shows every row, in its own colour, and breaks on none."""

import io

import numpy as np
import pytest
import trade
from matplotlib import image as png_reader
from matplotlib.colors import to_rgb

from lime_keras.eval.report.themes import DARK, LIGHT
from lime_keras.eval.tradeoff import figures
from lime_keras.eval.tradeoff.figures import TONES
from lime_keras.eval.tradeoff.figures import pareto as draw
from lime_keras.eval.tradeoff.recommendation import scored


def pareto(rows, *theme):
    """The picture of a result with these rows."""
    shared = scored(rows)
    return draw({"rows": rows, "scored": shared, "machine": {"cores": 2}}, *theme)


def _pixels(png):
    return png_reader.imread(io.BytesIO(png), format="png")[..., :3]


def _painted(png, tone):
    return np.count_nonzero(np.abs(_pixels(png) - to_rgb(tone)).max(axis=-1) < 0.02)


def test_every_run_is_drawn_in_its_colour():
    both, one = pareto(trade.ROWS), pareto(trade.ROWS[:4])
    assert all(_painted(both, tone) > 500 for tone in TONES[:2])
    assert _painted(one, TONES[0]) > 500 and _painted(one, TONES[1]) == 0


def test_a_row_that_is_not_there_is_not_drawn():
    assert np.any(_pixels(pareto(trade.ROWS)) != _pixels(pareto(trade.ROWS[:-1])))


def test_a_measure_that_a_run_lacks_has_no_panel():
    """Of four shared errors and the score there are five panels; of five and it, six."""
    errors = trade.row("full", 1, 1)["errors"]
    whole = [row | {"errors": errors} for row in trade.ROWS]
    assert _painted(pareto(whole), TONES[0]) > _painted(pareto(trade.ROWS), TONES[0])


def test_the_markers_of_the_largest_errors_are_whole():
    first = trade.row("full", 10.0, 1.0)
    alike, apart = (
        _painted(pareto([first, trade.row("full", 50.0, score)]), TONES[0]) for score in (0.98, 0.3)
    )
    assert alike > 0.97 * apart


@pytest.mark.parametrize("rows", [trade.ROWS[:1], [trade.row("full", 1e-3, 0.0)] * 2])
def test_a_single_point_is_drawn(rows):
    assert _painted(pareto(rows), TONES[0]) > 100


def test_a_row_without_a_number_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        pareto([*trade.ROWS, trade.row("full", float("nan"), 0.5)])


def test_the_dark_theme_is_dark():
    light, dark = (_pixels(pareto(trade.ROWS, theme)) for theme in (LIGHT, DARK))
    assert np.median(light) > 0.9
    assert np.median(dark) < 0.3


@pytest.mark.parametrize("scores", [(0.50, 0.51), (0.0, 0.0), (1e9, 2e9)])
def test_axes_of_errors_start_at_0_and_hold_every_point(scores, monkeypatch):
    """A hundredth of difference stays a hundredth of the height."""
    seen, draw_panel = [], figures._panel

    def panel(axes, rows, errors, *rest):
        draw_panel(axes, rows, errors, *rest)
        seen.append((axes.get_ylim(), max(errors), axes.get_xscale(), axes.get_xlabel()))

    monkeypatch.setattr(figures, "_panel", panel)
    pareto([trade.row("full", 20 + index, score) for index, score in enumerate(scores)])
    assert len(seen) == 6
    for (low, high), most, scale, label in seen:
        assert low == 0 and most <= high and high > 0
        assert most == 0 or high < 1.5 * most
        assert scale == "log" and "logarithmic" in label
