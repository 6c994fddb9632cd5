"""The picture of docs/start/photo.md: a photo, and what the shipped weights see in it."""

from pathlib import Path

import numpy as np
from PIL import Image

from lime_keras import Estimator, photo
from lime_keras.estimate import preview


def main(path: Path, out: Path) -> None:
    """Write first-material.webp into a folder, from a photo, and print the numbers."""
    image = photo.read_srgb(path)
    material = Estimator().estimate(image)
    page = Image.fromarray(np.round(255 * preview.sheet(image, material)).astype(np.uint8))
    page.save(out / "first-material.webp", quality=88)
    for name in ("diffuse_albedo", "specular_albedo", "exponent"):
        print(name, np.round(getattr(material, name), 2))
