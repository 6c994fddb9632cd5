"""The wrong words for a gloss that each limit of its interval finds, on the held-out scenes.

    python benchmarks/gloss_confidence.py CORPUS [--weights live]

Estimates each held-out image, photographed, as `lime-estimate` does, and prints what the limit from
which a gloss is called uncertain (`lime_keras.optics.gloss.FLAT`) would find, limit by limit. A
word is wrong if the true exponent has another one. The last line names the limit to set: the lowest
from which at least two words in three are wrong, as a guess would have three in four.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy import stats
from tqdm import tqdm

from lime_keras import Estimator
from lime_keras.networks import PRESETS
from lime_keras.optics import gloss
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data
from lime_keras.train.stages import SCHEDULES

_LIMITS = (1.0, 1.2, 1.4, 1.6, 1.7, 1.8, 1.9, 2.0, 2.1, 2.2)
_WRONG = 2 / 3


def main() -> None:
    """Print how often the interval holds, a row for each limit, and the limit to set."""
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
    estimator, rows = Estimator(arguments.weights, ["mask", "exponent"]), []
    batches = Data([arguments.corpus], config).held_out(("image", "shininess"))
    for batch in tqdm(batches, unit="batch"):
        true = np.asarray(batch["shininess"]).ravel()
        for image, exponent in zip(np.asarray(batch["image"]), true, strict=True):
            material = estimator.estimate(np.uint8(np.rint(255 * image)))
            ends = material.exponent_interval
            if material.exponent is None or ends is None:
                continue
            wrong = gloss.word(material.exponent) != gloss.word(float(exponent))
            error = abs(np.log10(material.exponent / exponent))
            rows.append((np.log10(ends[1] / ends[0]), wrong, error, ends[0] <= exponent <= ends[1]))
    width, wrong, error, held = np.array(rows, np.float64).T
    rank = stats.spearmanr(width, error).statistic
    print(
        f"{len(width)} scenes; the interval holds the true s in {held.mean():.1%} "
        f"({gloss.SHARE:.0%} are meant), its median width is {np.median(width):.2f} decades; its "
        f"rank correlation with the error of log10 s is {rank:.2f}\n\n"
        "| limit | above | wrong words above | below | error of log10 s above | below |\n|---|"
        + "---:|"
        * 5
    )
    for limit in _LIMITS:
        above = width >= limit
        cells = [np.mean(wrong[part]) if part.any() else np.nan for part in (above, ~above)]
        errors = [np.mean(error[part]) if part.any() else np.nan for part in (above, ~above)]
        print(
            f"| {limit} | {above.mean():.1%} | {cells[0]:.0%} | {cells[1]:.0%} | {errors[0]:.2f} | "
            f"{errors[1]:.2f} |"
        )
    fit = [x for x in _LIMITS if (width >= x).any() and wrong[width >= x].mean() >= _WRONG]
    print(f"\nlimit to set: {min(fit, default=max(_LIMITS))} (now {gloss.FLAT})")


if __name__ == "__main__":
    main()
