"""A comparison of choices that the paper's text leaves open for a U-Net, tried on SpecularNet.

One choice differs from the default at a time. For the output head see `heads.py`.

    python benchmarks/choices.py CORPUS [--steps 600] [--seeds 1] [--only NAME ...]

Trains SpecularNet with the smoke preset's sizes and schedule from each seed. Prints the error on
held-out examples: the masked ℓ1 of log(1 + S), for every training target. Above the table stands
the error of a black prediction. The time of a step is a median, so that the first step (tracing)
does not count.
"""

import argparse
import dataclasses
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
from keras import ops
from tqdm import tqdm

from lime_keras.data import pipeline
from lime_keras.data.features import LEARNT_FROM
from lime_keras.networks import PRESETS, SUBNETWORKS
from lime_keras.networks.precision import computing_in
from lime_keras.optics.masking import masked_mean
from lime_keras.train.stages import SCHEDULES

BRIGHTEST = 1.0
"""Radiance at which the target "S clipped at 1" cuts S off: the white of the image."""


@dataclasses.dataclass(frozen=True)
class Choice:
    """A way to build and train the network.

    Attributes:
        width: channels of the U-Net's first level.
        initialiser: initialiser of the convolutions with ReLU.
        encode: function from linear radiance to the target of the ℓ1 loss.
        decode: inverse of `encode`.
        precision: precision in which the network computes, a key of `precision.POLICIES`.
    """

    width: int = PRESETS["smoke"].unet_width
    initialiser: str = "he_normal"
    encode: Callable[[Any], Any] = ops.log1p
    decode: Callable[[Any], Any] = ops.expm1
    precision: str = "float32"


def _clip(linear: Any) -> Any:
    return ops.minimum(linear, BRIGHTEST)


CHOICES = {
    "as chosen": Choice(),
    "initialisation: Glorot": Choice(initialiser="glorot_uniform"),
    "target: asinh(S)": Choice(encode=ops.arcsinh, decode=ops.sinh),
    "target: S clipped at 1": Choice(encode=_clip, decode=lambda value: value),
    "target: S": Choice(encode=lambda linear: linear, decode=lambda value: value),
    "precision: bfloat16": Choice(precision="bfloat16"),
    "precision: float16": Choice(precision="float16"),
    "width: 8": Choice(width=8),
    "width: 16": Choice(width=16),
}


class SpecularModel(keras.Model):
    """A model that trains SpecularNet with a masked ℓ1 loss on the encoded radiance of a choice."""

    def __init__(self, network: keras.Model, choice: Choice):
        super().__init__(dtype="float32")
        self.network, self.choice = network, choice

    def call(self, batch: Any, training: bool = False) -> Any:
        """Return the network's prediction, encoded S."""
        return self.network(batch["image"] * batch["mask"], training=training)

    def compute_loss(
        self, x: Any = None, y: Any = None, y_pred: Any = None, sample_weight: Any = None, **_: Any
    ) -> Any:
        """Return the mean loss of the batch."""
        error = ops.abs(y_pred - self.choice.encode(x["specular_shading"]))
        return ops.mean(masked_mean(error, x["mask"]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--examples", type=int, default=320, help="held out")
    parser.add_argument("--only", nargs="+", choices=list(CHOICES), default=list(CHOICES))
    options = parser.parse_args()
    training, kept_back = pipeline.training_shards(options.corpus)
    size, batch_size = PRESETS["smoke"].size, SCHEDULES["smoke"].batch_size
    evaluation = pipeline.evaluation(
        kept_back, size=size, batch_size=batch_size, features=LEARNT_FROM
    )
    held_out = list(evaluation.take(math.ceil(options.examples / batch_size)))
    black = np.mean([_error(batch, 0.0 * batch["specular_shading"]) for batch in held_out])
    seeds = range(options.seeds)
    print(f"held-out error of black: {black:.3f}\n")
    print("| choice | " + " | ".join(f"seed {seed}" for seed in seeds) + " | seconds a step |")
    print("|---|" + "---:|" * (len(seeds) + 1))
    for name in options.only:
        errors: list[np.floating] = []
        seconds: list[float] = []
        for seed in seeds:
            batches = pipeline.training(training, size=size, batch_size=batch_size, seed=seed)
            model = _trained(name, seed, iter(batches), options.steps, seconds)
            answers = (model.choice.decode(model(batch)) for batch in held_out)
            pairs = zip(held_out, answers, strict=True)
            errors.append(np.mean([_error(batch, answer) for batch, answer in pairs]))
        print(f"| {name} | " + " | ".join(f"{error:.4f}" for error in errors), end="")
        print(f" | {np.median(seconds):.3f} |", flush=True)


def _trained(name: str, seed: int, batches, steps: int, seconds: list[float]) -> SpecularModel:
    choice = CHOICES[name]
    keras.utils.set_random_seed(seed)
    with computing_in(choice.precision):
        network = SUBNETWORKS["specular"].build(
            dataclasses.replace(PRESETS["smoke"], unet_width=choice.width)
        )
    for layer in network.layers:
        if isinstance(layer, keras.layers.Conv2D) and layer.name != "head":
            start = keras.initializers.get(choice.initialiser)
            layer.kernel.assign(start(layer.kernel.shape))
    model = SpecularModel(network, choice)
    optimizer = keras.optimizers.Adam(SCHEDULES["smoke"].single_learning_rate)
    if choice.precision == "float16":
        optimizer = keras.optimizers.LossScaleOptimizer(optimizer)
    model.compile(optimizer=optimizer)
    for _ in tqdm(range(steps), desc=f"{name}, seed {seed}", file=sys.stderr):
        batch = next(batches)
        began = time.perf_counter()
        model.train_on_batch(batch)
        seconds.append(time.perf_counter() - began)
    return model


def _error(batch: Any, linear: Any) -> float:
    """Return the masked ℓ1 between log(1 + S) of the truth and of the prediction."""
    answer = ops.log1p(ops.maximum(linear, 0.0))
    error = ops.abs(answer - ops.log1p(batch["specular_shading"]))
    return float(ops.mean(masked_mean(error, batch["mask"])))


if __name__ == "__main__":
    main()
