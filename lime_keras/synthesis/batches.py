"""Batches of scenes made from banks: for training without end, and held-out ones for validation."""

import functools
import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.optics.material_law import UNIFORM

from .scenes import Scenes

_AHEAD = 4
"""Number of batches that are drawn ahead, each in a thread of its own."""

Batch = dict[str, Any]


def training(
    folders: Sequence[Path],
    *,
    size: int,
    batch_size: int,
    seed: int,
    first_step: int = 0,
    camera: bool = True,
    features: Collection[str],
    materials: tuple[str, ...] = (UNIFORM,),
    rows: tuple[int, int] = (0, 1),
) -> Iterator[Batch]:
    """Yield batches without end; the banks and a seed determine them, from any step on.

    Each batch is of one bank; the banks take turns. Batch p holds the scenes at the positions
    p · `batch_size` and on.

    Args:
        folders: folders by `lime-render bank`.
        size: height and width of the images; a divisor of the banks'.
        batch_size: number of scenes in a batch.
        seed: seed of the scenes, at least 0.
        first_step: number of batches to skip, to resume training.
        camera: whether cameras photograph the scenes.
        features: names of the features in a batch.
        materials: laws of the materials, of `material_law.LAWS`.
        rows: (k, n): only the k-th of n equal parts of each batch, for one of n machines.

    Raises:
        FileNotFoundError: if a bank is incomplete.
        ValueError: if a bank is broken or its images do not fit; or if the batches
            cannot be divided among n machines.
    """
    part, parts = rows
    if batch_size % parts:
        raise ValueError(
            f"batches of {batch_size} cannot be divided among {parts} machines: choose a multiple "
            f"of {parts}"
        )
    sources = [
        _scenes(folder, size, camera, frozenset(features), False, materials) for folder in folders
    ]
    share = batch_size // parts

    def drawn(step: int) -> tuple[Scenes, dict[str, Any]]:
        source = sources[step % len(sources)]
        first = step * batch_size + part * share
        return source, source.draw(seed, np.arange(first, first + share))

    return _made(drawn, itertools.count(first_step))


def held_out(
    folder: Path,
    *,
    size: int,
    batch_size: int,
    count: int,
    camera: bool,
    features: Collection[str],
    materials: tuple[str, ...] = (UNIFORM,),
) -> Iterator[Batch]:
    """Yield the same batches every time, of shapes and maps that training does not see.

    Args:
        folder: folder by `lime-render bank`.
        size: height and width of the images; a divisor of the bank's.
        batch_size: number of scenes in a batch.
        count: number of batches.
        camera: whether cameras photograph the scenes.
        features: names of the features in a batch.
        materials: laws of the materials, of `material_law.LAWS`.

    Raises:
        FileNotFoundError: if the bank is incomplete.
        ValueError: if the bank is broken or its images do not fit.
    """
    source = _scenes(folder, size, camera, frozenset(features), True, materials)

    def drawn(step: int) -> tuple[Scenes, dict[str, Any]]:
        return source, source.draw(0, np.arange(step * batch_size, (step + 1) * batch_size))

    return _made(drawn, iter(range(count)))


@functools.lru_cache(maxsize=8)
def _scenes(
    folder: Path,
    size: int,
    camera: bool,
    features: frozenset[str],
    held_out: bool,
    materials: tuple[str, ...],
) -> Scenes:
    """Return the scenes of a bank; all stages of a run share them, so they are compiled once."""
    return Scenes(
        folder,
        size=size,
        camera=camera,
        features=features,
        held_out=held_out,
        materials=materials,
    )


def _made(
    drawn: Callable[[int], tuple[Scenes, dict[str, Any]]], steps: Iterator[int]
) -> Iterator[Batch]:
    """Draw the batches of the steps in threads, ahead of their use, and make and yield them."""
    with ThreadPoolExecutor(_AHEAD) as pool:
        waiting: list[Future] = [pool.submit(drawn, k) for k in itertools.islice(steps, _AHEAD)]
        try:
            while waiting:
                source, draws = waiting.pop(0).result()
                waiting += [pool.submit(drawn, step) for step in itertools.islice(steps, 1)]
                yield source.make(draws)
        finally:
            for future in waiting:
                future.cancel()
