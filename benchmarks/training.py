"""The training speed of each stage: examples a second by preset and by how a step is computed.

    python benchmarks/training.py [--presets smoke live] [--steps 8] [--batch-size 32]
    python benchmarks/training.py --corpus CORPUS [--photos 512] [--presets live]

The batches are random and already in memory, so reading costs nothing here. With a corpus, a
stage's photos are made; steps on batches of them take turns with steps on one batch in memory.
The settings of a stage take turns step by step, so that a busy moment slows all of them alike.
Speeds follow from the median time of a step; `--processor-time` counts what the process computed,
for one thread on a machine that others use too. `split given` is a step whose dichromatic split was
computed before, `not watched` one whose gradients' norms are not.
"""

import argparse
import functools
import statistics
import sys
import tempfile
import time
import unittest.mock
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import keras
import numpy as np
from tqdm import tqdm

from lime_keras.networks import PRESETS, Architecture, build
from lime_keras.networks.precision import computing_in
from lime_keras.networks.registry import DERIVED
from lime_keras.optics.dichromatic import channels
from lime_keras.optics.environment import STORED_SHAPE
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.data import Data, without_origin
from lime_keras.train.optimizer import OPTIMIZERS
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import SCHEDULES, Stage


class Setting(NamedTuple):
    """How a step is computed."""

    precision: str
    xla: bool = False
    is_split: bool = False
    is_watched: bool = True


SETTINGS = {
    "float32": Setting("float32"),
    "float32, XLA": Setting("float32", xla=True),
    "float32, split given": Setting("float32", is_split=True),
    "float32, not watched": Setting("float32", is_watched=False),
    "bfloat16": Setting("bfloat16"),
    "bfloat16, XLA": Setting("bfloat16", xla=True),
    "bfloat16, split given": Setting("bfloat16", is_split=True),
}
STAGES = ("specular", "exponent", "albedo", "specular+mirror", "specular+mirror+exponent+albedo")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--presets", nargs="+", choices=list(PRESETS), default=["smoke", "live"])
    parser.add_argument("--settings", nargs="+", choices=list(SETTINGS), default=list(SETTINGS))
    parser.add_argument("--steps", type=int, default=8)
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=list(STAGES))
    parser.add_argument("--batch-size", type=int, help="(default: the preset's)")
    parser.add_argument("--processor-time", action="store_true")
    parser.add_argument("--corpus", type=Path, help="measure the photos of this corpus")
    parser.add_argument("--photos", type=int, default=512)
    options = parser.parse_args()
    clock = time.process_time if options.processor_time else time.perf_counter
    if options.corpus is not None:
        for preset in options.presets:
            _photos(options.corpus, preset, options.photos, options.steps)
        return
    print("| preset | stage | batch | " + " | ".join(options.settings) + " |")
    print("|---|---|---:|" + "---:|" * len(options.settings))
    for preset in options.presets:
        architecture, schedule = PRESETS[preset], SCHEDULES[preset]
        size = options.batch_size or schedule.batch_size
        batch = _batch(architecture.size, size)
        for stage in schedule.stages(architecture):
            if stage.name not in options.stages:
                continue
            steps = {
                name: _step(architecture, stage, SETTINGS[name], batch) for name in options.settings
            }
            seconds = _alternately(steps, options.steps, f"{preset} {stage.name}", clock)
            rates = (f"{size / seconds[name]:.1f}" for name in options.settings)
            print(f"| {preset} | {stage.name} | {size} | ", end="")
            print(" | ".join(rates) + " |", flush=True)


