"""The gallery of a folder of results: a page to look at them, and a table of their numbers.

The page, `index.html`, shows the previews beside it and needs no network. Both show all results in
the folder, of whatever run.
"""

import colorsys
import csv
import html
import io
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import quote

from lime_keras.estimate import preview
from lime_keras.io import atomic, result_json, untrusted
from lime_keras.material import srgb_hex
from lime_keras.optics import gloss

PAGE, TABLE = "index.html", "materials.csv"
COLUMNS = (
    *("json", "source", "scene", "diffuse_r", "diffuse_g", "diffuse_b", "colour"),
    *("specular_albedo", "exponent", "exponent_entropy"),
    *("mask_coverage", "mask_confidence", "warnings"),
    *("exponent_low", "exponent_high", "gloss", "roughness", "glossy_probability"),
)
"""Columns of the table. Albedos are linear; `colour` is the diffuse one, sRGB, as #rrggbb."""
_MARK = '<meta name="generator" content="lime-estimate">'
_TEMPLATE = Path(__file__).with_name("gallery.html")
_MOST_ENTROPY = 3.0  # entropy in bits of eight classes that are equally likely
_VIEWED = {
    "-preview.png": "preview",
    ".gltf": "glTF",
    ".mtl": "MTL",
    "-mitsuba.json": "Mitsuba",
    "-overlay.mp4": "overlay",
    "-clone.png": "clone",
}
"""Files that the page links to, by the end of the name."""


def check(out: Path) -> None:
    """Check that page and table of a folder may be written: others are never replaced.

    Raises:
        ValueError: if a file of that name, or a folder, is there that is no gallery.
    """
    marks: dict[str, Callable[[str], bool]] = {
        PAGE: lambda text: _MARK in text,
        TABLE: lambda text: text.startswith(f"{COLUMNS[0]},"),
    }
    for path in filter(os.path.lexists, (out / name for name in marks)):
        untrusted.check(path, "a gallery")
        if not marks[path.name](path.read_text(encoding="utf-8", errors="replace")):
            raise ValueError(
                f"{path} is there, and not of lime-estimate: pass another folder to --out"
            )


def update(out: Path, contents: Mapping[str, Mapping[str, Any]]) -> None:
    """Write page and table of a folder, of the results that they have and of new ones.

    Results that are no longer there are left out.

    Raises:
        ValueError: if the table, or a result that it lists, holds what no such file holds.
        OSError: if a file cannot be written.
    """
    rows, cards = [], []
    new = {f"{name}.json": content for name, content in contents.items()}
    for path in sorted({*_listed(out / TABLE), *new}):
        content = new.get(path) or result_json.read(out / path)
        if content is None or content.get("made", {}).get("unfinished"):
            continue
        with untrusted.naming(out / path, "a result"):
            scenes = content.get("scenes") or [content]
            own = [_row(path, content, scene) for scene in scenes]
            cards += [_card(*one, content) for one in zip(own, scenes, strict=True)]
            # JSON may hold halves of characters, which no text does.
            "".join(str(cell) for row in own for cell in row.values()).encode()
            rows += own
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    atomic.write(out / TABLE, text.getvalue())
    page = Template(_TEMPLATE.read_text(encoding="utf-8"))
    filled = page.substitute(mark=_MARK, count=len(rows), cards="\n".join(cards), table=TABLE)
    atomic.write(out / PAGE, filled)


def _listed(table: Path) -> list[str]:
    """Return the results that a table lists, as paths relative to its folder."""
    if not table.exists():
        return []
    untrusted.check(table, "a table")
    with untrusted.naming(table, "a table"), table.open(encoding="utf-8", newline="") as file:
        return [row["json"] for row in csv.DictReader(file) if row.get("json")]


def _row(path: str, content: Mapping[str, Any], scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a photo's result, or of a scene of a video's."""
    diffuse = scene.get("diffuse_albedo")
    row = {name: scene.get(name) for name in COLUMNS}
    row |= {"json": path, "source": content.get("photo", content.get("video")), "colour": None}
    row["warnings"] = " ".join(warning["code"] for warning in scene.get("warnings", ()))
    if diffuse is not None:
        row |= dict(zip(("diffuse_r", "diffuse_g", "diffuse_b"), diffuse, strict=True))
        row["colour"] = srgb_hex(diffuse)
    low, high = scene.get("exponent_interval", (None, None))
    return row | {"exponent_low": low, "exponent_high": high}


def _card(row: dict[str, Any], scene: Mapping[str, Any], content: Mapping[str, Any]) -> str:
    """Return the HTML of a row, with the keys to sort it by."""
    folder, stem = Path(row["json"]).parent, Path(row["json"]).stem
    title = (folder / stem).as_posix() if folder.name != stem else folder.as_posix()
    start = stem
    if len(content.get("scenes", ())) > 1:
        title += f", scene {row['scene']}"
        start += f"-scene-{row['scene']}"
    # An overlay shows all scenes.
    named = [(label, name + end) for name in (stem, start) for end, label in _VIEWED.items()]
    shown = {label: file for label, file in named if file in content["files"]}
    keys = {"name": title.casefold()} | _keys(row)
    data = " ".join(f'data-{name}="{html.escape(str(key))}"' for name, key in keys.items())
    links = [
        f'<a href="{_link(folder / file)}">{label}</a>'
        for label, file in ({"numbers": Path(row["json"]).name} | shown).items()
    ]
    picture = ""
    if "preview" in shown:
        address = _link(folder / shown["preview"])
        image = f'<img loading="lazy" src="{address}" alt="preview">'
        picture = f'<a class="picture" href="{address}">{image}</a>'
    caption = preview.caption(scene)
    if row["warnings"]:
        caption.append(f"⚠ {row['warnings'].replace(' ', ', ')}")
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in caption)
    swatch = f'<i style="background:{row["colour"]}"></i>' if row["colour"] else ""
    return (
        f"<article {data}>{picture}"
        f'<h2 title="{html.escape(str(row["source"]))}">{swatch}{html.escape(title)}</h2>'
        f"<ul>{lines}</ul><p>{' · '.join(links)}</p></article>"
    )


def _keys(row: dict[str, Any]) -> dict[str, float | str]:
    """Return the values to sort by; what is not known is empty, and comes last."""
    keys: dict[str, float | str] = dict.fromkeys(("gloss", "colour", "confidence", "mask"), "")
    if row["exponent"] is not None:
        keys["gloss"] = gloss.level(row["exponent"], row["specular_albedo"])
    if row["diffuse_r"] is not None:
        levels = bytes.fromhex(row["colour"].removeprefix("#"))
        hue, saturation, value = colorsys.rgb_to_hsv(*(level / 255 for level in levels))
        # Greys, whose hue means nothing, come first, from dark to light.
        keys["colour"] = round(value - 1 if saturation < 0.1 else hue, 4)
    if row["exponent_entropy"] is not None:
        keys["confidence"] = round(1 - row["exponent_entropy"] / _MOST_ENTROPY, 4)
    if row["mask_confidence"] is not None:
        keys["mask"] = row["mask_confidence"]
    return keys


def _link(path: Path) -> str:
    """Return the address of a file relative to the page."""
    return html.escape(quote(path.as_posix()))
