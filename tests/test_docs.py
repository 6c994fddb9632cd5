"""The documentation: its examples run, what it names exists, docstrings begin plainly."""

import doctest
import importlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import script_files
import sphere_corpus
import yaml
from PIL import Image

from lime_keras import Estimator
from lime_keras.render import cli as render_cli
from lime_keras.version import __version__

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
CARD = ROOT / "lime_keras" / "pretrained" / "README.md"
HISTORY = {CARD, DOCS / "results.md", *(DOCS / "lab").glob("*.md")}
"""Pages that tell how something came about, also by commands of earlier versions."""
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md", CARD]
COMMANDS = {
    "lime-estimate": "lime_keras.render.commands.clone",
    "lime-export": "lime_keras.commands.export",
    "lime-live": "lime_keras.commands.live",
    "lime-render": "lime_keras.render.cli",
    "lime-train": "lime_keras.train.cli",
    "lime-eval": "lime_keras.eval.cli",
}


def named(path):
    return path.relative_to(ROOT).as_posix()


def read(path):
    return path.read_text(encoding="utf-8")


def examples():
    for page in TEXTS:
        for number, code in enumerate(re.findall(r"```python\n(.*?)```", read(page), re.DOTALL), 1):
            yield pytest.param(code, id=f"{named(page)}-{number}")


@pytest.fixture
def desk(tmp_path, monkeypatch, tiny_model):
    """A folder with the files that the examples name, and weights that load fast."""
    monkeypatch.chdir(tmp_path)
    _, *others = Estimator.__init__.__defaults__
    monkeypatch.setattr(Estimator.__init__, "__defaults__", (tiny_model, *others))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    sphere_corpus.write_split(tmp_path / "corpus", "test", [range(1)], size=32)


@pytest.mark.parametrize("code", [*examples()])
def test_the_example_runs(code, desk):
    exec(compile(code, "example", "exec"), {})


def paper_rows():
    """The rows of the map of the paper: its place, what it says, code and tests."""
    text = read(DOCS / "explanation" / "paper.md")
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in row] for row in rows]
    return [row for row in rows if len(row) in (4, 5) and "`" in row[2]]


def test_every_row_of_the_map_of_the_paper_names_its_tests():
    rows = paper_rows()
    assert len(rows) > 60
    kinds = {row[4].split()[0].strip(":;") for row in rows if len(row) == 5}
    assert {"faithful", "a", "changed", "not"} <= kinds
    for place, _, _, tests, *_ in rows:
        named_tests = re.findall(r"`([^`]+)`", tests)
        assert named_tests, place
        for name in named_tests:
            path = ROOT / "tests" / name
            found = [path] if path.suffix else sorted(path.glob("test_*.py"))
            assert found, name
            assert all("\ndef test_" in read(file) for file in found), name


def test_the_map_of_the_paper_names_code_that_exists():
    """Files, folders, and the functions and constants after a file's colon."""
    page = read(DOCS / "explanation" / "paper.md")
    paths = 0
    for span in re.findall(r"`([^`]+)`", page):
        path, _, name = span.partition(": ")
        if not re.fullmatch(r"[\w/]+(\.py|/)", path):
            continue
        paths += 1
        assert (ROOT / path).exists() or (ROOT / "tests" / path).exists(), span
        if name:
            defined = re.escape(re.split(r"\W", name)[0])
            pattern = rf"^(def|class) {defined}\b|^{defined}\b.* ="
            assert re.search(pattern, read(ROOT / path), re.MULTILINE), span
    assert paths > 60


def plain(text):
    """Markdown without its code."""
    text = re.sub(r"^(```|~~~).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"^ {4}.*$", "", re.sub(r"`[^`\n]*`", "", text), flags=re.MULTILINE)


def anchors(text):
    """The names under which a page's headings can be linked to."""
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_its_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^()\s]+)\)", plain(read(page))):
        if link.startswith("http"):
            continue
        place, _, anchor = link.partition("#")
        target = page.parent / place if place else page
        assert target.exists(), link
        if anchor:
            assert anchor in set(anchors(read(target))), link


def test_every_page_is_in_a_table_of_contents():
    listed = set()
    for page in PAGES:
        for body in re.findall(r"```\{toctree\}\n(.*?)```", read(page), re.DOTALL):
            entries = [line for line in body.splitlines() if line and not line.startswith(":")]
            for entry in entries:
                path = page.parent / entry
                assert path.with_suffix(".md").is_file() or path.with_suffix(".rst").is_file()
                listed.add(path.with_suffix(".md").resolve())
    assert listed >= {page.resolve() for page in PAGES} - {(DOCS / "index.md").resolve()}


def test_the_docs_that_code_names_exist():
    for folder in ("lime_keras", "render", "train", "eval", "benchmarks", "examples", "docs"):
        for path in (ROOT / folder).rglob("*.py"):
            for place in re.findall(r"docs/[\w/-]+\.md", read(path)):
                assert (ROOT / place).is_file(), f"{named(path)}: {place}"


def told(command, *arguments, width=88):
    """The text of a command's help."""
    help_of = script_files.load(DOCS / "command_help.py").text
    return help_of(COMMANDS[command], [*arguments], columns=width)


@pytest.fixture(scope="module")
def options():
    """The options of each command, those of its subcommands among them."""
    out = {name: told(name) for name in COMMANDS}
    out["lime-render"] += "".join(told("lime-render", name) for name in render_cli.COMMANDS)
    return {name: set(re.findall(r"--[a-z][\w-]*", text)) for name, text in out.items()}


@pytest.mark.parametrize("page", [page for page in TEXTS if page not in HISTORY], ids=named)
def test_the_options_that_it_shows_are_those_of_the_commands(page, options):
    lines = read(page).replace("\\\n", " ")
    for name, rest in re.findall(r"\b(lime-[a-z]+)((?: +[^ \n`;#]+)+)", lines):
        if name not in options:
            continue
        shown = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", rest))
        assert shown <= options[name], f"{name}: {shown - options[name]}"


