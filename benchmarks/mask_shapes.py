"""The mask by kind of shape: thin and compact ones apart, and what a larger SegmentationNet sees.

    python benchmarks/mask_shapes.py CORPUS --weights live uniform [--sizes 128 192 256]

CORPUS has a test split of 256 pixels or more. SegmentationNet, which is convolutional, runs at each
size; masks are compared at the corpus' own. A shape is thin if half of its pixels lie within a
fortieth of the frame of its edge. The boundary's F-score accepts edges that are off by a hundredth
of the frame.
"""

import argparse
import dataclasses
from pathlib import Path

import keras
import numpy as np
from PIL import Image
from scipy import ndimage
from tqdm import tqdm

from lime_keras import console
from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import SUBNETWORKS
from lime_keras.train.photos.answers import predict_mask

_THIN = 1 / 40
_OFF = 1 / 100


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", nargs="+", default=["live"])
    options.add_argument("--sizes", type=console.count, nargs="+", default=[128, 192, 256])
    options.add_argument("--count", type=console.count, default=320)
    arguments = options.parse_args()
    split = Split(arguments.corpus, "test")
    dataset = pipeline.evaluation(
        pipeline.verified_shards(split), size=split.size, batch_size=1, features=("image", "mask")
    )
    scenes = list(dataset.take(arguments.count).as_numpy_iterator())
    thin = np.array([_is_thin(scene["mask"][0, ..., 0] >= 0.5) for scene in scenes])
    print(f"{thin.sum()} of {len(thin)} shapes are thin\n")
    print("| weights | size | IoU | thin | others | boundary F | thin | others |")
    print("|---|---:|" + "---:|" * 6)
    for name in arguments.weights:
        architecture, networks = weights.load(model_folder.find(name), whole=False)
        for size in arguments.sizes:
            network = SUBNETWORKS["segmentation"].build(
                dataclasses.replace(architecture, size=size)
            )
            network.set_weights(networks["segmentation"].get_weights())
            rows = [_measured(network, size, scene) for scene in tqdm(scenes, unit="image")]
            found = np.array(rows)
            cells = [found[which, k].mean() for k in (0, 1) for which in (thin | True, thin, ~thin)]
            print(f"| {name} | {size} | " + " | ".join(f"{cell:.3f}" for cell in cells) + " |")


def _is_thin(inside: np.ndarray) -> bool:
    depth = ndimage.distance_transform_edt(inside)[inside]
    return bool(len(depth)) and float(np.median(depth)) < _THIN * len(inside)


def _measured(network: keras.Model, size: int, scene: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return the IoU and the F-score of the boundary of a scene's mask."""
    true = scene["mask"][0, ..., 0] >= 0.5
    whole = len(true)
    levels = np.round(scene["image"][0] * 255).astype(np.uint8)
    small = Image.fromarray(levels).resize((size, size), Image.Resampling.BOX)
    mask = predict_mask(network, np.asarray(small, np.float32)[None] / 255)[0, ..., 0]
    shown = Image.fromarray(mask).resize((whole, whole), Image.Resampling.BILINEAR)
    found = np.asarray(shown) >= 0.5
    union = (true | found).sum()
    overlap = (true & found).sum() / union if union else 1.0
    return overlap, _boundary_f(true, found, _OFF * whole)


def _boundary_f(true: np.ndarray, found: np.ndarray, off: float) -> float:
    """Return the harmonic mean of the shares of each mask's edge near the other's."""
    edges = [one & ~ndimage.binary_erosion(one) for one in (true, found)]
    if not all(edge.any() for edge in edges):
        return float(not any(edge.any() for edge in edges))
    recall, precision = (
        (ndimage.distance_transform_edt(~other)[edge] <= off).mean()
        for edge, other in (edges, edges[::-1])
    )
    return 2 * recall * precision / max(recall + precision, 1e-9)


if __name__ == "__main__":
    main()