def _photos(corpus: Path, preset: str, count: int, steps: int) -> None:
    """Print how fast photos are made and read, and what reading adds to a step of each stage."""
    architecture, schedule = PRESETS[preset], SCHEDULES[preset]
    config = Config(preset, 1.0, architecture, schedule, 0, corpus_sha256([corpus]), photos=count)
    print("| stage | photos made a second | read a second | step in memory | step | wait |")
    print("|---|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        for stage in schedule.stages(architecture):
            if stage.name not in STAGES:
                continue
            # Made the first time that a stage needs them.
            data = Data([corpus], config, Path(folder))
            subnetworks = build(architecture, seed=0)
            own = {name: subnetworks[name] for name in stage.subnetworks}
            model = StageModel(own, losses=schedule.losses)
            model.compile(optimizer=keras.optimizers.Adam(stage.learning_rate))
            features = data.with_input_mask(stage, model.features)
            began = time.perf_counter()
            batches = data.training(stage, features, 0)
            still = without_origin(next(batches))
            made = count / (time.perf_counter() - began)
            began = time.perf_counter()
            for _ in range(20):
                next(batches)
            read = 20 * schedule.batch_size / (time.perf_counter() - began)
            waits: list[float] = []

            def step(model: Any = model, batches: Any = batches, waits: Any = waits) -> None:
                asked = time.perf_counter()
                batch = next(batches)
                waits.append(time.perf_counter() - asked)
                model.train_on_batch(without_origin(batch))

            again = functools.partial(model.train_on_batch, still)
            actions: dict[str, Callable[[], Any]] = {"memory": again, "read": step}
            for action in actions.values():
                action()
            seconds = _alternately(actions, steps, f"{preset} {stage.name}")
            memory, whole = 1000 * seconds["memory"], 1000 * seconds["read"]
            wait = statistics.median(waits) / seconds["read"]
            print(f"| {stage.name} | {made:.0f} | {read:.0f} | {memory:.0f} ms ", end="")
            print(f"| {whole:.0f} ms | {wait:.1%} |", flush=True)


def _step(
    architecture: Architecture, stage: Stage, setting: Setting, batch: dict[str, Any]
) -> Callable[[], Any]:
    """Return a function that takes one training step, already compiled."""
    with computing_in(setting.precision):
        subnetworks = build(architecture, seed=0)
    model = StageModel({name: subnetworks[name] for name in stage.subnetworks}, losses="robust")
    if setting.is_watched:
        groups = [(name, len(one.trainable_variables)) for name, one in model.subnetworks.items()]
        optimizer = OPTIMIZERS["adam"](stage.learning_rate, groups)
    else:
        optimizer = keras.optimizers.Adam(stage.learning_rate)
    model.compile(optimizer=optimizer, jit_compile=setting.xla)
    optimizer.build(model.trainable_variables)
    seen = {name: batch[name] for name in model.features}
    given: dict[str, Any] = {}
    if setting.is_split:
        split = channels(batch["image"], batch["mask"])
        given["dichromatic"] = lambda seen: split
    with unittest.mock.patch.dict(DERIVED, given):  # the step is traced here, and so remembers it
        model.train_on_batch(seen)
    return lambda: model.train_on_batch(seen)


def _alternately(
    steps: dict[str, Callable[[], Any]],
    count: int,
    what: str,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Return the median seconds of a step, by setting."""
    seconds: dict[str, list[float]] = {name: [] for name in steps}
    for _ in tqdm(range(count), desc=what, file=sys.stderr):
        for name, step in steps.items():
            began = clock()
            step()
            seconds[name].append(clock() - began)
    return {name: statistics.median(times) for name, times in seconds.items()}


def _batch(size: int, count: int) -> dict[str, Any]:
    rng = np.random.default_rng(0)

    def uniform(*shape: int) -> Any:
        return keras.ops.convert_to_tensor(rng.uniform(size=(count, *shape)).astype(np.float32))

    image = {"image": uniform(size, size, 3), "clipped": 0.0 * uniform(size, size, 3)}
    image |= {"painted": 0.0 * uniform(size, size, 1)}
    layers = ("diffuse_shading", "specular_shading", "mirror")
    return {
        **image,
        **{name: uniform(size, size, 1) for name in layers},
        "mask": 0.0 * uniform(size, size, 1) + 1.0,
        "cast": 0.0 * uniform(4),
        "environment": uniform(*STORED_SHAPE, 1),
        "diffuse_albedo": uniform(3),
        **{name: uniform() for name in ("specular_albedo", "ambient")},
        "shininess": 1.0 + 999.0 * uniform(),
        "exponent_bin": keras.ops.convert_to_tensor(rng.integers(8, size=count).astype(np.int32)),
    }


if __name__ == "__main__":
    main()
