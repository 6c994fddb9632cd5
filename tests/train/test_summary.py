"""The table at the end of a run."""

import json

from lime_keras.train.state import Curve
from lime_keras.train.summary import evaluation, table


def test_validation_losses_before_and_after_each_stage(tmp_path):
    one = Curve(tmp_path / "curves" / "1-segmentation.csv", 0)
    two = Curve(tmp_path / "curves" / "6-specular+mirror.csv", 0)
    for curve, step, validation, measure in (
        (one, 0, {"loss": 0.5, "mask": 0.5}, {"mask_iou_pooled": 0.0}),
        (one, 3, {"loss": 0.25, "mask": 0.25}, {"mask_iou_pooled": 0.9}),
        (two, 0, {"loss": 3.0, "specular": 1.0, "mirror": 2.0}, {"mirror_relative": 1.0}),
        (two, 7, {"loss": 2.0, "specular": 0.5, "mirror": 1.5}, {"mirror_relative": 0.875}),
    ):
        training = {"loss": 2.0} if step else {}
        curve.add(step, {"training": training, "validation": validation, "measure": measure})
    lines = [line.split() for line in table(tmp_path).splitlines()]
    assert lines == [
        "stage batches minutes validation loss or measure before after".split(),
        ["segmentation", "3", "0.0", "mask", "0.5000", "0.2500"],
        ["mask_iou_pooled", "0.0000", "0.9000"],
        ["specular+mirror", "7", "0.0", "loss", "3.0000", "2.0000"],
        ["specular", "1.0000", "0.5000"],
        ["mirror", "2.0000", "1.5000"],
        ["mirror_relative", "1.0000", "0.8750"],
    ]


def test_measures_of_the_whole_system(tmp_path):
    found = {"examples": 48, "measures": {"mask_iou_pooled": 0.75, "exponent_exact": None}}
    (tmp_path / "evaluation.json").write_text(json.dumps(found), encoding="utf-8")
    lines = [line.split("  ") for line in evaluation(tmp_path).splitlines()]
    assert [[cell.strip() for cell in line if cell] for line in lines] == [
        ["whole system", "of 48 validation examples"],
        ["mask_iou_pooled", "0.7500"],
        ["exponent_exact", "not finite"],
    ]
