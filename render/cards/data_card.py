"""The data card of a corpus or a bank: `README.md`, with the fields that Hugging Face reads.

It says what the manifests record, and nothing that they do not: licences and authors of a user's
meshes and maps are the user's to add.
"""

from collections.abc import Sequence
from pathlib import Path

from .contents import BANK, Part
from .croissant import FIELDS

WRITTEN = "<!-- written by lime-render; without this line the file is kept as it is -->"
"""Line of the cards that may be written anew."""

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (10**6, "100K<n<1M"))
_LIMITS = """\
One object of one material in each image, under distant grey light, without shadows that it casts on
itself and without reflections of itself; no transparency, no texture. Everything is rendered. A
model that has learnt from it has seen no photograph.
"""
_LAYERS = """\
Layers follow Eq. 4 of the paper: image = m_a + m_d · D + m_s · S, in linear radiance, with the
light's spherical mean at 0.4. `lime-render verify` checks every record against it.
"""
_CITATION = """\
@inproceedings{meka2018lime,
  title     = {{LIME}: Live Intrinsic Material Estimation},
  author    = {Meka, Abhimitra and Maximov, Maxim and Zollh{\\"o}fer, Michael and
               Chatterjee, Avishek and Seidel, Hans-Peter and Richardt, Christian and
               Theobalt, Christian},
  booktitle = {IEEE Conference on Computer Vision and Pattern Recognition (CVPR)},
  year      = {2018}
}
"""


def text(name: str, parts: Sequence[Part]) -> str:
    """Return the card as Markdown with a YAML head.

    Args:
        name: name of the folder.
        parts: its complete parts, at least one.
    """
    is_bank = parts[0].name == BANK
    sections = [
        _head(name, parts),
        f"# {name}\n",
        f"{WRITTEN}\n",
        _summary(is_bank),
        "## What it holds\n",
        _parts(parts),
        *([] if is_bank else ["## Records\n", _fields(), _LAYERS]),
        "## How it was made\n",
        *map(_made, parts),
        "## What it cannot teach\n",
        _LIMITS,
        "## Licence\n",
        _licence(parts),
        "## Citation\n",
        f"```bibtex\n{_CITATION}```\n",
    ]
    return "\n".join(sections)


def is_ours(path: Path) -> bool:
    """Return whether a card may be written to a path: nothing is there, or a card by `text`."""
    try:
        return WRITTEN in path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return True


def _head(name: str, parts: Sequence[Part]) -> str:
    count = sum(part.count for part in parts)
    size = next((label for limit, label in _SIZES if count < limit), "n>1M")
    licence = "mit" if all(part.is_built_in for part in parts) else "other"
    lines = [
        "---",
        f"pretty_name: {name}",
        f"license: {licence}",
        "task_categories:",
        "- image-to-image",
        "- image-segmentation",
        "tags:",
        "- material-estimation",
        "- intrinsic-images",
        "- inverse-rendering",
        "- synthetic",
        f"size_categories: [{size}]",
        "---",
    ]
    return "\n".join(lines) + "\n"


def _summary(is_bank: bool) -> str:
    if is_bank:
        return (
            "A bank of `lime-render`: G-buffers of single objects, lights and textures, from which "
            "training\nmakes scenes without end. Made for the estimation of materials from single "
            "images (LIME, CVPR 2018).\n"
        )
    return (
        "A corpus of `lime-render`: rendered images of single objects, each with its mask, diffuse "
        "and specular\nshading, mirror image, normals, light and material. Made for the estimation "
        "of materials from single\nimages (LIME, CVPR 2018).\n"
    )


def _parts(parts: Sequence[Part]) -> str:
    rows = [
        "| part | entries | pixels | shapes | lights | files |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for part in parts:
        lights = "" if part.lights is None else part.lights
        size = part.description["size"]
        rows.append(
            f"| {part.name} | {part.count} | {size} × {size} | {len(part.shapes)} | {lights} "
            f"| {len(part.files)} |"
        )
    return "\n".join(rows) + "\n"


def _fields() -> str:
    rows = [f"| `{name}` | {content} |" for name, (_, content) in FIELDS.items()]
    return "\n".join(["| feature | content |", "|---|---|", *rows]) + "\n"


def _made(part: Part) -> str:
    """Return the list of everything that the bytes of a part depend on."""
    rows = [f"`{part.name}`:\n"]
    rows += [
        f"- {key.replace('_', ' ')}: {'built in' if value is None else value}"
        for key, value in part.description.items()
    ]
    for kind, files in part.inputs.items():
        if files:
            rows.append(f"- files of {kind}: {', '.join(sorted(files))}")
    rows.append(f"- packages: {', '.join(f'{k} {v}' for k, v in sorted(part.packages.items()))}")
    return "\n".join(rows) + "\n"


def _licence(parts: Sequence[Part]) -> str:
    if all(part.is_built_in for part in parts):
        return "Shapes, rooms and textures are built into lime-keras; MIT licence, as lime-keras.\n"
    return (
        "The licences of the meshes, maps and pictures named above decide. Name their authors and "
        "licences here\nbefore you share this folder.\n"
    )
