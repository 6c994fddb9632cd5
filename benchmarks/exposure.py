"""The share of object pixels that a camera would clip, by the light's mean over the sphere.

    python benchmarks/exposure.py CORPUS

Recomposes the train split's first examples from their layers with a brighter or dimmer light.
Prints the share of fully covered pixels with a clipped channel, and the pixels' median level.
"""

import argparse
from pathlib import Path

import numpy as np
import tensorflow as tf

from lime_keras.data import records
from lime_keras.data.corpus import Split
from lime_keras.optics import colour
from lime_keras.optics.compositing import compose
from lime_keras.render.scene.lights import MEAN_RADIANCE

MEANS = (0.2, 0.3, 0.4, 0.55, 0.7, 1.0)
EXAMPLES = 300


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("corpus", type=Path)
    shards = [str(path) for path in Split(options.parse_args().corpus, "train").shard_paths()]
    clipped: dict[float, list[float]] = {mean: [] for mean in MEANS}
    median: dict[float, list[float]] = {mean: [] for mean in MEANS}
    for serialized in tf.data.TFRecordDataset(shards).take(EXAMPLES):
        example = {name: value.numpy() for name, value in records.parse(serialized).items()}
        inside = example["mask"][..., 0] >= 1
        for mean in MEANS:
            scale = mean / MEAN_RADIANCE
            linear = compose(
                example["diffuse_albedo"],
                example["specular_albedo"],
                example["ambient"],
                example["diffuse_shading"][None] * scale,
                example["specular_shading"][None] * scale,
            )[0][inside]
            clipped[mean].append(float(np.mean(linear.max(axis=-1) >= 1)))
            median[mean].append(float(np.median(colour.linear_to_srgb(np.minimum(linear, 1)))))
    print("| spherical mean | clipped pixels | objects half clipped or more | median sRGB level |")
    print("|---:|---:|---:|---:|")
    for mean in MEANS:
        shares = np.array(clipped[mean])
        print(
            f"| {mean:g} | {shares.mean():.1%} | {np.mean(shares >= 0.5):.1%} "
            f"| {np.mean(median[mean]):.2f} |"
        )


if __name__ == "__main__":
    main()
