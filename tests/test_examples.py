"""The examples read the exported files, without this package, as it reads its own weights.

One renders what a corpus holds.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import nbclient
import nbformat
import numpy as np
import pytest
from PIL import Image

from lime_keras.export import exporter
from lime_keras.model import weights
from lime_keras.networks import assemble
from lime_keras.optics import shininess

EXAMPLES = Path(__file__).parent.parent / "examples"
OF_THIS_PACKAGE = {EXAMPLES / "render_one.py", EXAMPLES / "first_material.ipynb"}
"""Examples of the package itself."""


@pytest.fixture(scope="module")
def photo(corpus, tmp_path_factory):
    """A picture of the network's size, which nobody has to resample: `(1, 32, 32, 3)`, its file."""
    levels = np.round(255 * exporter.corpus_pictures(corpus, "test", 32)[:1]).astype(np.uint8)
    path = tmp_path_factory.mktemp("photo") / "photo.png"
    Image.fromarray(levels[0]).save(path)
    return levels.astype(np.float32) / 255, path


@pytest.fixture(scope="module")
def expected(tiny_model, photo):
    """What the examples print, by Keras."""
    answer = assemble(weights.load(tiny_model)[1])(photo[0])
    found = {name: np.array(value)[0] for name, value in answer.items()}
    log = shininess.log_expected(found["exponent_bin_probabilities"])
    return {
        "diffuse_albedo": found["diffuse_albedo"].tolist(),
        "specular_albedo": float(found["specular_albedo"][0]),
        "exponent": float(10**log),
        "mask_coverage": float(found["mask"].mean()),
    }


@pytest.fixture(scope="module")
def exported(tiny_model, tiny_export, corpus, tmp_path_factory):
    """Exports on demand: `exported(format, precision)` is a path."""

    def path(model_format, precision="float32"):
        if precision == "float32":
            folder, _ = tiny_export(model_format)
        else:
            folder = tmp_path_factory.mktemp("exported")
            exporter.export(folder, model_format, tiny_model, precision=precision, corpus=corpus)
        return exporter.target(folder, model_format, precision)

    return path


def run(*command, env=None):
    command = list(map(str, command))
    done = subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def check(found, expected, precision):
    """The exponent in decades; of few bits what the tiny network makes of them."""
    within = {"float32": 1e-4, "float16": 5e-3, "int8": 0.1}[precision]
    assert found.keys() == expected.keys()
    np.testing.assert_allclose(found["diffuse_albedo"], expected["diffuse_albedo"], atol=within)
    for name in ("specular_albedo", "mask_coverage"):
        assert found[name] == pytest.approx(expected[name], abs=within)
    assert np.log10(found["exponent"] / expected["exponent"]) == pytest.approx(0, abs=within)


def test_no_example_of_an_exported_model_imports_this_package():
    for path in set(EXAMPLES.glob("*.*")) - OF_THIS_PACKAGE:
        assert "lime_keras" not in path.read_text(encoding="utf-8"), path


def test_onnx_runtime_in_python(exported, photo, expected, tmp_path):
    """It leaves nothing in the user's folders, as ONNX Runtime does if it may."""
    command = (sys.executable, "onnx_python.py", exported("onnx"), photo[1])
    found = run(*command, env={"PATH": os.environ["PATH"], "HOME": str(tmp_path)})
    check(found, expected, "float32")
    assert not list(tmp_path.iterdir())


NARROW = [pytest.param(name, marks=pytest.mark.slow) for name in ("float16", "int8")]


@pytest.mark.parametrize("precision", ["float32", *NARROW])
def test_onnx_runtime_web_under_node(precision, exported, photo, expected):
    if not shutil.which("node"):
        pytest.skip("there is no node: install Node.js 20 or newer")
    if not (EXAMPLES / "node_modules" / "onnxruntime-web").is_dir():
        pytest.skip(f"there is no onnxruntime-web: npm install --prefix {EXAMPLES}")
    file = exported("onnx", precision)
    check(run("node", "onnx_web.mjs", file, photo[1]), expected, precision)


@pytest.mark.slow
def test_tensorflow_in_python(exported, photo, expected):
    folder = exported("savedmodel")
    check(run(sys.executable, "savedmodel_python.py", folder, photo[1]), expected, "float32")


def test_a_photo_of_any_shape_and_orientation_is_read(exported, tmp_path):
    """One that the camera stored lying on its side is the same photo; as JPEG, nearly."""
    upright = Image.fromarray(np.random.default_rng(0).integers(0, 256, (3, 4, 3), np.uint8))
    upright = upright.resize((160, 120))
    orientation = Image.Exif()
    orientation[274] = 6
    upright.save(tmp_path / "upright.png")
    upright.rotate(90, expand=True).save(tmp_path / "side.jpg", exif=orientation, quality=98)
    file = exported("onnx")
    commands = [[sys.executable, "onnx_python.py"]]
    if shutil.which("node") and (EXAMPLES / "node_modules").is_dir():
        commands.append(["node", "onnx_web.mjs"])
    for command in commands:
        one, other = (run(*command, file, tmp_path / name) for name in ("upright.png", "side.jpg"))
        check(other, one, "float16")


@pytest.mark.slow
def test_one_example_is_rendered_from_what_is_built_in(tmp_path):
    command = [sys.executable, "render_one.py", tmp_path, "3"]
    done = subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = dict(line.split(": ") for line in done.stdout.splitlines())
    assert [path.name for path in (tmp_path / "rooms").iterdir()] == [told["light"]]
    assert told["shape"].startswith("train-") and 1 <= float(told["shininess"]) <= 1000
    seen = {path.stem: np.asarray(Image.open(path)) for path in tmp_path.glob("*.png")}
    assert seen["environment"].shape == (64, 128)
    assert seen["image"].shape == seen["normal"].shape == (256, 256, 3)
    inside = seen["mask"] == 255
    assert 0.02 < inside.mean() < 1
    for name in ("diffuse_shading", "specular_shading", "mirror"):
        assert seen[name][inside].mean() > 10 and seen[name][seen["mask"] == 0].max() == 0


@pytest.mark.slow
def test_the_notebook_runs(tmp_path):
    """From the photo to the file for Blender, which lies elsewhere: nothing is left beside it."""
    notebook = nbformat.read(EXAMPLES / "first_material.ipynb", as_version=4)
    place = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, resources=place).execute()
    printed = notebook.cells[-1].outputs[0]["text"].strip()
    written = json.loads(Path(printed).read_text())
    assert written["materials"][0]["name"] == "first-material"
    assert not list(tmp_path.iterdir())
