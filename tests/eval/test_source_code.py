"""What a result follows from: its module and all that it imports, but no word about them."""

import shutil
from pathlib import Path

import pytest
import source_copies

from lime_keras.eval.source_code import (
    code_of,
    digest,
    essence,
    folders_of_packages,
    imported,
)
from lime_keras.eval.tradeoff import timing

SOURCE = {
    "pack/__init__.py": "from .inner import one\n",
    "pack/inner/__init__.py": '"""Words."""\nfrom pack.inner.deep import one\n',
    "pack/inner/deep.py": "import json\none = 1\n",
    "pack/top.py": "def late():\n    from .inner import deep\n    from . import aside\n",
    "pack/aside.py": "import pack.top\n",
    "pack/apart.py": "one = 1\n",
    "pack/taking.py": "from pack.inner import one\n",
    "other/reads.py": "from pack import apart\n",
}


@pytest.fixture
def packages(tmp_path):
    for name, text in SOURCE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return {"pack": tmp_path / "pack", "pack.other": tmp_path / "other"}


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("pack.apart", {"pack.apart"}),
        # Inside a function; modules that import one another; no package's own file for a module.
        ("pack.top", {"pack.top", "pack.inner.deep", "pack.aside"}),
        ("pack.taking", {"pack.taking", "pack.inner", "pack.inner.deep"}),
        ("pack", {"pack", "pack.inner", "pack.inner.deep"}),
        # A package that lies in a folder of its own.
        ("pack.other.reads", {"pack.other.reads", "pack.apart"}),
        ("json", set()),
    ],
)
def test_a_module_follows_from_all_that_it_imports(module, names, packages):
    found = imported(module, packages)
    assert found.keys() == names and all(path.is_file() for path in found.values())


ALIKE = {
    "a comment": "def f(x):  # twice\n    return 2 * x",
    "a docstring": 'def f(x):\n    """Twice."""\n    return 2 * x',
    "a module's docstring": '"""Twice."""\ndef f(x):\n    return 2 * x',
    "layout": "def f(\n    x,\n):\n\n    return (2*x)",
}
OTHER = {
    "a number": "def f(x):\n    return 3 * x",
    "a text that is used": 'def f(x):\n    return "2" * x',
    "a name": "def g(x):\n    return 2 * x",
    "a call for its effect": "def f(x):\n    print(x)\n    return 2 * x",
}


@pytest.mark.parametrize("text", ALIKE.values(), ids=ALIKE)
def test_words_and_layout_do_not_count(text):
    assert essence(text) == essence("def f(x):\n    return 2 * x")


def test_imports_count_unless_they_are_to_be_left_out():
    one, other = "import json\nfrom a import b\nx = 1", "import math\nx = 1"
    assert essence(one) != essence(other)
    assert essence(one, imports=False) == essence(other, imports=False) == essence("x = 1")


@pytest.mark.parametrize("text", OTHER.values(), ids=OTHER)
def test_all_else_counts(text):
    assert essence(text) != essence("def f(x):\n    return 2 * x")


def test_a_hash_tells_modules_and_their_code_apart(packages):
    apart, deep = packages["pack"] / "apart.py", packages["pack"] / "inner" / "deep.py"
    hashes = {digest({"a": apart}), digest({"b": apart}), digest({"a": deep})}
    hashes |= {digest({"a": apart, "b": deep}), digest({"b": deep, "a": apart})}
    assert len(hashes) == 4


def test_the_source_is_the_same_wherever_it_lies(tmp_path):
    """In a wheel the three others lie in the library's folder."""
    module = "lime_keras.eval.accuracy.stored"
    copies = source_copies.write(tmp_path / "copies")
    wheel = tmp_path / "lime_keras"
    shutil.copytree(copies["lime_keras"], wheel)
    inside = {"lime_keras": wheel}
    for name in ("render", "train", "eval"):
        inside[f"lime_keras.{name}"] = wheel / name
        shutil.copytree(copies[f"lime_keras.{name}"], wheel / name)
    assert digest(imported(module, copies)) == digest(imported(module, inside)) == code_of(module)


def test_a_result_does_not_follow_from_what_has_no_part_in_it(tmp_path):
    copies = source_copies.write(tmp_path)
    errors = imported("lime_keras.eval.accuracy.stored", copies)
    times = imported(timing.__name__, copies)
    assert {"lime_keras.networks.system", "lime_keras.optics.shininess"} <= errors.keys()
    assert {"lime_keras.networks.system", "lime_keras.eval.tradeoff.runtimes"} <= times.keys()
    apart = ("render", "train", "live", "video", "commands", "eval.report", "eval.stability")
    for name in errors | times:
        assert not name.startswith(tuple(f"lime_keras.{folder}" for folder in apart)), name
    assert "lime_keras.metrics" in errors and "lime_keras.metrics" not in times


def test_modules_alone_are_hashed_without_their_imports():
    alone = code_of(timing.__name__, alone=True)
    assert alone == digest({timing.__name__: Path(timing.__file__)})
    whole = imported(timing.__name__, folders_of_packages())
    assert code_of(timing.__name__) == digest(whole) != alone
