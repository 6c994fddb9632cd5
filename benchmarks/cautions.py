"""Limits of the cautions, each beside others, on scenes that no training has used.

    python benchmarks/cautions.py CORPUS [--weights live]

Estimates photos of the scenes in the train split of CORPUS, which no training has seen, as
`lime-estimate` does, and prints three tables, and how often the interval of s holds the truth:

- the masks below each limit of confidence (`cautions.CONFIDENT`), and how many of them are wrong,
  with an IoU below 0.7;
- the photos of one material whose patches differ more in colour than each limit
  (`cautions.SPREAD`), in grey light under the camera's casts, and in light with 1.6 times as much
  red as green and 0.4 times as much blue;
- the photos, and those of the same scenes two stops shorter, in which fewer pixels are bright than
  each limit (`cautions.FEWEST_BRIGHT`). The object's radiance is unbounded before it is
  photographed, its surroundings are clipped as the corpus has them.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scenes
from scipy import stats

from lime_keras import Estimator
from lime_keras.estimate import cautions
from lime_keras.eval.markdown_table import aligned
from lime_keras.metrics import overlap, overlap_ratio
from lime_keras.optics import colour, dichromatic, gloss
from lime_keras.optics.compositing import compose

_WRONG_MASK = 0.7
_CONFIDENCES = (0.75, 0.8, 0.825, 0.85, 0.875, 0.9, 0.925, 0.95)
_SPREADS = (0.05, 0.08, 0.1, 0.11, 0.12, 0.15, 0.2)
_BRIGHT_SHARES = (0.001, 0.005, 0.01, 0.02, 0.05)
_WARM = np.array([1.6, 1.0, 0.4], np.float32)


class Answer(NamedTuple):
    """The answer for one photo beside the truth.

    Attributes:
        confidence: of the mask.
        iou: of the mask.
        width: of the exponent's interval, in decades.
        error: of log10 s.
        is_inside: whether the true exponent lies in the interval.
        spread: spread of the colours inside the true mask, in grey light.
        spread_warm: the same in warm light.
        bright: share of the photo's pixels that are bright.
        bright_short: the same, two stops shorter.
    """

    confidence: float
    iou: float
    width: float
    error: float
    is_inside: bool
    spread: float
    spread_warm: float
    bright: float
    bright_short: float


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", default="live", help="a run, or a set that ships")
    arguments = options.parse_args()
    answers = _answers(Estimator(arguments.weights, ["mask", "exponent"]), arguments.corpus)
    columns = Answer(*np.array(answers, np.float64).T)
    _of_masks(columns)
    _of_gloss(columns)
    _of_colours(columns)
    _of_exposures(columns)


def _answers(estimator: Estimator, corpus: Path) -> list[Answer]:
    """Return the answers for all scenes of the train split in which an object was found."""
    out = []
    for scene in scenes.scenes(corpus, "train", camera=True):
        image, mask = scene["image"], scene["mask"]
        material = estimator.estimate(scenes.levels(image))
        if material.exponent is None or material.exponent_interval is None:
            continue
        exponent = float(scene["shininess"])
        low, high = material.exponent_interval
        inside = mask[..., 0] >= 0.5
        warm = colour.linear_to_srgb(np.clip(colour.srgb_to_linear(image) * _WARM, 0, 1))
        short = colour.linear_to_srgb(np.clip(_radiance(scene) / 4, 0, 1))
        out.append(
            Answer(
                material.mask_confidence or 0.0,
                overlap_ratio(*overlap(mask[None], material.layers["mask"][None]))[0],
                np.log10(high / low),
                abs(np.log10(material.exponent / exponent)),
                low <= exponent <= high,
                dichromatic.colour_spread(image, inside),
                dichromatic.colour_spread(warm, inside),
                cautions.bright_share(image),
                cautions.bright_share(short),
            )
        )
    return out


def _radiance(scene: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the photo `(H, W, 3)` in linear radiance, by Eq. 4 unbounded on the object."""
    of_object = compose(
        *(scene[name] for name in ("diffuse_albedo", "specular_albedo", "ambient")),
        *(scene[name] for name in ("diffuse_shading", "specular_shading")),
    )[0]
    whole = np.where(scene["mask"] > 0.95, of_object, 0)
    return np.maximum(colour.srgb_to_linear(scene["image"]), whole)


def _of_masks(found: Answer) -> None:
    confidence, iou = np.asarray(found.confidence), np.asarray(found.iou)
    wrong = iou < _WRONG_MASK
    print(
        f"{len(iou)} masks found, median IoU {np.median(iou):.3f}, wrong {wrong.mean():.1%}; rank "
        f"correlation {stats.spearmanr(confidence, iou).statistic:.2f}; confidence is "
        f"{np.mean(confidence - iou):+.3f} off in the mean"
    )
    rows = []
    for limit in _CONFIDENCES:
        below = confidence < limit
        caught = (below & wrong).sum()
        shares = (below.mean(), caught / max(wrong.sum(), 1), caught / max(below.sum(), 1))
        rows.append((f"{limit}", *(f"{share:.1%}" for share in shares)))
    heads = ("limit", "masks below", "of wrong masks found", "of those below, wrong")
    _table(heads, rows, cautions.CONFIDENT)


def _of_gloss(found: Answer) -> None:
    width, error = np.asarray(found.width), np.asarray(found.error)
    print(
        f"The interval holds the true s in {np.mean(found.is_inside):.1%} ({gloss.SHARE:.0%} are "
        f"meant), its median width is {np.median(width):.2f} decades; its rank correlation with "
        f"the error of log10 s is {stats.spearmanr(width, error).statistic:.2f}\n"
    )


def _of_colours(found: Answer) -> None:
    print("Photos of one material with a larger spread of colours than the limit")
    lights = [np.asarray(found.spread), np.asarray(found.spread_warm)]
    rows = [(f"{x}", *(f"{np.mean(light > x):.1%}" for light in lights)) for x in _SPREADS]
    _table(("limit", "in grey light", "in warm light"), rows, cautions.SPREAD)


def _of_exposures(found: Answer) -> None:
    print("Photos of which fewer pixels are bright than the limit")
    photos = [np.asarray(found.bright), np.asarray(found.bright_short)]
    rows = [(f"{x}", *(f"{np.mean(photo < x):.1%}" for photo in photos)) for x in _BRIGHT_SHARES]
    _table(("limit", "as exposed", "two stops shorter"), rows, cautions.FEWEST_BRIGHT)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], now: float) -> None:
    print(f"\n{aligned([heads, *rows], ())}\n\nlimit now: {now}\n")


if __name__ == "__main__":
    main()
