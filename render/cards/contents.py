"""The complete parts of a folder, as cards describe them: splits of a corpus, or a bank."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import SPLITS, Split
from lime_keras.synthesis import bank

BANK = "bank"
"""Name of a bank's only part."""


@dataclass(frozen=True)
class Part:
    """A part of a folder: a complete split, or a bank.

    Attributes:
        name: `train`, `test` or `BANK`.
        count: number of examples, or of a bank's G-buffers.
        description: what its bytes depend on, as the manifest records it.
        shapes: names of its shapes.
        lights: number of its lights; None where the manifest does not say.
        inputs: names and checksums of the user's files, by kind.
        packages: versions that it was made with, by package.
        files: SHA-256 of each file, by path below the folder.
    """

    name: str
    count: int
    description: Mapping[str, Any]
    shapes: tuple[str, ...]
    lights: int | None
    inputs: Mapping[str, Mapping[str, str]]
    packages: Mapping[str, str]
    files: Mapping[str, str]

    @property
    def is_built_in(self) -> bool:
        """True if no file of a user is in it, not even through a bank."""
        return not any(self.inputs.values()) and BANK not in self.description


def read(folder: Path) -> list[Part]:
    """Return the complete parts of a folder; none if nothing is complete.

    Raises:
        ValueError: if a manifest is broken.
    """
    if bank.is_bank(folder):
        held = bank.manifest(folder)
        return [_part(BANK, held["count"], held, held["files"])]
    splits = [Split(folder, name) for name in SPLITS]
    return [
        _part(split.name, split.count, split.manifest, _shards(split))
        for split in splits
        if split.manifest_path.is_file()
    ]


def _shards(split: Split) -> dict[str, str]:
    return {
        f"{split.name}/{split.shard_path(number).name}": digest
        for number, digest in enumerate(split.sha256)
    }


def _part(name: str, count: int, held: Mapping[str, Any], files: Mapping[str, str]) -> Part:
    return Part(
        name=name,
        count=count,
        description=held["description"],
        shapes=tuple(held["shapes"]),
        lights=len(held["lights"]) if "lights" in held else None,
        inputs=held["inputs"],
        packages=held["packages"],
        files=files,
    )
