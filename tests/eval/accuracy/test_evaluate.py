"""One batch's columns against hand arithmetic and identities; which models are measured."""

import json

import numpy as np
import pytest

from lime_keras.data.corpus import Split
from lime_keras.eval.accuracy.evaluate import check_lobe, measure
from lime_keras.optics import environment, shininess


def _batch():
    """Two 2×2 examples: an object on the left half, and no object at all."""
    mask = np.zeros((2, 2, 2, 1), np.float32)
    mask[0, :, 0] = 1
    layer = np.full((2, 2, 2, 1), 2.0, np.float32)
    clipped = np.zeros((2, 2, 2, 3), np.float32)
    clipped[:, 0, :, 2] = 1
    light = np.zeros((2, 4, 8, 1), np.float32)
    light[0] = 3.0
    return {
        "clipped": clipped,
        "environment": light,
        "seed": np.array([7, 7]),
        "index": np.array([0, 1]),
        "shape": np.array([b"blob", b"blob"]),
        "light": np.array([b"room", b"room"]),
        "mask": mask,
        "specular_shading": layer,
        "mirror": layer,
        "diffuse_albedo": np.array([[0.1, 0.2, 0.3], [1, 1, 1]], np.float32),
        "specular_albedo": np.array([0.25, 1.0], np.float32),
        "shininess": np.array([10.0, 0.0], np.float32),
    }


def _perfect(batch):
    """The answer that equals the truth."""
    return {
        "mask": batch["mask"],
        "specular_shading": batch["specular_shading"],
        "mirror": batch["mirror"],
        "diffuse_albedo": batch["diffuse_albedo"],
        "specular_albedo": batch["specular_albedo"][:, None],
        "exponent_bin_probabilities": np.eye(8, dtype=np.float32)[
            shininess.bin_of(batch["shininess"])
        ],
    }


def test_a_perfect_answer_errs_only_by_the_bins_width():
    rows = measure(_batch(), _perfect(_batch()))
    assert rows["iou"].tolist() == [1, 1]
    assert rows["bin"].tolist() == rows["predicted_bin"].tolist() == [2, 0]
    assert rows["bin_distance"].tolist() == [0, 0]
    # log10 10 = 1 lies 0.0625 above the mean of 0.75 … 1.125; an exponent of 0 counts as 1.
    assert rows["log_error"] == pytest.approx([0.0625, 0.1875])
    assert rows["log_error_winning"] == pytest.approx([0.0625, 0.1875])
    assert rows["log_squared"] == pytest.approx([0.0625**2, 0.1875**2])
    for name in ("diffuse_absolute", "specular_squared", "specular_shading_relative"):
        assert rows[name].tolist() == [0, 0]


def test_saturation_counts_the_object_alone_and_contrast_a_steady_light_as_one():
    rows = measure(_batch(), _perfect(_batch()))
    # One of the object's two pixels is clipped, in one channel; without an object there is none.
    assert rows["saturated"].tolist() == [0.5, 0.0]
    assert rows["light_contrast"] == pytest.approx([1.0, 1.0])
    lamp = _batch()
    lamp["environment"][0] = 0.0
    lamp["environment"][0, 1, 3] = 5.0
    solid_angle = environment.solid_angles(4, 8)[1, 3]
    contrast = measure(lamp, _perfect(lamp))["light_contrast"]
    assert contrast == pytest.approx([4 * np.pi / solid_angle, 1.0])


def test_wrong_answers_by_hand():
    batch = _batch()
    probabilities = np.zeros((2, 8), np.float32)
    probabilities[0, [2, 4]] = 0.25, 0.75
    probabilities[1, 7] = 1
    answer = _perfect(batch) | {
        "mask": np.ones_like(batch["mask"]),
        "specular_shading": np.full_like(batch["mirror"], 3.0),
        "mirror": np.zeros_like(batch["mirror"]),
        "diffuse_albedo": batch["diffuse_albedo"] - np.float32(0.1),
        "specular_albedo": np.array([[0.75], [0.5]], np.float32),
        "exponent_bin_probabilities": probabilities,
    }
    rows = measure(batch, answer)
    assert rows["iou"].tolist() == [0.5, 0.0]
    assert rows["intersection"].tolist() == [2, 0] and rows["union"].tolist() == [4, 4]
    assert rows["coverage"].tolist() == [0.5, 0.0]
    assert rows["bin_distance"].tolist() == [2, 7]
    expected = 0.25 * shininess.LOG_MEANS[2] + 0.75 * shininess.LOG_MEANS[4]
    assert rows["log_error"][0] == pytest.approx(abs(expected - 1))
    assert rows["log_error_winning"][0] == pytest.approx(shininess.LOG_MEANS[4] - 1)
    assert rows["diffuse_absolute"] == pytest.approx([0.1, 0.1])
    assert rows["diffuse_squared"] == pytest.approx([0.01, 0.01], rel=1e-4)
    assert rows["specular_absolute"] == pytest.approx([0.5, 0.5])
    # Half as much again inside the mask, all of it missing; an empty mask does not count.
    assert rows["specular_shading_relative"] == pytest.approx([0.5, 0.0])
    assert rows["mirror_relative"] == pytest.approx([1.0, 0.0])
    assert rows["specular_shading_lit"].tolist() == rows["mirror_lit"].tolist() == [1, 0]


