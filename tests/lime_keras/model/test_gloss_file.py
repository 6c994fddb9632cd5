"""The calibration of the words for a gloss, beside a model's weights."""

import shutil

import pytest

from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file
from lime_keras.optics import gloss


def test_it_is_read_where_it_is(tmp_path):
    (tmp_path / "model").mkdir()
    assert gloss_file.read(tmp_path) == gloss.DEFAULT
    text = '{"even": 1.5, "slope": 2.25, "scenes": 9}'
    (tmp_path / "model" / gloss_file.NAME).write_text(text)
    assert gloss_file.read(tmp_path) == gloss.Calibration(1.5, 2.25)


@pytest.mark.parametrize("text", ["{", "[]", '{"even": 1}', '{"even": 1, "slope": -2}', "{}"])
def test_a_damaged_one_is_refused_with_its_name(tmp_path, text):
    (tmp_path / gloss_file.NAME).write_text(text)
    with pytest.raises(
        ValueError, match=r"gloss.json cannot be read as a calibration.*benchmarks/gloss.py"
    ):
        gloss_file.read(tmp_path)


def test_every_set_that_ships_has_its_own():
    found = {name: gloss_file.read(run) for name, run in model_folder.shipped().items()}
    assert gloss.DEFAULT not in found.values() and len(set(found.values())) == len(found)


@pytest.mark.parametrize("changed", [False, True])
def test_it_is_kept_while_the_weights_are(tmp_path, changed):
    model, text = tmp_path / "model", '{"even": 1.5, "slope": 2.25}'

    def write(weights):
        shutil.rmtree(model, ignore_errors=True)
        model.mkdir()
        (model / "architecture.json").write_text("{}")
        (model / "albedo.weights.h5").write_bytes(weights)

    with gloss_file.kept(tmp_path):  # nothing is there yet
        write(b"weights")
    (model / gloss_file.NAME).write_text(text)
    with gloss_file.kept(tmp_path):
        write(b"others" if changed else b"weights")
    assert (model / gloss_file.NAME).is_file() != changed
    assert changed or (model / gloss_file.NAME).read_text() == text
