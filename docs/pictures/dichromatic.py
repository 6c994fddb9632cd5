"""The picture of docs/explanation/dichromatic.md: the channels of the split, of renders and photos.

The example of docs/explanation/scene-model.md is composed anew by Eq. 4 in two materials, one of
them nearly grey. The photos stand in `examples/`. Needs the extras `render` and `train`.
"""

from pathlib import Path

import numpy as np
import scene_model
from PIL import Image, ImageDraw, ImageFont

from lime_keras.estimate import framing
from lime_keras.io import photo
from lime_keras.optics import colour, compositing, dichromatic

SIZE, TILE, GAP, LINE = 128, 176, 8, 26
MATERIALS = {"a red paint": (0.55, 0.12, 0.08), "a pale one": (0.50, 0.47, 0.43)}
"""Name and m_d of each render."""
SPECULAR, AMBIENT = 0.25, 0.02
PHOTOS = "hat", "fox"
TITLES = (
    "image, cut out",
    "grey light, root",
    "saturation, relative",
    "largest saturation",
    "clipped",
)

Shown = tuple[np.ndarray, np.ndarray]
"""Image `(SIZE, SIZE, 3)`, sRGB, and mask `(SIZE, SIZE, 1)`, each in [0, 1]."""


def main(examples: Path, out: Path) -> None:
    """Write dichromatic.webp into a folder.

    Args:
        examples: folder with `photos/` and `masks/`.
        out: folder of the picture.
    """
    rows = {**_renders(), **{f"photo: {name}": _photo(examples, name) for name in PHOTOS}}
    _page(rows).save(out / "dichromatic.webp", quality=86)


def _renders() -> dict[str, Shown]:
    scene = scene_model.example()
    square = framing.Square(0, 0, len(scene["mask"]))
    mask = framing.cut_layer(scene["mask"], square, SIZE)
    layers = scene["diffuse_shading"][None], scene["specular_shading"][None]
    out = {}
    for name, albedo in MATERIALS.items():
        linear = compositing.compose(
            np.array([albedo]), np.array([SPECULAR]), np.array([AMBIENT]), *layers
        )[0]
        image = colour.linear_to_srgb(np.clip(linear * scene["mask"], 0, 1))
        levels = np.round(255 * framing.cut(image, square, SIZE)) / 255
        out[f"render: {name}"] = levels, mask
    return out


def _photo(examples: Path, name: str) -> Shown:
    image = photo.read_srgb(examples / "photos" / f"{name}.png")
    path = examples / "masks" / f"{name}.png"
    if path.exists():
        mask = photo.read_mask(path, *image.shape[:2])
    else:
        # The object was cut out on black.
        mask = (image.max(axis=-1, keepdims=True) > 0).astype(np.float32)
    square = framing.around_mask(mask)
    return framing.cut(image, square, SIZE), framing.cut_layer(mask, square, SIZE)


def _page(rows: dict[str, Shown]) -> Image.Image:
    width = len(TITLES) * (TILE + GAP) - GAP
    page = Image.new("RGB", (width, LINE + len(rows) * (TILE + GAP + LINE)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(15)
    for column, title in enumerate(TITLES):
        pen.text((column * (TILE + GAP), 2), title, fill=(60, 60, 60), font=font)
    for row, (name, (image, mask)) in enumerate(rows.items()):
        top = LINE + row * (TILE + GAP + LINE)
        seen = dichromatic.channels(image[None], mask[None])[0]
        tiles = [image * mask, *np.split(seen, dichromatic.CHANNELS, axis=-1)]
        for column, tile in enumerate(tiles):
            levels = np.round(255 * np.clip(np.broadcast_to(tile, (SIZE, SIZE, 3)), 0, 1))
            picture = Image.fromarray(levels.astype(np.uint8))
            page.paste(
                picture.resize((TILE, TILE), Image.Resampling.LANCZOS), (column * (TILE + GAP), top)
            )
        parts = dichromatic.split(image[None], mask[None])
        numbers = (
            f"{name}    largest saturation {parts.saturation.item():.2f}    "
            f"trusted {parts.trusted.item():.0f}"
        )
        pen.text((0, top + TILE + 4), numbers, fill=(60, 60, 60), font=font)
    return page
