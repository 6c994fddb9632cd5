"""The picture of README.md: photographs, what the weights see in them, and the material elsewhere.

lime-estimate PHOTOS --clone-onto teapot.ply --shadow --out materials
python docs/pictures/photographs.py materials NAME...

Each NAME is that of a photo in `materials`. The photographs themselves do not come with the project;
docs/pictures/README.md says whose they are.
"""

import json
import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from lime_keras.estimate import preview
from lime_keras.estimate.framing import Square

HERE = Path(__file__).parent
TILE, GAP, LINE = 200, 8, 26
SHOWN = {0: "photo, mask", 3: "specular shading S", 4: "mirror image M", 5: "the material"}
"""Titles of the preview's pictures that are shown, by their place in it."""


def main(folder: Path, names: list[str]) -> None:
    """Write photographs.webp beside this file, a row for each name."""
    titles = [*SHOWN.values(), "on another shape"]
    width = len(titles) * (TILE + GAP) - GAP
    page = Image.new("RGB", (width, LINE + len(names) * (TILE + GAP + LINE)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(15)
    for column, title in enumerate(titles):
        pen.text((column * (TILE + GAP), 2), title, fill=(60, 60, 60), font=font)
    for row, name in enumerate(names):
        top = LINE + row * (TILE + GAP + LINE)
        for column, tile in enumerate(_tiles(folder, name)):
            page.paste(tile.resize((TILE, TILE), Image.Resampling.LANCZOS), (column * (TILE + GAP), top))
        pen.text((0, top + TILE + 4), _numbers(folder, name), fill=(60, 60, 60), font=font)
    page.save(HERE / "photographs.webp", quality=86)


def _tiles(folder: Path, name: str) -> list[Image.Image]:
    content = json.loads((folder / f"{name}.json").read_text())
    with Image.open(folder / f"{name}-preview.png") as sheet:
        pictures = preview.pictures_of(sheet.convert("RGB"))
    square = Square(*content["square"])
    box = (square.left, square.top, square.left + square.side, square.top + square.side)
    with Image.open(folder / f"{name}-clone.png") as clone:
        return [*(pictures[place] for place in SHOWN), clone.convert("RGB").crop(box)]


def _numbers(folder: Path, name: str) -> str:
    content = json.loads((folder / f"{name}.json").read_text())
    red, green, blue = content["diffuse_albedo"]
    return (
        f"m_d {red:.2f} {green:.2f} {blue:.2f}    m_s {content['specular_albedo']:.2f}    "
        f"s {content['exponent']:.0f}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
