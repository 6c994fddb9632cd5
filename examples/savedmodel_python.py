"""The material of a photo with TensorFlow alone.

pip install tensorflow pillow
python savedmodel_python.py exported/saved_model/1 photo.jpg

The photo shows one object near its middle.
"""

import json
import sys
from pathlib import Path

import numpy as np
import tensorflow as tf
from PIL import Image, ImageOps

about = json.loads((Path(sys.argv[1]) / "assets.extra/lime.json").read_text(encoding="utf-8"))
model = tf.saved_model.load(sys.argv[1])
_, height, width, _ = about["input_shape"]
photo = ImageOps.exif_transpose(Image.open(sys.argv[2])).convert("RGB")
image = np.asarray(ImageOps.fit(photo, (width, height)), np.float32) / 255  # sRGB in [0, 1]
photos = tf.constant(image[None])
found = {name: x.numpy() for name, x in model.signatures["serving_default"](image=photos).items()}
# The signature of a single output computes only what that output needs.
mask = model.signatures["mask"](image=photos)["mask"].numpy()
means = np.log10(about["exponent_bin_means"])
print(
    json.dumps(
        {
            "diffuse_albedo": found["diffuse_albedo"][0].tolist(),
            "specular_albedo": float(found["specular_albedo"][0, 0]),
            "exponent": float(10 ** (found["exponent_bin_probabilities"][0] @ means)),
            "mask_coverage": float(mask.mean()),
        }
    )
)
