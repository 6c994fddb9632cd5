"""The picture of README.md: photographs, the answers of the weights, and the material elsewhere."""

import json
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont

from lime_keras.estimate import preview
from lime_keras.estimate.framing import Square
from lime_keras.render.commands import clone
from lime_keras.render.shapes import lathe

VASE = 8
"""Seed of the built-in shape that takes the materials."""
TILE, GAP, LINE = 240, 8, 26
SHOWN = {0: "photo, mask", 4: "highlights S", 1: "the material"}
"""Titles of the preview's pictures that are shown, by their place in it."""


def main(photos: list[Path], mesh: Path | None, out: Path) -> None:
    """Write photographs.webp into a folder, a row for each photo.

    Args:
        photos: photographs of one object each.
        mesh: shape that takes their materials, or None for a built-in vase.
        out: folder of the picture.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shape = mesh or _vase(folder / "vase.ply")
        options = ["--clone-onto", str(shape), "--shadow", "--out", str(folder / "materials")]
        if status := clone.main([*map(str, photos), *options]):
            raise SystemExit(status)
        _page(folder / "materials", [photo.stem for photo in photos]).save(
            out / "photographs.webp", quality=86
        )


def _vase(path: Path) -> Path:
    shape = lathe.sample(np.random.default_rng(VASE))
    trimesh.Trimesh(shape.vertices, shape.faces, process=False).export(path)
    return path


def _page(folder: Path, names: list[str]) -> Image.Image:
    titles = [*SHOWN.values(), "on another shape"]
    width = len(titles) * (TILE + GAP) - GAP
    page = Image.new("RGB", (width, LINE + len(names) * (TILE + GAP + LINE)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(15)
    for column, title in enumerate(titles):
        pen.text((column * (TILE + GAP), 2), title, fill=(60, 60, 60), font=font)
    for row, name in enumerate(names):
        top = LINE + row * (TILE + GAP + LINE)
        for column, tile in enumerate(_tiles(folder, name)):
            page.paste(
                tile.resize((TILE, TILE), Image.Resampling.LANCZOS), (column * (TILE + GAP), top)
            )
        pen.text((0, top + TILE + 4), _numbers(folder, name), fill=(60, 60, 60), font=font)
    return page


def _tiles(folder: Path, name: str) -> list[Image.Image]:
    content = json.loads((folder / f"{name}.json").read_text())
    with Image.open(folder / f"{name}-preview.png") as sheet:
        corners = map(preview.place, SHOWN)
        pictures = [sheet.crop((x, y, x + preview.TILE, y + preview.TILE)) for x, y in corners]
    square = Square(*content["square"])
    box = (square.left, square.top, square.left + square.side, square.top + square.side)
    with Image.open(folder / f"{name}-clone.png") as clone:
        return [*pictures, clone.convert("RGB").crop(box)]


def _numbers(folder: Path, name: str) -> str:
    content = json.loads((folder / f"{name}.json").read_text())
    red, green, blue = content["diffuse_albedo"]
    return (
        f"{content['gloss']}    m_d {red:.2f} {green:.2f} {blue:.2f}    "
        f"m_s {content['specular_albedo']:.2f}    s {content['exponent']:.0f}"
    )
