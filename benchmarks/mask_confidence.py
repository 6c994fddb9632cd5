"""The wrong masks that each limit of the confidence finds, on the scenes that training holds out.

    python benchmarks/mask_confidence.py CORPUS [--weights live]

Estimates each held-out image, photographed, as `lime-estimate` does, and prints what the limit of
the caution `uncertain-mask` (`lime_keras.estimate.cautions.CONFIDENT`) would find, limit by limit.
A mask counts as wrong if its IoU with the true one is below 0.7.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy import stats
from tqdm import tqdm

from lime_keras import Estimator
from lime_keras.networks import PRESETS
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data
from lime_keras.train.stages import SCHEDULES

_WRONG = 0.7
_LIMITS = (0.75, 0.8, 0.825, 0.85, 0.875, 0.9, 0.925, 0.95)


def main() -> None:
    """Print the correlation of confidence and IoU, and a row for each limit."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", default="live", help="a run, or a set that ships")
    arguments = options.parse_args()
    config = Config(
        preset="live",
        steps_scale=1.0,
        architecture=PRESETS["live"],
        schedule=SCHEDULES["live"],
        seed=0,
        corpus_sha256=corpus_sha256([arguments.corpus]),
        camera=True,
        materials=("natural",),
    )
    estimator, found = Estimator(arguments.weights), []
    batches = Data([arguments.corpus], config).held_out(("image", "mask"))
    for batch in tqdm(batches, unit="batch"):
        for image, true in zip(np.asarray(batch["image"]), np.asarray(batch["mask"]), strict=True):
            material = estimator.estimate(np.uint8(np.rint(255 * image)))
            if material.mask_confidence is None:
                continue
            inside, wanted = material.layers["mask"] >= 0.5, true >= 0.5
            iou = (inside & wanted).sum() / (inside | wanted).sum()
            found.append((material.mask_confidence, iou))
    confidence, iou = np.array(found).T
    wrong = iou < _WRONG
    print(
        f"{len(iou)} masks found, median IoU {np.median(iou):.3f}, wrong {wrong.mean():.1%}; rank "
        f"correlation {stats.spearmanr(confidence, iou).statistic:.2f}; confidence is "
        f"{np.mean(confidence - iou):+.3f} off in the mean\n"
    )
    print(
        "| limit | masks below | of wrong masks found | of those below, wrong |\n|---|"
        + "---:|" * 3
    )
    for limit in _LIMITS:
        below = confidence < limit
        caught = (below & wrong).sum()
        print(
            f"| {limit} | {below.mean():.1%} | {caught / max(wrong.sum(), 1):.0%} | "
            f"{caught / max(below.sum(), 1):.0%} |"
        )


if __name__ == "__main__":
    main()
