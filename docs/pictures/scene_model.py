"""Pictures for docs/explanation/scene-model.md: the layers of Eq. 4, and S for three exponents.

One example of the built-in shapes and rooms is rendered. S for other exponents is a direct sum over
the light of its record (`lime_keras.optics.shading`). Needs the extras `render` and `train`.
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lime_keras.optics import colour, shading
from lime_keras.render.corpus.random_example import Sources, render_example
from lime_keras.render.mitsuba_setup import variants

SEED, INDEX, TILE = 0, 33, 192
EXPONENTS = 5, 50, 500


def example() -> dict[str, np.ndarray]:
    """Render the example, features as in a record."""
    variants.activate(variants.choose(), threads=1)
    with tempfile.TemporaryDirectory() as rooms:
        return render_example(INDEX, Sources("train", SEED, Path(rooms))).features


def specular(features: dict[str, np.ndarray], exponent: float) -> np.ndarray:
    """Return S `(H, W, 1)`, linear radiance, of the example's shape and light for an exponent."""
    inside = features["mask"][..., 0] > 0
    height, width = inside.shape
    normal = features["normal"][inside].astype(np.float64)
    view = shading.view_directions(features["camera"], height, width)[inside]
    lights = shading.texels(features["environment"][..., 0].astype(np.float64))
    out = np.zeros((height, width, 1))
    out[inside, 0] = shading.specular(normal, view, exponent, *lights)
    return out * features["mask"]


def displayed(linear: np.ndarray) -> np.ndarray:
    """Return linear radiance as sRGB, clipped at 1, in three channels."""
    srgb = colour.linear_to_srgb(np.clip(linear, 0, 1))
    return np.broadcast_to(srgb, (*srgb.shape[:2], 3))


def sheet(tiles: dict[str, np.ndarray]) -> Image.Image:
    """Return pictures sRGB in [0, 1] beside one another, each below its title."""
    head = 24
    page = Image.new("RGB", (TILE * len(tiles), TILE + head), "white")
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(15)
    for number, (title, picture) in enumerate(tiles.items()):
        tile = Image.fromarray(np.round(255 * picture).astype(np.uint8))
        page.paste(tile.resize((TILE, TILE), Image.Resampling.LANCZOS), (TILE * number, head))
        draw.text((TILE * (number + 0.5), head / 2), title, "black", font, anchor="mm")
    return page


def main(out: Path) -> None:
    """Write layers.webp and exponents.webp into a folder."""
    features = example()
    light = features["environment"][..., 0]
    diffuse = features["diffuse_albedo"] * features["diffuse_shading"]
    gloss = features["specular_albedo"] * features["specular_shading"]
    layers = {
        "I": features["image"],
        "D": displayed(features["diffuse_shading"]),
        "S": displayed(features["specular_shading"]),
        "m_d D": displayed(diffuse),
        "m_s S": displayed(gloss),
    }
    exponents = {f"S, s = {s}": displayed(specular(features, s)) for s in EXPONENTS}
    exponents |= {"M": displayed(features["mirror"]), "n": (features["normal"] + 1) / 2}
    sheet(layers).save(out / "layers.webp", quality=88)
    sheet(exponents).save(out / "exponents.webp", quality=88)
    numbers = {
        "m_d": features["diffuse_albedo"],
        "m_s": features["specular_albedo"],
        "s": features["shininess"],
        "mean of the light": light.mean(),
    }
    print(*(f"{name}: {np.round(value, 3)}" for name, value in numbers.items()), sep="\n")
