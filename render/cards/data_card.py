"""The data card of a corpus: `README.md`, with the fields that Hugging Face reads.

It says what the manifests record, and nothing that they do not: licences and authors of a user's
meshes and maps are the user's to add.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from string import Template

from lime_keras.data.corpus import Split

from .croissant import FIELDS, is_built_in

_CARD = Path(__file__).with_name("data_card.md")
WRITTEN = "<!-- written by lime-render; without this line the file is kept as it is -->"
"""Line of the cards that may be written anew."""

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (10**6, "100K<n<1M"))
_BUILT_IN = "Shapes, rooms and textures are built into lime-keras; MIT licence, as lime-keras.\n"
_OTHERS = (
    "The licences of the meshes, maps and pictures named above decide. Name their authors and "
    "licences here\nbefore you share this folder.\n"
)


def text(name: str, parts: Sequence[Split]) -> str:
    """Return the card of a folder's complete splits, at least one: Markdown with a YAML head."""
    built_in = all(map(is_built_in, parts))
    count = sum(part.count for part in parts)
    return Template(_CARD.read_text(encoding="utf-8")).substitute(
        name=name,
        quoted=json.dumps(name, ensure_ascii=False),
        written=WRITTEN,
        licence="mit" if built_in else "other",
        size=next((label for limit, label in _SIZES if count < limit), "n>1M"),
        parts="\n".join(map(_row, parts)),
        fields="\n".join(f"| `{one}` | {content} |" for one, (_, content) in FIELDS.items()),
        made="\n".join(map(_made, parts)),
        terms=_BUILT_IN if built_in else _OTHERS,
    )


def is_ours(path: Path) -> bool:
    """Return whether a card may be written to a path: nothing is there, or a card by `text`."""
    try:
        return WRITTEN in path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return True


def _row(part: Split) -> str:
    return (
        f"| {part.name} | {part.count} | {part.size} × {part.size} | {len(part.shapes)} "
        f"| {len(part.lights)} | {len(part.sha256)} |"
    )


def _made(part: Split) -> str:
    """Return the list of everything that the bytes of a part depend on."""
    rows = [f"`{part.name}`:\n"]
    rows += [
        f"- {key.replace('_', ' ')}: {'built in' if value is None else value}"
        for key, value in part.manifest["description"].items()
    ]
    for kind, files in part.inputs.items():
        if files:
            rows.append(f"- files of {kind}: {', '.join(sorted(files))}")
    packages = sorted(part.manifest["packages"].items())
    rows.append(f"- packages: {', '.join(f'{name} {version}' for name, version in packages)}")
    return "\n".join(rows) + "\n"