def command_lines(page):
    """The commands in the blocks of a page that stand there as they are typed."""
    lines = read(page).replace("\\\n", " ")
    for line in re.findall(r"^(?: {4}|\$ )(?:[A-Z_]+=\S+ )?(lime-[a-z]+.*)$", lines, re.MULTILINE):
        if not re.search(r"[\[\]$…|]|\.\.\.", line.split("#")[0]):
            yield shlex.split(line, comments=True)


@pytest.mark.parametrize(
    "page", [page for page in TEXTS if page not in HISTORY and [*command_lines(page)]], ids=named
)
def test_the_commands_in_its_blocks_are_understood(page):
    """Typed, or copied by the button, with all that stands beside them."""
    for name, *arguments in command_lines(page):
        module = importlib.import_module(COMMANDS[name])
        of_render = name == "lime-render" and arguments[0] in render_cli.COMMANDS
        (module.commands() if of_render else module.parser()).parse_args(arguments)


@pytest.mark.parametrize("page", TEXTS, ids=named)
def test_the_targets_of_make_that_it_names_exist(page):
    targets = set(re.findall(r"^([\w-]+):(?!=)", read(ROOT / "Makefile"), re.MULTILINE))
    assert set(re.findall(r"(?:`|^ {4})make ([\w-]+)", read(page), re.MULTILINE)) <= targets


def test_the_reference_has_every_command():
    page = read(DOCS / "reference" / "commands.md")
    for module in COMMANDS.values():
        assert f"<!-- help: {module} -->\n" in page
    for name in render_cli.COMMANDS:
        assert f"<!-- help: lime_keras.render.cli {name} -->\n" in page
    stale = script_files.load(DOCS / "command_help.py").written_anew(page) != page
    assert not stale, "a command's help has changed: make commands"


def test_the_figures_of_the_pages_are_those_of_the_files():
    figures = script_files.load(DOCS / "figures.py")
    for page in figures.PAGES:
        assert figures.written_anew(read(page)) == read(page), f"{named(page)}: make readme"
        # A comment that begins a line ends the paragraph.
        assert not re.search("^<!-- figure", read(page), re.MULTILINE), named(page)


def test_a_figure_that_its_file_lacks_is_an_error_unless_a_dash_is_meant():
    figures = script_files.load(DOCS / "figures.py")
    assert figures.figure("photographs; live, given mask; iou; .1%–") == "–"
    with pytest.raises(KeyError, match="iou"):
        figures.figure("photographs; live, given mask; iou; .1%")


def test_the_citation_is_of_this_version():
    cited = yaml.safe_load(read(ROOT / "CITATION.cff"))
    assert cited["version"] == __version__
    assert cited["preferred-citation"]["year"] == 2018


def examined():
    """The modules whose docstrings hold examples."""
    for path in sorted((ROOT / "lime_keras").rglob("*.py")):
        if ">>> " in read(path):
            yield ".".join(path.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("name", [*examined()])
def test_the_examples_of_docstrings_are_right(name):
    assert not doctest.testmod(importlib.import_module(name)).failed


def made(pictures, folder):
    """Make pictures of the docs in a folder; return their sizes by name."""
    command = [sys.executable, DOCS / "pictures", "--out", folder, "--only", *pictures]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = [path for path in folder.rglob("*") if path.suffix in (".webp", ".png")]
    return {path.name: Image.open(path).size for path in found}


def test_the_picture_of_the_first_material_is_made(tmp_path):
    (size,) = made(["first-material"], tmp_path).values()
    assert min(size) >= 600


@pytest.mark.slow
def test_all_pictures_of_the_docs_are_made(tmp_path):
    sizes = made(["layers", "dichromatic", "photographs"], tmp_path)
    assert sizes.keys() == {"layers.webp", "exponents.webp", "dichromatic.webp", "photographs.webp"}
    rows = len([*(ROOT / "examples" / "photos").glob("*.png")])
    assert sizes["photographs.webp"][1] > 200 * rows
