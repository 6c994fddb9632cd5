"""What a user's script sees: types, one-line descriptions, and the methods of a material."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import lime_keras
from lime_keras.io import result_json, scanner
from lime_keras.material import Caution, Material

SCRIPT = """
from lime_keras import Estimator, Material, estimate_video

estimator = Estimator("live", only=["mask", "albedo", "exponent"])
one: Material = estimator("a.png")
many: list[Material] = estimator(["a.png", b"bytes"])
reveal_type(one.exponent)
reveal_type(one.gloss)
reveal_type(estimator.size)
reveal_type(one.to_gltf("a.gltf"))
reveal_type(estimate_video("a.mp4").material)
reveal_type(one.nothing)
"""


def whole(**fields):
    return Material(np.array([0.5, 0.2, 0.1]), 0.05, 250.0, mask_coverage=0.4, **fields)


@pytest.mark.slow
def test_mypy_sees_every_type_of_a_script(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", str(script)]
    # An editable installation hides its types from checkers.
    around = os.environ | {"MYPYPATH": str(Path(lime_keras.__file__).parents[1])}
    told = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=around).stdout
    types = [line.split('"')[1] for line in told.splitlines() if "Revealed type" in line]
    assert types[:5] == [
        *("float | None", "str | None", "int", "pathlib.Path"),
        "lime_keras.material.Material",
    ]
    errors = [line for line in told.splitlines() if "error:" in line]
    assert len(errors) == 1 and '"Material" has no attribute "nothing"' in errors[0]


def test_a_material_is_told_in_a_line():
    assert repr(Material()) == "Material()"
    told = repr(whole(warnings=(Caution("grey", "it is grey"),)))
    assert told == "Material(glossy, s 250, #bc7c59, m_s 0.05, covers 40.0%, ! grey)"
    assert "no object" in repr(Material(mask_coverage=0.0))


def test_a_notebook_shows_the_preview_and_the_warnings():
    shown = whole(warnings=(Caution("grey", "it is <grey>"),))._repr_html_()
    assert shown.startswith('<img src="data:image/jpeg;base64,') and "it is &lt;grey&gt;" in shown
    assert Material(mask_coverage=0.0)._repr_html_().startswith("<p>")


def test_a_material_without_a_photo_previews_its_sphere():
    assert whole().preview().size == (320, 320)
    with pytest.raises(ValueError, match="whole material"):
        Material().preview()


def test_everything_is_saved(tmp_path):
    mask = np.zeros((40, 30, 1), np.float32)
    mask[10:30, 5:25] = 1
    photo = np.full((40, 30, 3), 0.5, np.float32)
    files = whole(layers={"mask": mask}, image_srgb=photo).save(tmp_path / "new", "vase")
    assert {path.name for path in files} == {path.name for path in (tmp_path / "new").iterdir()}
    assert [path.name for path in files] == [
        *("vase.json", "vase-mask.png", "vase-preview.png"),
        *("vase.mtl", "vase.gltf", "vase-mitsuba.json"),
    ]
    # `lime-estimate` takes none of them for a photo.
    assert result_json.read(files[0])["files"] == [path.name for path in files]
    assert not list(scanner.inside(tmp_path / "new"))
    numbers = json.loads(files[0].read_text())
    assert numbers["gloss"] == "glossy" and "image_srgb" not in numbers


def test_exports_are_methods(tmp_path):
    gltf = json.loads(whole().to_gltf(tmp_path / "a.gltf").read_text())
    assert gltf["materials"][0]["name"] == "a"
    assert "newmtl b" in whole().to_mtl(tmp_path / "b.mtl").read_text()
    assert json.loads(whole().to_mitsuba(tmp_path / "c.json").read_text())["type"] == "scene"
    with pytest.raises(ValueError, match="lacks a number"):
        Material().to_gltf(tmp_path / "d.gltf")


def test_a_photo_may_be_bytes_or_a_file_and_photos_a_list(tiny_model):
    levels = np.random.default_rng(0).integers(0, 255, (50, 40, 3), np.uint8)
    encoded = io.BytesIO()
    Image.fromarray(levels).save(encoded, "PNG")
    mask = np.zeros((50, 40), bool)
    mask[10:40, 10:30] = True
    estimator = lime_keras.Estimator(tiny_model)
    photos = [levels, encoded.getvalue(), io.BytesIO(encoded.getvalue())]
    found = estimator(photos, [mask] * 3)
    assert len({repr(material) for material in [*found, estimator(levels, mask)]}) == 1
    for wrong in (b"", b"no picture at all", io.StringIO("text")):
        with pytest.raises(ValueError):
            estimator(wrong)
    with pytest.raises(ValueError, match="a list of masks"):
        estimator(photos, mask)


def test_an_estimator_is_told_in_a_line_and_only_is_a_list(tiny_model):
    estimator = lime_keras.Estimator(tiny_model)
    assert repr(estimator).startswith("Estimator(") and "pixels" in repr(estimator)
    with pytest.raises(ValueError, match=r"pass \['albedo'\]"):
        lime_keras.Estimator(tiny_model, only="albedo")
