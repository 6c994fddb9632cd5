"""The figures of README and of docs/results.md, written from docs/results/*.json: `make readme`.

A repository shows the source of its pages, so the figures stand there, between marks:

    <!-- table: glance -->      docs/tables/glance.txt, with `{file; column; row; format}` filled in
    <!-- end -->

    <!-- figure: photographs; best, own mask; order_exponent; .0% -->96 %<!-- end -->

A figure is named by its file, its column and its row, and formatted as Python does; `±` or `[]`
after the format adds its interval (`record.Figure`), and the format `n` stands for the number of
examples. `–` after the format allows that the file lacks the figure. A test says when a page is
stale.
"""

import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "benchmarks"))

import record  # noqa: E402

PAGES = (ROOT / "README.md", ROOT / "docs" / "results.md")
_BLOCK = re.compile(r"(<!-- table: (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
_FIGURE = re.compile(r"(<!-- figure: (.+?) -->)(.*?)(<!-- end -->)")
_CELL = re.compile(r"\{(.+?)\}")


@cache
def _figures(name: str) -> dict[str, dict[str, Any]]:
    return record.read(record.FOLDER / f"{name}.json")["figures"]


def figure(place: str) -> str:
    """Return the text of a figure `file; column; row; format`.

    Raises:
        KeyError: if the file has none, and the format does not end with a dash.
    """
    name, column, row, form = (part.strip() for part in place.split(";"))
    if form.endswith("–") and row not in _figures(name)[column]:
        return "–"
    found, form = _figures(name)[column][row], form.removesuffix("–")
    return str(found.count) if form == "n" else format(found, form)


def written_anew(page: str) -> str:
    """Return a page with the figures that the files have now."""

    def table(match: re.Match[str]) -> str:
        template = (ROOT / "docs" / "tables" / f"{match[2]}.txt").read_text(encoding="utf-8")
        text = _CELL.sub(lambda cell: figure(cell[1]), template)
        # Without an empty line before it, the mark would be a row.
        return f"{match[1]}{text}\n{match[4]}"

    page = _BLOCK.sub(table, page)
    return _FIGURE.sub(lambda match: f"{match[1]}{figure(match[2])}{match[4]}", page)


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(written_anew(path.read_text(encoding="utf-8")), encoding="utf-8")
