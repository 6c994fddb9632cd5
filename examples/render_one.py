"""One example of a corpus, rendered by this script: its image and its layers as pictures.

python render_one.py pictures 12

This needs lime-keras alone, no corpus and no GPU: shapes, rooms and backgrounds are built in. With
libLLVM it is fast (`python -m lime_keras.render.mitsuba_setup.fetch_llvm`). The room that lights
the example is rendered first and kept in pictures/rooms. Do not import TensorFlow before this
package: Mitsuba must be imported first.
"""

import sys
from pathlib import Path

import numpy as np

from lime_keras.io import photo
from lime_keras.optics import colour
from lime_keras.render.corpus.random_example import Sources, render_example
from lime_keras.render.mitsuba_setup import variants

out, index = Path(sys.argv[1]), int(sys.argv[2])
variants.activate(variants.choose(), threads=1)
features = render_example(index, Sources("train", seed=0, rooms=out / "rooms")).features
pictures = {name: features[name] for name in ("image", "mask")}
for name in ("diffuse_shading", "specular_shading", "mirror", "environment"):
    pictures[name] = colour.linear_to_srgb(np.clip(features[name], 0, 1))
pictures["normal"] = (features["normal"] + 1) / 2
for name, picture in pictures.items():
    photo.write(out / f"{name}.png", picture)
for name in ("shape", "light", "diffuse_albedo", "specular_albedo", "shininess", "ambient"):
    print(f"{name}: {features[name]}")
