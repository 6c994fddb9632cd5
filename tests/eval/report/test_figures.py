"""Figures draw what they are given, and nothing at all when there is nothing."""

import io

import numpy as np
import pytest
from matplotlib import image as png_reader

from lime_keras.eval.report import figures, themes


def _pixels(png):
    return png_reader.imread(io.BytesIO(png), format="png")[..., :3]


def _write(folder, name, text):
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")


def test_confusion_of_a_perfect_classifier_differs_from_a_constant_one():
    perfect = figures.confusion(np.eye(8, dtype=int) * 5)
    constant = figures.confusion(np.eye(8, dtype=int)[[3] * 8] * 5)
    assert np.any(_pixels(perfect) != _pixels(constant))


def test_confusion_with_empty_rows_is_drawn():
    assert _pixels(figures.confusion(np.zeros((8, 8), int))).std() > 0


def test_confusion_colours_shares_not_counts():
    few = np.zeros((8, 8), int)
    few[2, 2], few[5, 5] = 1, 1
    accent = np.array([0x1F, 0x63, 0xB0]) / 255

    def full_pixels(matrix):
        near = np.abs(_pixels(figures.confusion(matrix)) - accent).max(axis=-1) < 0.02
        return np.count_nonzero(near)

    assert full_pixels(few) > 1000
    assert full_pixels(few * 90) == pytest.approx(full_pixels(few), rel=0.1)


def test_the_dark_theme_is_dark():
    matrix = np.eye(8, dtype=int)
    light, dark = (_pixels(figures.confusion(matrix, t)) for t in (themes.LIGHT, themes.DARK))
    assert np.median(light) > 0.9
    assert np.median(dark) < 0.3


def test_loss_curves_read_empty_cells(tmp_path):
    _write(
        tmp_path / "curves",
        "1-segmentation.csv",
        "step,seconds,train_mask,validation_mask\n10,1.5,0.5,\n20,3.0,0.25,0.3\n",
    )
    columns = figures.read_curves(tmp_path / "curves" / "1-segmentation.csv")
    assert columns["train_mask"].tolist() == [0.5, 0.25]
    assert np.isnan(columns["validation_mask"][0]) and columns["validation_mask"][1] == 0.3
    assert _pixels(figures.loss_curves(tmp_path / "curves")).std() > 0


@pytest.mark.parametrize(
    "text",
    [
        "step,seconds,train_mask,validation_mask\n",
        "step,seconds,train_mask,validation_mask\n1,1,0,\n2,2,0,0\n",
        "step,seconds,train_mask,validation_mask\n1,1,-3,\n2,2,1e-30,1e30\n",
        "step,seconds,train_mask,validation_mask\n1,1,,\n",
    ],
)
def test_odd_curves_do_not_break_the_figure(tmp_path, text):
    _write(tmp_path / "curves", "1-segmentation.csv", text)
    figures.loss_curves(tmp_path / "curves")


@pytest.mark.parametrize("stages", [1, 2, 4])
def test_the_legend_of_a_few_stages_is_not_cut_off(tmp_path, stages):
    terms = "compositing diffuse_albedo exponent loss mirror specular specular_albedo".split()
    heading = ",".join(["step", *(f"train_{term}" for term in terms)])
    for number in range(stages):
        text = f"{heading}\n1{',0.5' * len(terms)}\n2{',0.4' * len(terms)}\n"
        _write(tmp_path / "curves", f"{number}-joined.csv", text)
    pixels = _pixels(figures.loss_curves(tmp_path / "curves"))
    assert (pixels[:, [0, -1]] == pixels[0, 0]).all()


def test_no_curves_no_figure(tmp_path):
    assert figures.loss_curves(tmp_path / "curves") is None


def test_a_broken_curve_file_is_named(tmp_path):
    _write(tmp_path / "curves", "2-specular.csv", "step,train_s\n1,seven\n")
    with pytest.raises(ValueError, match=r"2-specular\.csv is not a table of numbers"):
        figures.loss_curves(tmp_path / "curves")


def test_albedos_of_one_example_are_drawn():
    rows = {
        "bin": np.array([0]),
        "diffuse_albedo": np.array([[0.1, 0.5, 0.9]]),
        "diffuse_found": np.array([[0.2, 0.5, 0.8]]),
        "specular_albedo": np.array([0.3]),
        "specular_found": np.array([0.4]),
    }
    assert _pixels(figures.albedos(rows)).std() > 0


def test_measures_are_no_losses(tmp_path):
    """Shares and errors have scales of their own: the panels are those of the losses alone."""
    _write(
        tmp_path / "losses",
        "1-segmentation.csv",
        "step,seconds,train_mask,validation_mask\n1,1,0.5,0.4\n2,2,0.25,0.3\n",
    )
    _write(
        tmp_path / "both",
        "1-segmentation.csv",
        "step,seconds,train_mask,validation_mask,measure_mask_iou_pooled\n"
        "1,1,0.5,0.4,0.01\n2,2,0.25,0.3,0.9\n",
    )
    both, losses = (figures.loss_curves(tmp_path / name) for name in ("both", "losses"))
    assert both == losses
