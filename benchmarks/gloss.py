"""The calibration of the words for a gloss: what a set of weights says, and how often it is right.

    python benchmarks/gloss.py CORPUS [--weights best] [--write] [--photos DIR]

Estimates photos of the scenes in the train split of CORPUS, which must be scenes that no training
has seen (`lime-render CORPUS --split train --count 1000 --size 128 --materials natural --seed N`).
Fits the probability of being glossy to half of them, and prints for the other half the share of
answers that name a side, and how many of those are right. `--write` fits all scenes, and writes
`gloss.json` beside the weights. `--photos` names a folder of labelled photographs
(docs/how-to/photographs.md); they are only reported.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import photographs
import record
import scenes

from lime_keras import Estimator
from lime_keras.data.corpus import Split
from lime_keras.eval.accuracy.evaluate import check_lobe
from lime_keras.io import atomic
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file
from lime_keras.optics import gloss

CODE = 1
_STEPS = 50


def main() -> None:
    """Print, and with --write keep, the calibration of a set."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", default="best", help="a run, or a set that ships")
    options.add_argument("--photos", type=Path, help="folder of the labelled photographs")
    options.add_argument("--write", action="store_true", help="write gloss.json beside the weights")
    record.add_option(options)
    arguments = options.parse_args()
    check_lobe(model_folder.find(arguments.weights), Split(arguments.corpus, "train"))
    estimator = Estimator(arguments.weights, ["mask", "albedo", "exponent"])
    of_scenes = _scenes(estimator, arguments.corpus)
    levels, glossy = (np.array(column) for column in zip(*of_scenes, strict=True))
    # Every second scene: both halves hold all shapes and lights.
    fitted, kept = slice(0, None, 2), slice(1, None, 2)
    measured = _measure(fit(levels[fitted], glossy[fitted]), levels[kept], glossy[kept])
    calibration = fit(levels, glossy)
    print(f"{arguments.weights}: {len(levels)} scenes, {glossy.mean():.0%} glossy; {calibration}")
    print("the half that was not fitted:", _sentence(measured))
    columns = {f"renders_{name}": figure for name, figure in measured.items()}
    if arguments.photos:
        pairs = list(_photographs(estimator, calibration, arguments.photos))
        of_photos = _measure(calibration, *map(np.array, zip(*pairs, strict=True)))
        print("photographs:", _sentence(of_photos))
        columns |= {f"photographs_{name}": figure for name, figure in of_photos.items()}
    if arguments.record:
        record.write(
            arguments.record,
            {arguments.weights: columns},
            code=CODE,
            weights=[arguments.weights],
            corpus=arguments.corpus,
        )
    if arguments.write:
        path = model_folder.folder(model_folder.find(arguments.weights)) / gloss_file.NAME
        content = {name: round(value, 3) for name, value in calibration._asdict().items()}
        shares = {name: round(figure.value, 3) for name, figure in measured.items()}
        content |= {"scenes": len(levels), "held_out_half": shares}
        atomic.write(path, json.dumps(content, indent=1) + "\n")
        print(f"written to {path}")


def fit(levels: np.ndarray, glossy: np.ndarray) -> gloss.Calibration:
    """Return the logistic regression of `glossy` `(N,)` by `levels` `(N,)`, by Newton's method."""
    columns = np.stack([np.ones_like(levels), levels], axis=-1)
    weights = np.zeros(2)
    for _ in range(_STEPS):
        likely = 1 / (1 + np.exp(-columns @ weights))
        curvature = (columns * (likely * (1 - likely))[:, None]).T @ columns
        weights += np.linalg.solve(curvature + 1e-6 * np.eye(2), columns.T @ (glossy - likely))
    return gloss.Calibration(even=float(-weights[0] / weights[1]), slope=float(weights[1]))


def _scenes(estimator: Estimator, corpus: Path) -> Iterator[tuple[float, bool]]:
    """Yield the estimated level of each photographed scene, and whether it is glossy."""
    for scene in scenes.scenes(corpus, "train", camera=True):
        material = estimator.estimate(scenes.levels(scene["image"]))
        if material.exponent is not None:
            true = gloss.level(float(scene["shininess"]), float(scene["specular_albedo"]))
            yield gloss.level(material.exponent, material.specular_albedo), true >= gloss.SIDE


def _photographs(
    estimator: Estimator, calibration: gloss.Calibration, folder: Path
) -> Iterator[tuple[float, bool]]:
    """Print what is said of each labelled photograph; yield its level and whether it is glossy."""
    for photo in photographs.read_folder(folder):
        material = estimator.estimate(photo.path)
        if material.exponent is None:
            continue
        numbers = material.exponent, material.specular_albedo
        said = gloss.describe(calibration.probability(*numbers), *numbers)
        print(f"  {photo.name:28} {photo.finish or '':7} {said}")
        if photo.finish:
            yield gloss.level(*numbers), photo.finish == "glossy"


def _measure(
    calibration: gloss.Calibration, levels: np.ndarray, glossy: np.ndarray
) -> dict[str, record.Figure]:
    """Return the shares of answers that name a side, and of these that are right."""
    likely = np.array([calibration.probability(10.0**level, None) for level in levels])
    right = (likely > 0.5) == glossy
    sides = np.maximum(likely, 1 - likely)
    named, sure = sides >= gloss.EVEN, sides >= gloss.SURE
    everything = np.ones(len(levels), bool)
    shares = {
        "named": (named, everything),
        "named_right": (right, named),
        "sure": (sure, everything),
        "sure_right": (right, sure),
    }
    return {
        name: record.Figure(
            float(of[among].mean()) if among.any() else np.nan, None, int(among.sum())
        )
        for name, (of, among) in shares.items()
    }


def _sentence(measured: dict[str, record.Figure]) -> str:
    named, right, sure, sure_right = (f"{share:.0%}" for share in measured.values())
    return f"{named} name a side, {right} of these right; {sure} are sure, {sure_right} right"


if __name__ == "__main__":
    main()
