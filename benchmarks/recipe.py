"""A comparison of ways to train a subnetwork of `live`, on scenes that were held out.

One thing differs from the trial before at a time.

    python benchmarks/recipe.py CORPUS [--steps 600] [--seeds 3] [--only NAME ...]

Each trial trains one subnetwork alone from fresh weights, with the preset's sizes, batches,
augmentations and falling rate, from several seeds. The mean of the weights is exponential, over
some 1 / (1 − 0.99) steps; it is taken during the trial whose name it follows, so both have seen the
same images. The table has the measures on the held-out scenes, mean and range over the seeds.
"""

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
from keras import ops
from tqdm import tqdm

from lime_keras.losses import mask_l2, mask_structure
from lime_keras.networks import PRESETS, build
from lime_keras.networks.precision import computing_in
from lime_keras.optics import shininess
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data, without_origin
from lime_keras.train.optimizer import OPTIMIZERS
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES, WARM_UP, Stage
from lime_keras.train.state import Means
from lime_keras.train.terms import TERMS, Batch, StageAnswer

MOMENTUM = 0.99
"""Share of the mean that each step keeps."""
SPREAD = 0.5
"""Standard deviation of soft targets, in bins."""
OVERLAP = 0.1
"""Weight of 1 − IoU beside the mean squared error of the mask."""


def soft_cross_entropy(batch: Batch, answer: StageAnswer) -> Any:
    """Return the cross-entropy against targets that spread over the bins near the true log10 s."""
    log = ops.log10(ops.maximum(batch["shininess"], 10.0**shininess.LOG_LOW))
    position = (log - shininess.LOG_LOW) / shininess.BIN_WIDTH - 0.5
    distance = ops.arange(shininess.BIN_COUNT, dtype="float32")[None] - position[:, None]
    target = ops.softmax(-0.5 * ops.square(distance / SPREAD), axis=-1)
    logits = answer.raw["exponent_bin_probabilities"]
    return ops.categorical_crossentropy(target, logits, from_logits=True)


def structure(batch: Batch, answer: StageAnswer) -> Any:
    """Return the structure loss of the mask."""
    return mask_structure(batch["mask"], answer.raw["mask"])


def squares_and_overlap(batch: Batch, answer: StageAnswer) -> Any:
    """Return the mean squared error of the mask plus a share of 1 − IoU of the coverages."""
    mask, found = batch["mask"], answer.raw["mask"]
    covered = ops.clip(found, 0.0, 1.0)
    axes = (1, 2, 3)
    both = ops.sum(ops.minimum(covered, mask), axis=axes)
    either = ops.sum(ops.maximum(covered, mask), axis=axes)
    return mask_l2(mask, found) + OVERLAP * (1 - (both + 1) / (either + 1))


@dataclasses.dataclass(frozen=True)
class Trial:
    """A way to train a subnetwork.

    Attributes:
        subnetwork: its name.
        optimizer: a key of `OPTIMIZERS`.
        rate: largest learning rate.
        losses: losses in place of those of some loss terms, by the term's name.
    """

    subnetwork: str
    optimizer: str = "muon"
    rate: float = 2e-3
    losses: Mapping[str, Callable[[Batch, StageAnswer], Any]] = dataclasses.field(
        default_factory=dict
    )


