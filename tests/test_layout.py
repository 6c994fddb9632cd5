"""The import direction, and what a wheel owns."""

import ast
import email
import itertools
import re
import subprocess
import sys
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lime_keras import console
from lime_keras.render import cli as render_cli

ROOT = Path(__file__).parent.parent
COMMANDS = {
    "lime-render": "render.cli",
    "lime-train": "train.cli",
    "lime-eval": "eval.cli",
    "lime-estimate": "render.commands.clone",
    "lime-export": "commands.export",
    "lime-live": "commands.live",
}
# Each row may import from the rows above it and, in it, from its own room. The rooms of one row do
# not know each other.
ROWS = {
    "lime_keras": (
        ("version",),
        ("console", "outputs", "processors"),
        ("launch", "machine"),
        ("optics",),
        ("material",),
        ("io",),
        ("data", "losses", "metrics"),
        ("networks", "lighting"),
        ("model",),
        ("runtime",),
        ("export",),
        ("estimate", "photo"),
        ("video",),
        ("__init__",),
        ("live",),
        ("commands",),
    ),
    "render": (
        ("mitsuba_setup", "shapes"),
        ("scene", "rooms"),
        ("jobs", "cloning", "cards"),
        ("inspect", "corpus"),
        ("commands",),
        ("cli",),
    ),
    "eval": (
        ("markdown_table",),
        ("accuracy", "stability"),
        ("kept", "report"),
        ("tradeoff",),
        ("sections",),
        ("cli",),
    ),
    "eval/stability": (("verdicts", "double_precision"), ("precisions",), ("systems",), ("suite",)),
}


# What the methods of a Material call, when they are called: it is drawn, saved and exported.
METHODS = {("material", "estimate"), ("material", "io")}


def _imports(path):
    """Dotted names that a file imports, at any depth: modules, or what is in them."""
    package = ["lime_keras", *path.parent.relative_to(ROOT).parts]
    package = package[1:] if package[1] == "lime_keras" else package
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def _files(folder):
    return sorted((ROOT / folder).rglob("*.py"))


def _room(folder, path):
    """The first part of a file's place below one of the four folders."""
    return path.relative_to(ROOT / folder).parts[0].removesuffix(".py")


@pytest.mark.parametrize("folder", ROWS)
def test_each_room_imports_from_the_rows_above_it(folder):
    row_of = {room: row for row, rooms in enumerate(ROWS[folder]) for room in rooms}
    inside = "lime_keras." if folder == "lime_keras" else f"lime_keras.{folder}.".replace("/", ".")
    wrong = []
    for path in _files(folder):
        room = _room(folder, path)
        if room == "__init__" and folder != "lime_keras":
            continue
        for name in _imports(path):
            if not name.startswith(inside):
                continue
            other = name.removeprefix(inside).split(".")[0]
            if other in {"render", "train", "eval", "__version__"}:
                continue
            if other != room and row_of[other] >= row_of[room] and (room, other) not in METHODS:
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_every_room_has_its_row():
    for folder, rows in ROWS.items():
        rooms = {_room(folder, path) for path in _files(folder)}
        assert rooms - {"__init__"} == set(itertools.chain(*rows)) - {"__init__"}


@pytest.mark.parametrize("folder", ["lime_keras", "render", "train", "eval"])
def test_the_four_folders_do_not_know_each_other(folder):
    """But render, train and eval know the library."""
    others = {"render", "train", "eval"} - {folder}
    for path in _files(folder):
        rooms = {name.split(".")[1] for name in _imports(path) if name.startswith("lime_keras.")}
        assert not rooms & others, path


def test_every_test_has_its_room():
    """A test lies in the folder of what it tests."""
    for path in _files("tests"):
        place = path.relative_to(ROOT / "tests")
        if len(place.parts) == 1 or place.parts[0] in ("fixtures", "fuzz", "stability"):
            continue
        assert (ROOT / place.parent).is_dir(), path


