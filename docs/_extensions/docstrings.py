"""Docstrings, which are written as Markdown with Google's sections, as Sphinx reads them."""

import re
from typing import Any

from sphinx.application import Sphinx

_CODE = re.compile(r"(`[^`]*`)")
_SPECIAL = re.compile(r"([*|]|(?<=\w)_(?!\w))")
"""Characters that reStructuredText reads as emphasis, as substitutions and as links."""


def escaped(line: str) -> str:
    """Return a line with its special characters escaped, but for code between backticks."""
    parts = _CODE.split(line)
    return "".join(part if part.startswith("`") else _SPECIAL.sub(r"\\\1", part) for part in parts)


def converted(lines: list[str]) -> list[str]:
    """Return a docstring's lines with Markdown's tables as tables, and special characters escaped.

    Indented blocks at the top level are code and stay as they are, as do doctests. An example that
    is no doctest becomes code.
    """
    out: list[str] = []
    table: list[str] = []
    for number, line in enumerate([*lines, ""]):
        if line.strip() == "Example:" and not lines[number + 1].lstrip().startswith(">>>"):
            out += [f"{line}:", ""]
            continue
        if line.startswith("|"):
            table.append(line)
            continue
        if table:
            out += _table(table)
            table = []
        out.append(line if line.lstrip().startswith((">>>", "...")) else escaped(line))
    return out


def _table(rows: list[str]) -> list[str]:
    """Return a Markdown table, and what continues a cell, as a list-table."""
    cells = [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in rows]
    head, body = cells[0], cells[2:]
    merged: list[list[str]] = []
    for row in body:
        if not row[0] and merged:  # a row that continues the one above
            merged[-1] = [f"{a} {b}".strip() for a, b in zip(merged[-1], row, strict=True)]
        else:
            merged.append(row)
    out = ["", ".. list-table::", "   :header-rows: 1", ""]
    for row in [head, *merged]:
        for number, cell in enumerate(row):
            out.append(f"   {'* -' if number == 0 else '  -'} {escaped(cell)}".rstrip())
    return [*out, ""]


def _convert(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    # Else napoleon takes the words before a colon in a constant's docstring for its type.
    first = ["..", ""] if what in ("attribute", "data", "property") else []
    lines[:] = first + converted(lines)


def setup(app: Sphinx) -> dict[str, Any]:
    """Convert every docstring before napoleon reads its sections."""
    app.connect("autodoc-process-docstring", _convert, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
