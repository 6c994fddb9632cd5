"""The material of a photo with ONNX Runtime alone, in any precision of `lime-export`.

pip install onnxruntime pillow
python onnx_python.py exported/lime.onnx photo.jpg

The photo shows one object near its middle.
"""

import json
import os
import sys

import numpy as np
from PIL import Image, ImageOps

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # read while the library is loaded
import onnxruntime

model = onnxruntime.InferenceSession(sys.argv[1])
about = model.get_modelmeta().custom_metadata_map
_, height, width, _ = json.loads(about["input_shape"])
photo = ImageOps.exif_transpose(Image.open(sys.argv[2])).convert("RGB")
image = np.asarray(ImageOps.fit(photo, (width, height)), np.float32) / 255  # sRGB in [0, 1]
names = [output.name for output in model.get_outputs()]
found = dict(zip(names, model.run(names, {"image": image[None]}), strict=True))
means = np.log10(json.loads(about["exponent_bin_means"]))
print(
    json.dumps(
        {
            "diffuse_albedo": found["diffuse_albedo"][0].tolist(),
            "specular_albedo": float(found["specular_albedo"][0, 0]),
            "exponent": float(10 ** (found["exponent_bin_probabilities"][0] @ means)),
            "mask_coverage": float(found["mask"].mean()),
        }
    )
)
