"""Write `train/recipes/data.csv`, the list of meshes and maps, from a folder and its manifest.

    python docs/data_list.py DATA

`DATA/MANIFEST.md` has a line for each file: its place, its licence, authors, and where it is from.
"""

import csv
import re
import sys
from pathlib import Path

from lime_keras.io import atomic, untrusted
from lime_keras.train.recipes.data import LIST, SUFFIXES

_KINDS_OF_THINGS = re.compile(
    r"(household|furniture|machine|vehicle|toy|plant|kitchenware|animal|fruit_food|outdoor|tool|"
    r"urban|sunset|street|night|lamp|indoor|forest|overcast|bottle|statue|jewellery|glasses|"
    r"studio|snow|instrument|clothing|shape)(, thin|, low range)?"
)
"""Words of the manifest that tell what a file shows."""
_OUTSIDE_BRACKETS = re.compile(r"; (?![^()]*\))")
_ORIGIN = re.compile(r"(?:^|half )from (\S+) (.+)")


def rows(data: Path) -> list[dict[str, str]]:
    """Return a row for each mesh and map of the manifest."""
    out = []
    for line in (data / "MANIFEST.md").read_text(encoding="utf-8").splitlines():
        name, _, said = line.removeprefix("- ").partition(": ")
        if line.startswith("- ") and name.split("/")[0] in SUFFIXES:
            parts = _OUTSIDE_BRACKETS.split(said)
            origin = next(k for k, part in enumerate(parts) if _ORIGIN.search(part))
            repository, place = _ORIGIN.search(parts[origin]).groups()
            authors = [part for part in parts[1:origin] if not _KINDS_OF_THINGS.fullmatch(part)]
            out.append(
                {
                    "file": name,
                    "sha256": untrusted.sha256(data / name),
                    "licence": parts[0],
                    "authors": "; ".join(authors),
                    "repository": repository,
                    "place": place,
                }
            )
    return sorted(out, key=lambda row: row["file"])


def main() -> int:
    """Write the list."""
    listed = rows(Path(sys.argv[1]))
    with atomic.replacing(LIST) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(listed[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(listed)
    return 0


if __name__ == "__main__":
    sys.exit(main())
