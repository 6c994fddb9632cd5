"""The measures of trained weights on the scenes that training on a corpus holds out, photographed.

    python benchmarks/held_out.py CORPUS --weights uniform runs/mine [--materials natural]

Prints a table of the IoU of the mask over all images, and one of the losses and measures of the
other subnetworks, joined, which see the true mask or, in the rows "own mask", SegmentationNet's.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.optics import material_law
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data
from lime_keras.train.photos.kept import INPUT_MASK
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES
from lime_keras.train.state import Means

_BATCH = 32


def main() -> None:
    """Print both tables."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", nargs="+", required=True, help="runs, or sets that ship")
    options.add_argument("--materials", choices=material_law.LAWS, default="uniform")
    arguments = options.parse_args()
    models = {name: weights.load(model_folder.find(name)) for name in arguments.weights}
    architectures = [architecture for architecture, _ in models.values()]
    if len({architecture.size for architecture in architectures}) > 1:
        options.error("these weights see images of different sizes: measure them one by one")
    config = Config(
        preset="live",
        steps_scale=1.0,
        architecture=architectures[0],
        schedule=SCHEDULES["live"],
        seed=0,
        corpus_sha256=corpus_sha256([arguments.corpus]),
        materials=(arguments.materials,),
    )
    with tempfile.TemporaryDirectory() as folder:
        _tables(models, Data([arguments.corpus], config, Path(folder)))


def _tables(models: dict[str, Any], data: Data) -> None:
    loaded = {name: networks for name, (_, networks) in models.items()}
    print("| weights | pooled IoU | mean | median | below 0.5 |\n|---|---:|---:|---:|---:|")
    for name, networks in loaded.items():
        overlap, union = _areas(networks["segmentation"], data)
        shares = overlap / np.maximum(union, 1)
        cells = (
            overlap.sum() / union.sum(),
            shares.mean(),
            np.median(shares),
            (shares < 0.5).mean(),
        )
        print(f"| {name} | " + " | ".join(f"{cell:.3f}" for cell in cells) + " |", flush=True)
    joined = {}
    for name, networks in loaded.items():
        data.set_masker(networks["segmentation"])
        joined[f"{name}, true mask"] = _joined(networks, data, ())
        joined[f"{name}, own mask"] = _joined(networks, data, (INPUT_MASK,))
    columns = list(next(iter(joined.values())))
    print(f"\n| weights | {' | '.join(columns)} |\n|---|" + "---:|" * len(columns))
    for name, found in joined.items():
        print(f"| {name} | " + " | ".join(f"{found[column]:.4f}" for column in columns) + " |")


def _areas(network: keras.Model, data: Data) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of the intersection and of the union of each held-out image's masks."""
    both, either = [], []
    for batch in data.validation(("image", "mask")):
        true = np.asarray(batch["mask"]) >= 0.5
        found = network.predict(np.asarray(batch["image"]), batch_size=_BATCH, verbose=0) >= 0.5
        both.append((true & found).sum((1, 2, 3)))
        either.append((true | found).sum((1, 2, 3)))
    return np.concatenate(both), np.concatenate(either)


def _joined(
    networks: dict[str, keras.Model], data: Data, seen: tuple[str, ...]
) -> dict[str, float]:
    """Return the losses and the measures of all subnetworks but SegmentationNet, joined."""
    model = StageModel({name: one for name, one in networks.items() if name != "segmentation"})
    model.compile(optimizer="sgd")
    losses = Means()
    for batch in data.validation((*model.features, *seen)):
        ones = np.ones(len(batch["mask"]))
        losses.add(model.test_on_batch(batch, sample_weight=ones, return_dict=True))
    return losses.means() | model.measured()


if __name__ == "__main__":
    main()
