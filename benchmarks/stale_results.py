"""Figures of the docs and the README that are older than what they depend on.

python benchmarks/stale_results.py

A comment `<!-- measured: COMMIT PATH PATH ... -->` stands above each figure. It is stale if what
lies below one of the paths has changed since that commit. No figure follows from a page of text,
from the comments, docstrings, layout and imports of a Python file, nor from its place among these
paths: they do not count. Not every other change moves a figure, and one that lies elsewhere may:
this says where to look, and no more.
"""

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
MARK = re.compile(r"<!-- measured: (?P<commit>\w+) (?P<paths>.+?) -->")


@dataclass(frozen=True)
class Figure:
    """A table or picture of the docs.

    Attributes:
        page: path of the page below the repository.
        title: heading above it.
        commit: commit at which it was measured.
        paths: files and folders, below the repository, that it depends on.
    """

    page: str
    title: str
    commit: str
    paths: tuple[str, ...]


def figures() -> Iterator[Figure]:
    """Yield the figures of all pages that carry a mark."""
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        title = ""
        for line in page.read_text(encoding="utf-8").splitlines():
            if line.startswith("#"):
                title = line.lstrip("# ")
            elif found := MARK.fullmatch(line):
                place = page.relative_to(ROOT).as_posix()
                yield Figure(place, title, found["commit"], tuple(found["paths"].split()))


def changes(figure: Figure) -> list[str]:
    """Return the files that a figure follows from and that have changed since its commit.

    Files that are changed but not committed count, too.

    Raises:
        ValueError: if the commit is not in the history.
    """
    command = ["git", "diff", "--name-only", "--no-renames", figure.commit, "--", *figure.paths]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if answer.returncode:
        raise ValueError(
            f"{figure.page}, {figure.title}: git does not know {figure.commit}: fetch the whole "
            f"history, or measure again ({answer.stderr.strip()})"
        )
    then = {name: _at_commit(figure.commit, name) for name in answer.stdout.splitlines()}
    now = {name: _at_present(name) for name in then}
    changed = [name for name in then if then[name] != now[name]]
    # A file that was moved is on both sides, under two names.
    gone, come = (Counter(side[name] for name in changed) for side in (then, now))
    gone, come = gone - come, come - gone
    return [name for name in changed if then[name] in gone or now[name] in come]


def _at_commit(commit: str, name: str) -> str | bytes:
    """Return what figures may follow from in a file at a commit; nothing if it was not there."""
    command = ["git", "show", f"{commit}:{name}"]
    return _essence(name, subprocess.run(command, cwd=ROOT, capture_output=True).stdout)


def _at_present(name: str) -> str | bytes:
    path = ROOT / name
    return _essence(name, path.read_bytes() if path.is_file() else b"")


def _essence(name: str, content: bytes) -> str | bytes:
    if name.endswith(".md"):
        return b""
    return essence(content.decode(), imports=False) if name.endswith(".py") else content


def main() -> None:
    """Print what is stale."""
    for figure in figures():
        changed = changes(figure)
        state = f"stale: {len(changed)} changed, such as {changed[0]}" if changed else "current"
        print(f"{figure.page}: {figure.title} ({figure.commit}): {state}")


def essence(source: str, *, imports: bool = True) -> str:
    """Return a text that is the same for two sources that differ in words and layout alone.

    Args:
        source: source of a module.
        imports: whether another import is another source.
    """
    return ast.dump(_Essence(imports).visit(ast.parse(source)))


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


if __name__ == "__main__":
    main()
