"""What is run by hand, benchmarks and examples, imports only what is there."""

import ast
from pathlib import Path

import pytest
import script_files

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
    module = script_files.load(path)
    assert path.stem in ("record", "scenes") or callable(module.main)
