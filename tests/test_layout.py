"""The import direction, and what a wheel owns."""

import ast
import itertools
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
COMMANDS = ("lime-render", "lime-train", "lime-eval", "lime-estimate", "lime-export")

LEAVES = {
    *("arrays", "version", "environment", "corpus", "console", "material", "whole_files"),
    *("fusion", "frames", "cuts", "movie", "formats", "narrowing", "normal_map", "dome"),
    "flipping",
}
# What each module of the library may import from it; the leaves import no sibling.
ALLOWED = {
    "colour": {"arrays"},
    "reflectance": {"arrays"},
    "shininess": {"arrays"},
    "masking": {"arrays"},
    "dynamic_range": {"arrays"},
    "compositing": {"arrays"},
    "reflectance_map": {"compositing", "environment", "reflectance"},
    "studio": {"environment"},
    "records": {"environment"},
    "shading": {"environment", "reflectance"},
    "illumination": {"compositing", "environment", "material", "shading"},
    "metrics": {"arrays", "shininess"},
    "streaming_metrics": {"metrics"},
    "losses": {"colour", "compositing", "dynamic_range", "masking", "shininess"},
    "camera": {"colour"},
    "pipeline": {"camera", "colour", "corpus", "flipping", "records", "repainting", "shininess"},
    "repainting": {"camera", "colour"},
    "networks": {"dynamic_range", "reflectance_map", "shininess"},
    "weights": {"networks", "whole_files"},
    "photo": {"colour"},
    "samples": {"pipeline"},
    "model_card": {"networks", "shininess", "version"},
    "proof": {"formats", "narrowing"},
    "export": {
        *("corpus", "formats", "model_card", "narrowing", "networks", "proof", "samples"),
        "weights",
    },
    "framing": {"colour"},
    "interchange": {"material", "version"},
    "estimate_preview": {"colour", "framing", "material", "reflectance_map", "studio"},
    "estimate": {
        *("colour", "compositing", "framing", "material", "networks", "shininess", "weights"),
    },
    "estimate_files": {
        *("colour", "estimate_preview", "interchange", "material", "photo", "whole_files"),
    },
    # Cloning alone renders, and imports Mitsuba when it does.
    "scene_files": {
        *("colour", "dome", "illumination", "material", "normal_map", "photo", "render"),
    },
    "batch": {"estimate", "estimate_files", "material", "photo", "scene_files"},
    "overlay": {"colour", "estimate_preview", "material"},
    "tracking": {"cuts", "fusion", "material"},
    "video": {"frames", "material", "movie", "overlay", "tracking"},
    "estimate_cli": {
        "console",
        "version",
        "batch",
        "estimate",
        "estimate_files",
        "frames",
        "photo",
        "render",
        "video",
        "weights",
    },
    "export_cli": {"console", "version", "export", "weights"},
    "__init__": {"version", "estimate", "material"},
}


def _library_imports(path):
    """Names of the library's modules that a file imports, at any depth."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            # A sibling, or, with more dots than the folder is deep, somebody else.
            inside = path.parent.relative_to(ROOT).parts
            assert node.level <= len(inside), f"{path} imports from above its folder"
            assert inside[0] != "lime_keras", f"{path}: the library imports absolutely"
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [node.module] if node.module != "lime_keras" else names
        else:
            continue
        found |= {name.split(".")[1] for name in names if name.startswith("lime_keras.")}
    return found


@pytest.mark.parametrize("path", sorted((ROOT / "lime_keras").rglob("*.py")), ids=lambda p: p.stem)
def test_the_library_imports_downwards_only(path):
    relative = path.relative_to(ROOT / "lime_keras")
    module = relative.parts[0].removesuffix(".py")
    imported = _library_imports(path) - {module}
    if module in LEAVES:
        assert imported == set()
    else:
        assert imported <= ALLOWED[module]


@pytest.mark.parametrize("folder", ["render", "train", "eval"])
def test_render_train_and_eval_do_not_know_each_other(folder):
    for path in (ROOT / folder).rglob("*.py"):
        others = {"render", "train", "eval"} - {folder}
        assert not _library_imports(path) & others, path


def test_networks_losses_and_stages_are_written_for_any_backend():
    files = [
        *(ROOT / "lime_keras" / "networks").glob("*.py"),
        ROOT / "lime_keras" / "losses.py",
        ROOT / "lime_keras" / "streaming_metrics.py",
        ROOT / "train" / "measures.py",
        ROOT / "train" / "stage_model.py",
    ]
    for path in files:
        assert "tensorflow" not in path.read_text(encoding="utf-8"), path


@pytest.mark.parametrize("module", ["render", "train", "eval", "estimate_cli", "export_cli"])
def test_help_needs_neither_tensorflow_nor_mitsuba(module):
    name = f"lime_keras.{module}" if module.endswith("cli") else f"lime_keras.{module}.cli"
    code = (
        f"import sys, {name} as command\n"
        "try: command.main(['--help'])\n"
        "except SystemExit as stop: assert stop.code == 0\n"
        "heavy = {'tensorflow', 'keras', 'mitsuba', 'matplotlib', 'numpy'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    assert "example" in answer.stdout


def test_the_commands_offer_what_the_library_has():
    """They repeat names, because asking the library would import TensorFlow for `--help`."""
    from lime_keras import estimate, estimate_cli, export, export_cli
    from lime_keras.networks import PRESETS, Architecture, answers, build
    from lime_keras.train.cli import parser

    assert estimate_cli._ONLY == tuple(estimate.NEEDED)
    systems = ({}, {"exponent": "regression"}, {"system": "reflectance-map"})
    known = [answers(build(Architecture(32, 1, 1, 1, 1, **system))) for system in systems]
    assert export_cli._OUTPUTS == tuple(dict.fromkeys(itertools.chain(*known)))
    assert export_cli._PRECISIONS == export.PRECISIONS[export.ONNX]
    preset = next(action for action in parser()._actions if action.dest == "preset")
    assert set(preset.choices) == set(PRESETS)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    # Built from a copy, so that no build folder is left in the checkout.
    source = folder / "source"
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    for name in listed:
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-q", "-w", str(folder), "."]
    subprocess.run(command, cwd=source, check=True)
    return next(folder.glob("*.whl"))


def test_the_wheel_owns_one_name(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == {"lime_keras"}
    assert "lime_keras/eval/templates/report.html" in names
    assert "lime_keras/render/shards.py" in names
    shipped = {name for name in names if name.startswith("lime_keras/pretrained/live/model/")}
    assert {Path(name).name for name in shipped} >= {"architecture.json", "albedo.weights.h5"}


@pytest.mark.slow
def test_the_wheel_works_from_a_clean_environment(wheel, tmp_path):
    """Installed with everything it asks for, run from another folder."""
    home = tmp_path / "venv"
    venv.create(home, with_pip=True)
    subprocess.run([home / "bin/python", "-m", "pip", "install", "-q", str(wheel)], check=True)
    for command in COMMANDS:
        answer = subprocess.run(
            [home / "bin" / command, "--help"], cwd=tmp_path, capture_output=True, text=True
        )
        assert answer.returncode == 0, answer.stderr
    rendered = subprocess.run(
        [home / "bin/lime-render", "corpus", "--split", "test", "--count", "2", "--size", "64"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert rendered.returncode == 0, rendered.stderr
