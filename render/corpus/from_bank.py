"""A corpus of a bank's scenes: made once by the law of a bank, and read many times.

On a processor, making a scene takes as long as training on it (`benchmarks/synthesis_rate.py`), and
reading a record a third of that or less. The bytes of a shard depend on the bank, the seed and the
shard's number alone, as far as the floating-point arithmetic of the machine is the same.
"""

import hashlib
import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.data import records
from lime_keras.data.corpus import Split
from lime_keras.io import locking
from lime_keras.optics import material_law
from lime_keras.synthesis import bank
from lime_keras.synthesis.scenes import Scenes

from ..jobs import nodes, resuming
from . import shards

_PACKAGES = ("tensorflow", "keras", "numpy")
_BATCH = 16


def make_split(
    folder: Path,
    out: Path,
    *,
    count: int,
    seed: int,
    shard_size: int,
    materials: str = material_law.UNIFORM,
    tell: Callable[[int, int], None],
) -> dict[str, Any]:
    """Make the missing shards of a train split from a bank, and write its manifest.

    Args:
        folder: folder of a complete bank. Shapes and maps that it holds out are left out.
        out: folder of the corpus.
        count: number of examples.
        seed: seed of the scenes, at least 0.
        shard_size: number of examples in a shard.
        materials: a key of `material_law.LAWS`.
        tell: called with (done, total) as examples are made; those of finished shards count from
            the start.

    Returns:
        The manifest.

    Raises:
        FileNotFoundError: if the bank is incomplete.
        ValueError: if the bank is broken, or the corpus' folder holds another split.
        RuntimeError: if another process makes or renders this split.
    """
    # Describe.
    held = bank.manifest(folder)
    description = {
        "split": "train",
        "count": count,
        "seed": seed,
        "size": held["size"],
        "shard_size": shard_size,
        "shading": "furnace",
        "bank": hashlib.sha256(json.dumps(sorted(held["files"].items())).encode()).hexdigest(),
        "materials": materials,
    }
    split = Split(out, "train")
    _refuse_another(split, description)
    features = {*records.FEATURES}
    scenes = Scenes(
        folder, size=held["size"], camera=False, features=features, materials=(materials,)
    )
    # Make what is missing.
    with locking.lock_folder(split.folder, "lime-render is rendering"):
        _refuse_another(split, description)
        resuming.write_json(split.description_path, description)
        resuming.write_json(split.inputs_path, {})
        resuming.remove_partials(split.folder)
        for shard, first in enumerate(range(0, count, shard_size)):
            indices = range(first, min(first + shard_size, count))
            tell(first, count)
            files = split.shard_path(shard), split.sidecar_path(shard)
            if not all(path.is_file() for path in files):
                examples = _examples(scenes, seed, indices, tell, count)
                shards.write(split, shard, examples, _PACKAGES)
        manifest = _manifest(split, description, scenes)
        resuming.write_json(split.manifest_path, manifest)
    tell(count, count)
    return manifest


def _refuse_another(split: Split, description: dict[str, Any]) -> None:
    begun = resuming.held(split.description_path)
    resuming.refuse_another(split.folder, "split", begun, description)


def _manifest(split: Split, description: dict[str, Any], scenes: Scenes) -> dict[str, Any]:
    """Return the manifest of a complete split, put together from the sidecars of its shards."""
    count = description["count"]
    paths = map(split.sidecar_path, range(-(-count // description["shard_size"])))
    digests = [resuming.sidecar(path)["sha256"] for path in paths]
    return {
        "packages": nodes.versions(_PACKAGES),
        "description": description,
        "shards": len(digests),
        "examples": count,
        "sha256": digests,
        "failures": [],
        "shapes": scenes.shapes,
        "lights": scenes.lights,
        "inputs": {},
        "skipped": {},
        "repaired": [],
    }


def _examples(
    scenes: Scenes, seed: int, indices: range, tell: Callable[[int, int], None], total: int
) -> Iterator[bytes]:
    """Yield the serialised examples at these indices; a thread each writes their PNGs."""
    with ThreadPoolExecutor() as threads:
        for first in range(indices.start, indices.stop, _BATCH):
            # Scenes are made by whole batches, because each is compiled for one size only.
            drawn = scenes.draw(seed, np.arange(first, first + _BATCH))
            made = {name: np.asarray(value) for name, value in scenes.make(drawn).items()}
            here = range(min(_BATCH, indices.stop - first))
            examples = [{name: made[name][k] for name in records.FEATURES} for k in here]
            yield from threads.map(records.encode, examples)
            tell(first + len(here), total)
