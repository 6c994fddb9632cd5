"""The error of SpecularNet of several runs on the same images, which none of them has seen.

    python benchmarks/specular_runs.py CORPUS RUN [RUN ...]

The images are those of the corpus' test split, photographed, cut out by their true masks. The error
is the mean of |log(1 + S) − prediction| over the mask, and its standard error over the images.
"""

import argparse
from pathlib import Path

import numpy as np
from keras import ops

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.networks import weights
from lime_keras.optics.dynamic_range import compress
from lime_keras.optics.masking import masked_mean

FEATURES = ("image", "mask", "specular_shading")


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("corpus", type=Path)
    options.add_argument("runs", type=Path, nargs="+")
    arguments = options.parse_args()
    shards = Split(arguments.corpus, "test").shard_paths()
    print("| run | images | error |\n|---|---:|---:|")
    for run in arguments.runs:
        architecture, subnetworks = weights.load(run, whole=False)
        errors = []
        for batch in pipeline.evaluation(
            shards, size=architecture.size, batch_size=32, camera=True, features=FEATURES
        ):
            found = subnetworks["specular"](batch["image"] * batch["mask"])
            difference = ops.abs(found - compress(batch["specular_shading"]))
            errors.append(ops.convert_to_numpy(masked_mean(difference, batch["mask"])))
        every = np.concatenate(errors)
        spread = every.std() / len(every) ** 0.5
        print(f"| {run} | {len(every)} | {every.mean():.4f} ± {spread:.4f} |", flush=True)


if __name__ == "__main__":
    main()