TRIALS = {
    "S: Adam 5e-4": Trial("specular", "adam", 5e-4),
    "S: Adam 2e-3": Trial("specular", "adam"),
    "S: Muon 2e-3": Trial("specular"),
    "mask: Adam 2e-3": Trial("segmentation", "adam"),
    "mask: Muon 2e-3": Trial("segmentation"),
    "mask: structure loss": Trial("segmentation", losses={"mask": structure}),
    "mask: squares and IoU": Trial("segmentation", losses={"mask": squares_and_overlap}),
    "exponent: Adam 2e-3": Trial("exponent", "adam"),
    "exponent: Muon 2e-3": Trial("exponent"),
    "exponent: soft targets": Trial("exponent", losses={"exponent": soft_cross_entropy}),
    "albedo: Adam 2e-3": Trial("albedo", "adam"),
    "albedo: Muon 2e-3": Trial("albedo"),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--preset", default="live", choices=list(PRESETS))
    parser.add_argument("--size", type=int, help="of the images (default: the preset's)")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", nargs="+", choices=list(TRIALS), default=list(TRIALS))
    options = parser.parse_args()
    print("| trial | measure | single weights | their mean | ms a step |\n|---|---|---:|---:|---:|")
    for name in options.only:
        single, averaged, seconds = zip(
            *(_results(name, seed, options) for seed in range(options.seeds)), strict=True
        )
        for measure in single[0]:
            cells = [_cell([found[measure] for found in column]) for column in (single, averaged)]
            print(
                f"| {name} | {measure} | {' | '.join(cells)} | {1e3 * np.median(seconds):.0f} |",
                flush=True,
            )


def _cell(values: list[float]) -> str:
    return f"{np.mean(values):.4f} ({min(values):.4f} to {max(values):.4f})"


def _results(
    name: str, seed: int, options: argparse.Namespace
) -> tuple[dict[str, float], dict[str, float], float]:
    """Return the measures of the last weights and of their mean, and the seconds of a step."""
    trial = TRIALS[name]
    architecture = PRESETS[options.preset]
    if options.size:
        architecture = dataclasses.replace(architecture, size=options.size)
    config = Config(
        preset=options.preset,
        steps_scale=1.0,
        architecture=architecture,
        schedule=SCHEDULES[options.preset],
        seed=seed,
        corpus_sha256=corpus_sha256([options.corpus]),
        camera=True,
        precision="bfloat16",
    )
    stage = Stage((trial.subnetwork,), options.steps, trial.rate, True, trial.optimizer)
    data = Data([options.corpus], config)
    with computing_in(config.precision):
        network = build(architecture, seed)[trial.subnetwork]
    model = StageModel({trial.subnetwork: network})
    replaced = {term: dataclasses.replace(TERMS[term], loss=f) for term, f in trial.losses.items()}
    kept = {term: TERMS[term] for term in replaced}
    TERMS.update(replaced)
    try:
        warm_up = max(1, round(WARM_UP * stage.steps))
        rates: Any = keras.optimizers.schedules.CosineDecay(
            0.0, stage.steps - warm_up, warmup_target=stage.learning_rate, warmup_steps=warm_up
        )
        optimizer = OPTIMIZERS[trial.optimizer](
            rates, [(trial.subnetwork, len(network.trainable_variables))]
        )
        model.compile(optimizer=optimizer)
        batches = data.training(stage, model.features, 0)
        mean, seconds = network.get_weights(), []
        for _ in tqdm(range(stage.steps), desc=f"{name}, seed {seed}", file=sys.stderr):
            batch = without_origin(next(batches))
            began = time.perf_counter()
            model.train_on_batch(batch)
            seconds.append(time.perf_counter() - began)
            for averaged, value in zip(mean, network.get_weights(), strict=True):
                averaged += (1 - MOMENTUM) * (value - averaged)
        found = _measured(model, data)
        network.set_weights(mean)
        return found, _measured(model, data), float(np.median(seconds))
    finally:
        TERMS.update(kept)


def _measured(model: StageModel, data: Data) -> dict[str, float]:
    """Return the losses and the measures of Table 1 on the held-out scenes."""
    model.reset_measures()
    losses = Means()
    for batch in data.held_out(model.features):
        ones = np.ones(len(batch["mask"]))
        losses.add(model.test_on_batch(batch, sample_weight=ones, return_dict=True))
    return {f"loss: {name}": value for name, value in losses.means().items()} | model.measured()


if __name__ == "__main__":
    main()
