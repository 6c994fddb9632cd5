"""The picture of the one road, for docs/explanation/scene-model.md: from a mesh to a batch.

One example is rendered as in a train split of built-in shapes under mixed lights, and one photo is
made of its record as training makes it. Needs the extras `render` and `train`.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scene_model import displayed

from lime_keras.optics import colour
from lime_keras.render.corpus.random_example import Example, Sources, render_example
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene.sources import MIXED

SEED, INDEX, TILE, GAP, HEAD = 5, 5, 150, 34, 44


def example() -> Example:
    """Render the example."""
    variants.activate(variants.choose(), threads=1)
    with tempfile.TemporaryDirectory() as rooms:
        sources = Sources("train", SEED, Path(rooms), law=MIXED, endless=0.5)
        return render_example(INDEX, sources, shard_size=16)


def photo(record: bytes) -> dict[str, np.ndarray]:
    """Make a photo of a record: new albedos, prints, a camera, and a mask that is not true."""
    import tensorflow as tf

    from lime_keras.data import camera
    from lime_keras.train.photos import masks, paint, radiance

    seed = tf.constant([SEED, INDEX], tf.int64)
    scene: dict[str, Any] = radiance.scene(tf.constant(record), seed, camera.SCENE, ("natural",))
    names = ("object", "mask", "diffuse_shading", "diffuse_albedo")
    held = {name: scene[name].numpy() for name in names}
    draws = (np.random.default_rng((SEED, number)) for number in range(1000))
    light, _ = next(found for rng in draws if (found := paint.prints(held, rng))[1].any())
    painted = light + scene["background"].numpy()
    taken = camera.photograph(scene, tf.constant(painted), seed)["image"].numpy()
    mask = masks.damaged(held["mask"], np.random.default_rng(SEED))
    return {"painted": painted, "photo": taken, "mask": mask}


def drawn(rows: list[list[tuple[str, np.ndarray]]], joints: list[list[str]]) -> Image.Image:
    """Return rows of titled pictures, sRGB in [0, 1], with what leads from each to the next."""
    width = max(len(row) for row in rows) * (TILE + GAP) - GAP
    page = Image.new("RGB", (width, len(rows) * (TILE + HEAD)), "white")
    draw, font, sign = ImageDraw.Draw(page), ImageFont.load_default(13), ImageFont.load_default(22)
    arrow = np.array([(-11, -1), (3, -1), (3, -6), (11, 0), (3, 6), (3, 1), (-11, 1)])
    for number, (row, between) in enumerate(zip(rows, joints, strict=True)):
        top = number * (TILE + HEAD) + HEAD
        for place, (title, picture) in enumerate(row):
            left = place * (TILE + GAP)
            tile = Image.fromarray(np.round(255 * picture).astype(np.uint8))
            page.paste(tile.resize((TILE, TILE), Image.Resampling.LANCZOS), (left, top))
            draw.text((left + TILE / 2, top - HEAD / 2), title, "black", font, "mm", align="center")
            if place < len(between):
                middle = np.array([left + TILE + GAP / 2, top + TILE / 2])
                if between[place] == "→":  # the font has no arrow
                    draw.polygon([tuple(corner) for corner in middle + arrow], "black")
                else:
                    draw.text(tuple(middle), between[place], "black", sign, "mm")
    return page


def main(out: Path) -> None:
    """Write road.webp into a folder."""
    rendered = example()
    features, made = rendered.features, photo(rendered.record)
    light = features["environment"]
    square = np.repeat(light[:, :, 0], 2, axis=0)[..., None]
    swatch = np.ones((64, 64, 1)) * colour.linear_to_srgb(features["diffuse_albedo"])
    material = (
        f"material\nm_d, m_s {features['specular_albedo']:.2f}, s {features['shininess']:.0f}"
    )
    rows = [
        [
            ("mesh\n(its normals)", (features["normal"] + 1) / 2),
            ("light, mixed of maps\nand lamps", displayed(square / (1 + square))),
            (material, swatch),
            ("D", displayed(features["diffuse_shading"])),
            ("S", displayed(features["specular_shading"])),
            ("M", displayed(features["mirror"])),
        ],
        [
            ("picture of the record\n(Eq. 4, background)", features["image"]),
            ("radiance, new albedos,\npainted", displayed(made["painted"])),
            ("photo: defocus, noise,\nclipping, JPEG", made["photo"]),
            ("mask, as it is found\nor damaged", displayed(made["mask"])),
            ("what a network reads", made["photo"] * made["mask"]),
        ],
    ]
    joints = [["+", "+", "→", "", ""], ["→", "→", "+", "→"]]
    drawn(rows, joints).save(out / "road.webp", quality=88)