def test_networks_losses_and_stages_are_written_for_any_backend():
    files = [
        *_files("lime_keras/networks"),
        *_files("lime_keras/model"),
        ROOT / "lime_keras" / "losses.py",
        ROOT / "lime_keras" / "metrics.py",
        ROOT / "train" / "terms.py",
        ROOT / "train" / "stage_model.py",
    ]
    for path in files:
        assert "tensorflow" not in path.read_text(encoding="utf-8"), path


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        *((module, []) for module in COMMANDS.values()),
        *(("render.cli", [name]) for name in render_cli.COMMANDS),
    ],
)
def test_help_needs_neither_tensorflow_nor_mitsuba(module, arguments):
    code = (
        f"import sys, lime_keras.{module} as command\n"
        f"try: command.main({[*arguments, '--help']})\n"
        "except SystemExit as stop: assert stop.code == 0\n"
        "heavy = {'tensorflow', 'keras', 'mitsuba', 'matplotlib', 'numpy'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    assert "example" in answer.stdout


def test_the_commands_offer_what_the_library_has():
    """They repeat names, because asking the library would import TensorFlow for `--help`."""
    from lime_keras.commands import estimate as estimate_command
    from lime_keras.commands import export as export_command
    from lime_keras.export import exporter
    from lime_keras.networks import PRESETS, precision
    from lime_keras.runtime import masker
    from lime_keras.train import cli

    assert estimate_command._FAMILIES == tuple(masker.FAMILIES)
    assert cli._PRECISIONS == tuple(precision.POLICIES)
    preset = next(action for action in cli.parser()._actions if action.dest == "preset")
    assert set(preset.choices) == set(PRESETS)
    formats = next(one for one in export_command.parser()._actions if one.dest == "format")
    assert set(formats.choices) == set(exporter.FORMATS)


def test_every_recipe_is_named_wherever_recipes_are_listed():
    from lime_keras.train import cli
    from lime_keras.train.recipes.recipe import NAMES

    files = (ROOT / "train" / "recipes").glob("*.py")
    assert {path.stem for path in files if "\nRECIPE = " in path.read_text("utf-8")} == set(NAMES)
    page = (ROOT / "docs" / "how-to" / "recipes.md").read_text("utf-8")
    usage = next(one for one in cli.parser()._actions if one.dest == "recipe").help
    for name in NAMES:
        assert f"| [`{name}`](" in page
        assert name in usage and name in cli.parser().epilog


def test_the_tables_of_a_subnetwork_name_the_same():
    """What systems are made of, answer, learn by and can be asked for."""
    from lime_keras.networks import Architecture, build, output_names
    from lime_keras.networks.registry import DERIVED, OUTPUT_ROWS, QUANTITIES, SUBNETWORKS
    from lime_keras.outputs import NEEDED, OUTPUTS
    from lime_keras.train.stages import SCHEDULES
    from lime_keras.train.terms import MEASURES, TERMS

    options = ({}, {"exponent": "regression"}, {"system": "reflectance-map"})
    systems = [Architecture(32, 1, 1, 1, 1, **system) for system in options]
    built = list(map(build, systems))
    assert set().union(*map(output_names, built)) == set(OUTPUTS)
    assert tuple(OUTPUT_ROWS) == tuple(OUTPUTS)
    assert set().union(*NEEDED.values()) == set(OUTPUTS) - {"log_exponent"}
    assert {row.quantity for row in OUTPUT_ROWS.values()} == set(QUANTITIES)
    assert set().union(*built) == set(SUBNETWORKS)
    stages = [stage for system in systems for stage in SCHEDULES["paper"].stages(system)]
    assert set().union(*(stage.subnetworks for stage in stages)) == set(SUBNETWORKS)
    predicted = set().union(*(row.predicts for row in SUBNETWORKS.values()))
    assert {row.quantity for row in MEASURES.values()} == predicted - {"reflectance_map"}
    assert {term.quantity for term in TERMS.values()} == set(QUANTITIES)
    fed = {x.name for part in built for network in part.values() for x in network.inputs}
    assert fed <= {"image", *DERIVED, *QUANTITIES}


def _checked_out(*folders):
    """The files of these folders, by default of all, that belong to the project."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *folders]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.splitlines() if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    # Built from a copy, so that no build folder is left in the checkout.
    source = folder / "source"
    for name in _checked_out():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-q", "-w", str(folder), "."]
    subprocess.run(command, cwd=source, check=True)
    return next(folder.glob("*.whl"))


def test_the_wheel_holds_the_four_folders(wheel):
    """Every file of theirs, weights and templates too, where it is imported from; and no more."""
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    mapped = {f"lime_keras/{name}" for name in _checked_out("render", "train", "eval")}
    assert names == mapped | set(_checked_out("lime_keras"))
    assert "lime_keras/pretrained/live/model/architecture.json" in names
    assert "lime_keras/pretrained/live/onnx/albedo.onnx" in names


def test_the_extras_bring_what_the_commands_ask_for(wheel):
    """And no more: `console.EXTRAS` names their modules."""
    with zipfile.ZipFile(wheel) as opened:
        name = next(name for name in opened.namelist() if name.endswith(".dist-info/METADATA"))
        about = email.message_from_bytes(opened.read(name))
    brought = {}
    for text in about.get_all("Requires-Dist"):
        requirement, _, condition = text.partition(";")
        extra = re.search(r'extra == "(\w+)"', condition)
        package = re.match(r"[\w.-]+", requirement)[0].lower().replace("_", "-")
        brought.setdefault(extra and extra[1], set()).add(package)
    packages = metadata.packages_distributions()
    for extra, modules in console.EXTRAS.items():
        # Not all packages tell their modules.
        found = [packages.get(module, [module])[0] for module in modules]
        named = {package.lower().replace("_", "-") for package in found}
        assert named == brought[extra], extra
    assert brought["all"] == set().union(*(brought[extra] for extra in console.EXTRAS))
    heavy = {"tensorflow", "keras", "mitsuba", "scipy", "scikit-image", "matplotlib"}
    assert not heavy & brought[None]


def _environment(home, requirement):
    """A clean environment with what pip installs for a requirement; returns its programs."""
    venv.create(home, with_pip=True)
    subprocess.run([home / "bin/python", "-m", "pip", "install", "-q", requirement], check=True)
    return home / "bin"


@pytest.mark.slow
def test_the_wheel_alone_estimates(wheel, tmp_path):
    """Without extras it is small, and what takes more says what to install."""
    programs = _environment(tmp_path / "venv", str(wheel))
    installed = (path for path in programs.parent.rglob("*") if path.is_file())
    assert sum(path.stat().st_size for path in installed) < 400e6
    photo = np.random.default_rng(0).integers(0, 256, (90, 120, 3), np.uint8)
    Image.fromarray(photo).save(tmp_path / "photo.png")
    # Noise shows no object.
    Image.fromarray(np.full((90, 120), 255, np.uint8)).save(tmp_path / "photo_mask.png")

    def run(*command):
        program = [programs / command[0], *command[1:]]
        return subprocess.run(program, cwd=tmp_path, capture_output=True, text=True)

    answer = run("lime-estimate", "photo.png")
    assert answer.returncode == 0, answer.stderr
    assert (tmp_path / "materials" / "photo-preview.png").is_file()
    estimated = "Estimator().estimate('photo.png', 'photo_mask.png')"
    code = f"from lime_keras import Estimator; print({estimated}.exponent)"
    assert 1 <= float(run("python", "-c", code).stdout) <= 1000
    lacking = {
        ("lime-estimate", "photo.png", "--engine", "keras"): "train",
        ("lime-estimate", "photo.png", "--clone-onto", "photo.png"): "render",
        ("lime-render", "corpus", "--split", "test", "--count", "2"): "train,render",
        ("lime-train", "corpus", "--out", "run", "--preset", "smoke"): "train",
        ("lime-eval", "--stability", "--out", "eval"): "train",
        ("lime-export", "exported", "--format", "onnx"): "train",
    }
    for command, extra in lacking.items():
        answer = run(*command)
        assert answer.returncode == 1, command
        assert f"pip install '.[{extra}]'" in answer.stderr, command


@pytest.mark.slow
def test_the_wheel_works_from_a_clean_environment(wheel, tmp_path):
    """Installed with all extras, run from another folder."""
    home = tmp_path / "venv"
    _environment(home, f"{wheel}[all]")
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
