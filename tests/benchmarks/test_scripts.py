"""What is run by hand, benchmarks and examples, imports only what is there."""

import ast
import importlib.util
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BENCHMARKS = sorted(ROOT.glob("benchmarks/*.py"))
EXAMPLES = sorted(ROOT.glob("examples/*.py"))


def named(path):
    return f"{path.parent.name}/{path.stem}"


@pytest.mark.parametrize("path", [*BENCHMARKS, *EXAMPLES], ids=named)
def test_all_that_a_script_imports_is_there(path):
    """What a function imports when it is called, too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            exec(ast.unparse(node), {})


@pytest.mark.parametrize("path", BENCHMARKS, ids=named)
def test_what_a_benchmark_begins_with_is_there(path):
    """Its constants name presets, qualities and the like; nothing is measured before `main`."""
    module = loaded(path)
    assert path.stem == "record" or callable(module.main)


def loaded(path):
    spec = importlib.util.spec_from_file_location(f"benchmark_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CODE = '"""Words."""\nimport json\nWIDTH = 16\n'
CHANGES = {
    "nothing": ({}, []),
    "words": ({"code/a.py": CODE.replace("Words", "Other words") + "# More.\n"}, []),
    "imports": ({"code/a.py": CODE.replace("json", "math")}, []),
    "a move": ({"code/a.py": None, "code/inside/b.py": CODE}, []),
    "a file elsewhere": ({"apart.py": "WIDTH = 32\n"}, []),
    "a number": ({"code/a.py": CODE.replace("16", "32")}, ["code/a.py"]),
    "a move with a change": (
        {"code/a.py": None, "code/b.py": CODE.replace("16", "32")},
        ["code/a.py", "code/b.py"],
    ),
    "a file of words that is gone": ({"code/__init__.py": None}, []),
    "a copy": ({"code/b.py": CODE}, ["code/b.py"]),
    "a page of text": ({"code/README.md": "Words.\n"}, []),
    "data": ({"code/weights": "2"}, ["code/weights"]),
}


@pytest.mark.parametrize(("files", "expected"), CHANGES.values(), ids=CHANGES)
def test_a_figure_is_stale_if_what_it_follows_from_has_changed(
    files, expected, tmp_path, monkeypatch
):
    def git(*arguments):
        named = ("-c", "user.name=n", "-c", "user.email=e")
        command = ["git", *named, *arguments]
        return subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)

    def put(name, text):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")

    git("init")
    for name, text in {
        "code/__init__.py": '"""Words."""\n',
        "code/a.py": CODE,
        "code/weights": "1",
        "apart.py": "WIDTH = 16\n",
    }.items():
        put(name, text)
    git("add", ".")
    git("commit", "-m", "before")
    commit = git("rev-parse", "HEAD").stdout.strip()
    for name, text in files.items():
        if text is None:
            (tmp_path / name).unlink()
        else:
            put(name, text)
    git("add", ".")
    stale = loaded(ROOT / "benchmarks" / "stale_results.py")
    monkeypatch.setattr(stale, "ROOT", tmp_path)
    figure = stale.Figure("page", "title", commit, ("code",))
    assert stale.changes(figure) == expected
    with pytest.raises(ValueError, match="git does not know 0000"):
        stale.changes(stale.Figure("page", "title", "0000", ("code",)))
