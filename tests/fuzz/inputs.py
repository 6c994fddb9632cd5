"""The inputs: one of a door's seeds with one file damaged, by the run's seed and a number."""

import os
import random
import shutil
from dataclasses import dataclass
from pathlib import Path

from .mutations import mutated


@dataclass(frozen=True)
class Block:
    """Some inputs of one door, from `first` up to but without `last`."""

    door: str
    first: int
    last: int


def write(seeds: Path, seed: int, door: str, index: int, folder: Path) -> Path:
    """Write an input of a door and return the file that was damaged.

    Args:
        seeds: folder of the door's seeds.
        seed: seed of the run.
        door: name of the door.
        index: number of the input among the door's.
        folder: folder to make; the files that are not damaged are links to the seed's.
    """
    rng = random.Random(f"{seed} {door} {index}")
    source = rng.choice(sorted(seeds.iterdir()))
    hit = rng.choice(files(source))
    copy(source, folder)
    damaged = folder / hit
    data = mutated(rng, damaged.read_bytes(), damaged.name)
    damaged.unlink()
    damaged.write_bytes(data)
    return damaged


def copy(source: Path, folder: Path) -> None:
    """Make a folder of links to all files of a seed."""
    shutil.copytree(source, folder, copy_function=os.link)


def files(folder: Path) -> list[Path]:
    """Return the files of a folder, relative to it, in a fixed order."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
