"""The picture of docs/start/photo.md: a rendered photo, and what the shipped weights see in it.

python docs/pictures/first_material.py

Run it again after a change of the weights. Needs the extras `render` and `train`.
"""

import numpy as np
from PIL import Image
from scene_model import HERE, example

from lime_keras import Estimator
from lime_keras.estimate import preview


def main() -> None:
    """Write first-material.webp beside this file, and print what is true and what is estimated."""
    features = example()
    photo = np.asarray(features["image"], np.float32)
    material = Estimator().estimate(photo)
    page = Image.fromarray(np.round(255 * preview.sheet(photo, material)).astype(np.uint8))
    page.save(HERE / "first-material.webp", quality=88)
    for name, true in (
        ("diffuse_albedo", features["diffuse_albedo"]),
        ("specular_albedo", features["specular_albedo"]),
        ("exponent", features["shininess"]),
    ):
        print(name, "true", np.round(true, 2), "estimated", np.round(getattr(material, name), 2))


if __name__ == "__main__":
    main()
