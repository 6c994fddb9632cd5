"""The source that a result follows from, as one hash: a module and all that it imports.

Comments, docstrings and layout are left out, for no number follows from them.
"""

import ast
import functools
import hashlib
import importlib.util
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_PACKAGES = ("lime_keras", "lime_keras.render", "lime_keras.train", "lime_keras.eval")


@functools.cache
def code_of(*modules: str, alone: bool = False) -> str:
    """Return one hash of modules and of everything in this package that they import.

    Args:
        modules: dotted names of modules of this package.
        alone: hash these modules without their imports, for a result that no other code makes.
    """
    folders = folders_of_packages()
    files = {name: _file(name, folders) for name in modules} if alone else {}
    for name in () if alone else modules:
        files |= imported(name, folders)
    return digest({name: path for name, path in files.items() if path})


def digest(files: Mapping[str, Path]) -> str:
    """Return one hash of the names and the `essence` of Python files, by name of the module."""
    out = hashlib.sha256()
    for name in sorted(files):
        out.update(f"{name}\0{essence(files[name].read_text(encoding='utf-8'))}\n".encode())
    return out.hexdigest()


def essence(source: str, *, imports: bool = True) -> str:
    """Return a text that is the same for two sources that differ in words and layout alone.

    Args:
        source: source of a module.
        imports: whether another import is another source.
    """
    return ast.dump(_Essence(imports).visit(ast.parse(source)))


def imported(module: str, folders: Mapping[str, Path]) -> dict[str, Path]:
    """Return the files of a module and of all modules that it imports, directly or not, by name.

    Imports inside functions count. A package's `__init__` counts where a name is taken from it.

    Args:
        module: dotted name.
        folders: folders of the packages, by dotted name; modules elsewhere are left out.
    """
    files: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _file(name, folders)
        if path is not None and name not in files:
            files[name] = path
            waiting += imports(name, path, folders)
    return files


class _Essence(ast.NodeTransformer):
    """Takes out docstrings, of constants too, and imports if they do not count."""

    def __init__(self, imports: bool):
        self._imports = imports

    def visit(self, node: ast.AST) -> Any:
        is_import = isinstance(node, ast.Import | ast.ImportFrom)
        return None if is_import and not self._imports else super().visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        is_text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_text else node


def imports(module: str, path: Path, folders: Mapping[str, Path]) -> Iterator[str]:
    """Yield the dotted names of the modules that a file imports."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            named = f"{'.' * node.level}{node.module or ''}"
            origin = importlib.util.resolve_name(named, package)
            for alias in node.names:
                inside = f"{origin}.{alias.name}"
                yield inside if _file(inside, folders) else origin


def _file(module: str, folders: Mapping[str, Path]) -> Path | None:
    """Return the file of a module, or None if these packages have no such module."""
    owners = [name for name in folders if module == name or module.startswith(f"{name}.")]
    if not owners:
        return None
    owner = max(owners, key=len)
    path = folders[owner].joinpath(*module.removeprefix(owner).strip(".").split("."))
    places = (path / "__init__.py", path.with_name(f"{path.name}.py"))
    return next((place for place in places if place.is_file()), None)


@functools.cache
def folders_of_packages() -> dict[str, Path]:
    """Return the folders of the library, the renderer, training and evaluation, by dotted name."""
    specs = {name: importlib.util.find_spec(name) for name in _PACKAGES}
    return {
        name: Path(place)
        for name, spec in specs.items()
        if spec
        for place in spec.submodule_search_locations or ()
    }
