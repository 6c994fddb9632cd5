"""The complete splits of a corpus, as cards describe them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import SPLITS, Split


@dataclass(frozen=True)
class Part:
    """A complete split.

    Attributes:
        name: `train` or `test`.
        count: number of examples.
        description: what its bytes depend on, as the manifest records it.
        shapes: names of its shapes.
        lights: number of its lights.
        inputs: names and checksums of the user's files, by kind.
        packages: versions that it was made with, by package.
        files: SHA-256 of each file, by path below the folder.
    """

    name: str
    count: int
    description: Mapping[str, Any]
    shapes: tuple[str, ...]
    lights: int
    inputs: Mapping[str, Mapping[str, str]]
    packages: Mapping[str, str]
    files: Mapping[str, str]

    @property
    def is_built_in(self) -> bool:
        """True if no file of a user is in it, not even through a bank, as corpora once had."""
        return not any(self.inputs.values()) and "bank" not in self.description


def read(folder: Path) -> list[Part]:
    """Return the complete splits of a corpus; none if nothing is complete.

    Raises:
        ValueError: if a manifest is broken.
    """
    splits = [Split(folder, name) for name in SPLITS]
    return [
        Part(
            name=split.name,
            count=split.count,
            description=split.manifest["description"],
            shapes=tuple(split.shapes),
            lights=len(split.lights),
            inputs=split.inputs,
            packages=split.manifest["packages"],
            files={
                f"{split.name}/{split.shard_path(number).name}": digest
                for number, digest in enumerate(split.sha256)
            },
        )
        for split in splits
        if split.manifest_path.is_file()
    ]
