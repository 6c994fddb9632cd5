"""The rate at which scenes are made from a bank, and the cost of each part.

    python benchmarks/synthesis_rate.py BANK [--corpus CORPUS]
    KERAS_BACKEND=jax python benchmarks/synthesis_rate.py BANK --batch 64

Each row takes one part of the work away from the whole; the difference is the part's cost. Drawing
and reading happen on the host, all else on the device. With a corpus, the last row reads stored
records instead. Times are wall-clock, in one run.
"""

import argparse
import functools
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import keras
import numpy as np

from lime_keras.data.features import LEARNT_FROM
from lime_keras.synthesis import backdrop, scenes
from lime_keras.synthesis.scenes import Scenes

LEAST_SECONDS = 4.0


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("bank", type=Path)
    options.add_argument("--corpus", type=Path)
    options.add_argument("--size", type=int, default=128)
    options.add_argument("--batch", type=int, default=16)
    arguments = options.parse_args()
    print(
        f"{keras.backend.backend()}, {len(os.sched_getaffinity(0))} cores, {arguments.size}², "
        f"batches of {arguments.batch}\n\n| | ms a scene | scenes/s |\n|---|---:|---:|"
    )
    source = _source(arguments)
    draws = [source.draw(0, np.arange(k, k + arguments.batch)) for k in (0, 1000)]
    _row(
        "drawn and read on the host", lambda: source.draw(0, np.arange(arguments.batch)), arguments
    )
    _row(
        "made on the device",
        functools.partial(_waited, functools.partial(source.make, draws[0])),
        arguments,
    )
    for title, module, name, replacement in PARTS:
        with mock.patch.object(module, name, replacement):
            without = _source(arguments)
            make = functools.partial(without.make, draws[0])
            _row(f"… without {title}", functools.partial(_waited, make), arguments)
    if arguments.corpus:
        from lime_keras.data import pipeline

        shards, _ = pipeline.training_shards(arguments.corpus)
        dataset = iter(
            pipeline.training(
                shards,
                size=arguments.size,
                batch_size=arguments.batch,
                seed=0,
                flips=True,
                repaints=True,
            )
        )
        _row("read from records instead", lambda: next(dataset), arguments)


def _source(arguments: argparse.Namespace) -> Scenes:
    return Scenes(arguments.bank, size=arguments.size, camera=True, features=LEARNT_FROM)


def _dark(maps: Any, light: Any) -> Any:
    """Return furnaces in place of mixed lights."""
    return keras.ops.ones((light.weights.shape[0], *maps.shape[1:])) * 0.4


def _unlit(normal: Any, *_: Any) -> tuple[Any, Any, Any]:
    """Return grey layers in place of D, S and M."""
    grey = normal[:, 0, ..., 2:]
    return grey, grey, grey


def _grey(textures: Any, radiance: Any, rotation: Any, camera: Any, size: int, _: Any) -> Any:
    """Return grey backgrounds."""
    return keras.ops.ones((camera.shape[0], size, size, 3)) * 0.3


def _unphotographed(radiance: Any, scene: Mapping[str, Any], _: Any) -> dict[str, Any]:
    """Return the light itself in place of photos."""
    return {**scene, "image": radiance, "clipped": radiance}


PARTS = (
    ("mixing the lights", scenes, "mixed", _dark),
    ("D, S and M", scenes, "layers", _unlit),
    ("backgrounds", backdrop, "background", _grey),
    ("the camera", scenes, "photograph", _unphotographed),
)
"""Title of each part, module and name of its function, and what takes its place."""


def _waited(make: Callable[[], Mapping[str, Any]]) -> None:
    """Make a batch, and wait until the device has done it."""
    for value in make().values():
        np.asarray(value)


def _row(title: str, work: Callable[[], Any], arguments: argparse.Namespace) -> None:
    """Print the time of some work, the median of several times after a first one."""
    work()
    times: list[float] = []
    while sum(times) < LEAST_SECONDS:
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    seconds = float(np.median(times)) / arguments.batch
    print(f"| {title} | {seconds * 1000:.2f} | {1 / seconds:.0f} |", flush=True)


if __name__ == "__main__":
    main()
