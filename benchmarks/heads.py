"""A comparison of output heads: the linear head against a sigmoid or softplus head.

    python benchmarks/heads.py CORPUS

Trains SegmentationNet (ℓ2 on the mask) and SpecularNet (masked ℓ1 on log(1 + S)) of the smoke
preset for 100 batches from three seeds. Prints the held-out loss beside the loss of a prediction of
zeros.
"""

import argparse
from pathlib import Path

import keras
from keras import ops

from lime_keras.data import pipeline
from lime_keras.networks import PRESETS, SUBNETWORKS
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES
from lime_keras.train.state import Means

STEPS, SEEDS, VALIDATION_BATCHES = 100, 3, 3
HEADS = {
    "segmentation": {"linear": None, "sigmoid": ops.sigmoid},
    "specular": {"linear": None, "softplus": ops.softplus},
}


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("corpus", type=Path)
    corpus = options.parse_args().corpus
    training, held_out = pipeline.training_shards(corpus)
    size, batch = PRESETS["smoke"].size, SCHEDULES["smoke"].batch_size
    held_out = list(pipeline.evaluation(held_out, size=size, batch_size=batch))[:VALIDATION_BATCHES]
    print("| subnetwork | head | nothing | " + " | ".join(f"seed {s}" for s in range(SEEDS)) + " |")
    print("|---|---|" + "---:|" * (SEEDS + 1))
    for name, heads in HEADS.items():
        for head, function in heads.items():
            losses = []
            for seed in range(SEEDS):
                batches = iter(
                    pipeline.training(
                        training, size=size, batch_size=batch, seed=seed, camera=False
                    )
                )
                losses.append(_train(name, function, seed, batches, held_out))
            print(f"| {name} | {head} | {_nothing(name, held_out):.3f} | ", end="")
            print(" | ".join(f"{loss:.3f}" for loss in losses) + " |", flush=True)


def _train(name, function, seed, batches, held_out) -> float:
    keras.utils.set_random_seed(seed)
    network = SUBNETWORKS[name].build(PRESETS["smoke"])
    if function is not None:
        network = keras.Model(network.input, function(network.output))
    model = StageModel({name: network})
    model.compile(optimizer=keras.optimizers.Adam(SCHEDULES["smoke"].single_learning_rate))
    for _ in range(STEPS):
        model.train_on_batch(next(batches))
    return _mean_loss(model, held_out)


def _nothing(name, held_out) -> float:
    network = SUBNETWORKS[name].build(PRESETS["smoke"])
    model = StageModel({name: keras.Model(network.input, 0.0 * network.output)})
    model.compile()
    return _mean_loss(model, held_out)


def _mean_loss(model, held_out) -> float:
    losses = Means()
    for batch in held_out:
        losses.add(model.test_on_batch(batch, return_dict=True))
    return losses.means()["loss"]


if __name__ == "__main__":
    main()
