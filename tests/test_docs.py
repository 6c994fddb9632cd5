"""The documentation: its examples run, the files it names exist, docstrings begin plainly."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from lime_keras.io import photo

ROOT = Path(__file__).parent.parent
PAGES = ("README.md", "docs/estimating.md")


def examples():
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for number, code in enumerate(re.findall(r"```python\n(.*?)```", text, re.DOTALL), 1):
            yield pytest.param(code, id=f"{page}-{number}")


@pytest.fixture
def desk(tmp_path, monkeypatch, tiny_model):
    """A folder with the files that the examples name, and weights that load fast."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "lime_keras.estimate.estimator.Estimator.__init__.__defaults__",
        (tiny_model, None, "onnx", None),
    )
    rng = np.random.default_rng(0)
    for name, shape in (("photo.jpg", (40, 60, 3)), ("other.png", (30, 30, 3))):
        photo.write(tmp_path / name, rng.uniform(size=shape))
    photo.write(tmp_path / "mask.png", np.ones((30, 30, 1)))


@pytest.mark.parametrize("code", examples())
def test_the_example_runs(code, desk):
    exec(compile(code, "example", "exec"), {})


def paths_of_paper():
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    return sorted(set(re.findall(r"`([\w/]+\.py)", text)))


@pytest.mark.parametrize("path", paths_of_paper())
def test_the_map_of_the_paper_names_files_that_exist(path):
    assert (ROOT / path).is_file() or (ROOT / "tests" / path).is_file()


RIDDLES = re.compile(
    r"(As|By|Every|For|From|How|In|It|Of|Such|That|Those|To|What|Where|Whether|Which|Who|With) "
)
"""First words of a sentence that neither names its thing nor says what is done."""


@pytest.mark.parametrize(
    "folder", ["lime_keras", "render", "train", "eval", "benchmarks", "examples"]
)
def test_docstrings_begin_with_a_noun_or_a_verb(folder):
    found = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and (text := ast.get_docstring(node))
        and RIDDLES.match(text)
    ]
    assert not found, "\n".join(found)
