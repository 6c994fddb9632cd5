"""The table at the end of a run."""

from lime_keras.train.state import Curve
from lime_keras.train.summary import table


def test_held_out_losses_before_and_after_each_stage(tmp_path):
    one = Curve(tmp_path / "curves" / "1-segmentation.csv", 0)
    one.add(0, {}, {"loss": 0.5, "mask": 0.5})
    one.add(3, {"loss": 0.1, "mask": 0.1}, {"loss": 0.25, "mask": 0.25})
    two = Curve(tmp_path / "curves" / "6-specular+mirror.csv", 0)
    two.add(0, {}, {"loss": 3.0, "specular": 1.0, "mirror": 2.0})
    two.add(7, {"loss": 2.0}, {"loss": 2.0, "specular": 0.5, "mirror": 1.5})
    lines = [line.split() for line in table(tmp_path).splitlines()]
    assert lines == [
        ["stage", "batches", "minutes", "held-out", "loss", "before", "after"],
        ["segmentation", "3", "0.0", "mask", "0.5000", "0.2500"],
        ["specular+mirror", "7", "0.0", "loss", "3.0000", "2.0000"],
        ["specular", "1.0000", "0.5000"],
        ["mirror", "2.0000", "1.5000"],
    ]


def test_no_curves_no_table(tmp_path):
    assert table(tmp_path) == ""
