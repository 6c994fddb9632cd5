"""Figures of the docs and the README that are older than what they depend on.

python benchmarks/stale_results.py

A comment `<!-- measured: COMMIT PATH PATH ... -->` stands above each figure. It is stale if a file
below one of the paths has changed since that commit. Not every such change moves a figure, and one
that lies elsewhere may: this says where to look, and no more.
"""

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

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
    """Return the files that a figure depends on and that have changed since its commit.

    Files that are changed but not committed count, too.

    Raises:
        ValueError: if the commit is not in the history.
    """
    command = ["git", "diff", "--name-only", figure.commit, "--", *figure.paths]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if answer.returncode:
        raise ValueError(
            f"{figure.page}, {figure.title}: git does not know {figure.commit}: fetch the whole "
            f"history, or measure again ({answer.stderr.strip()})"
        )
    return answer.stdout.splitlines()


def main() -> None:
    """Print what is stale."""
    for figure in figures():
        changed = changes(figure)
        told = f"stale: {len(changed)} changed, such as {changed[0]}" if changed else "current"
        print(f"{figure.page}: {figure.title} ({figure.commit}): {told}")


if __name__ == "__main__":
    main()