def test_a_regressed_exponent_by_hand():
    """log10 s of 0.5 and 3 for exponents of 10 and 0: bins 1 and 7 for 2 and 0."""
    answer = _perfect(_batch())
    del answer["exponent_bin_probabilities"]
    answer["log_exponent"] = np.array([[0.5], [3.0]], np.float32)
    rows = measure(_batch(), answer)
    assert rows["predicted_bin"].tolist() == [1, 7]
    assert rows["bin_distance"].tolist() == [1, 7]
    assert rows["log_error"] == pytest.approx([0.5, 3.0])
    alpha = np.array([[10.0, 10**0.5], [1.0, 1000.0]])
    alpha = np.minimum((2 / (alpha + 2)) ** 0.625, 0.6)
    assert rows["ggx_alpha_error"] == pytest.approx(np.abs(np.diff(alpha))[:, 0], rel=1e-5)
    assert "log_error_winning" not in rows
    answer["log_exponent"] = np.log10(np.array([[10.0], [1.0]], np.float32))
    perfect = measure(_batch(), answer)
    assert perfect["bin_distance"].tolist() == [0, 0]
    # No class's width is left.
    assert perfect["log_error"] == pytest.approx([0, 0], abs=1e-6)


def test_a_number_that_is_none_is_left_for_the_check_to_name():
    answer = _perfect(_batch()) | {"log_exponent": np.array([[np.nan], [1.0]], np.float32)}
    rows = measure(_batch(), answer)
    assert np.isnan(rows["log_error"]).tolist() == [True, False]


@pytest.mark.parametrize("lacking", [["mirror"], ["specular_shading", "mirror"]])
def test_layers_that_are_not_answered_have_no_column(lacking):
    answer = {name: v for name, v in _perfect(_batch()).items() if name not in lacking}
    rows = measure(_batch(), answer)
    whole = measure(_batch(), _perfect(_batch()))
    columns = {f"{name}_{column}" for name in lacking for column in ("relative", "lit")}
    assert set(whole) - set(rows) == columns


def test_extreme_layers_keep_every_column_finite():
    batch, answer = _batch(), _perfect(_batch())
    batch["specular_shading"] = np.full_like(batch["mirror"], 65504.0)
    batch["mirror"] = np.full_like(batch["mirror"], 1e-7)
    batch["shininess"] = np.array([1e30, 0.0], np.float32)
    answer["mirror"] = np.full_like(batch["mirror"], 59873.0)
    answer["diffuse_albedo"] = np.zeros_like(batch["diffuse_albedo"])
    for name, column in measure(batch, answer).items():
        if column.dtype.kind in "fi":
            assert np.all(np.isfinite(column)), name


def _write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")


@pytest.mark.parametrize("learnt", [None, "furnace", "printed"])
@pytest.mark.parametrize("shown", ["furnace", "printed"])
def test_a_model_is_measured_in_its_own_unit_alone(tmp_path, learnt, shown):
    _write(tmp_path / "run" / "config.json", {"config": {} if learnt is None else {"lobe": learnt}})
    _write(tmp_path / "corpus" / "test" / "manifest.json", {"description": {"shading": shown}})
    split = Split(tmp_path / "corpus", "test")
    if (learnt or "furnace") == shown:
        check_lobe(tmp_path / "run", split)
    else:
        with pytest.raises(ValueError, match=f"test split with --lobe {learnt or 'furnace'}"):
            check_lobe(tmp_path / "run", split)
