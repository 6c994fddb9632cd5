"""The base of the descriptions of corpora and banks, and of the jobs that render them."""

import abc
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from ..mitsuba_setup import variants
from ..scene import environments, sources
from ..shapes import meshes
from . import inputs


@dataclasses.dataclass(frozen=True)
class Description:
    """A description: everything that the bytes of a job depend on, apart from the software.

    A subclass has more fields, among them the user's folders: `inputs.KINDS`, each a path or None
    for the built-in kind.

    Attributes:
        split: `train` or `test`.
        count: number of examples or entries.
        seed: seed of everything random; 0 is a valid seed.
        size: height and width in pixels.
        shard_size: number of examples or entries in a shard.
    """

    split: str
    count: int
    seed: int
    size: int
    shard_size: int

    @property
    def shards(self) -> int:
        """The number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Return the indices of what is in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))

    def folder(self, kind: str) -> Path | None:
        """Return the user's folder of a kind of `inputs.KINDS`; None for the built-in kind."""
        folder = getattr(self, kind)
        return Path(folder) if folder else None

    def split_of(self, kind: str) -> str:
        """Return the split whose files of a kind of `inputs.KINDS` are used."""
        return self.split

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON.

        Folders are stored by name alone: their place on this machine changes no byte.
        """
        record = dataclasses.asdict(self)
        for kind in inputs.KINDS:
            folder = self.folder(kind)
            record[kind] = folder.name if folder else None
        return record

    def files(self) -> dict[str, list[Path]]:
        """Return the user's files for the split, by kind; an empty list for a built-in kind.

        Raises:
            ValueError: if a folder is missing or holds too few files.
        """
        extensions = {"shapes": meshes.EXTENSIONS, "environments": environments.EXTENSIONS}
        found = {
            kind: sources.files(folder, self.split_of(kind), known) if folder else []
            for kind, known in extensions.items()
            for folder in [self.folder(kind)]
        }
        return found | {
            "backgrounds": sources.BackgroundSource(self.folder("backgrounds")).pictures()
        }


@dataclasses.dataclass(frozen=True)
class Job(abc.ABC):
    """A job of rendering, as a worker needs it.

    Attributes:
        kind: what is rendered, in a word.
        manifest: name of the manifest's file.
        out: folder of the corpus or bank.
        description: description of what is rendered.
        choice: variant and library of Mitsuba.
        usable: names of the user's files to use, by kind; None if the folder is to be listed, or if
            the kind is built in.
    """

    kind: ClassVar[str]
    manifest: ClassVar[str]

    out: Path
    description: Description
    choice: variants.Choice
    usable: Mapping[str, tuple[str, ...] | None] = dataclasses.field(
        default_factory=lambda: dict.fromkeys(inputs.KINDS)
    )

    @property
    def folder(self) -> Path:
        """The folder that the job claims, and in which it records what it does."""
        return self.out

    @abc.abstractmethod
    def shard_files(self, shard: int) -> tuple[Path, ...]:
        """Return the paths of a shard's files; the last is its sidecar, which is written last."""

    @property
    def manifest_path(self) -> Path:
        """The file that is written last, when everything is rendered."""
        return self.folder / self.manifest

    @property
    def description_path(self) -> Path:
        """The file of the description; written before anything is rendered."""
        return self.folder / "description.json"

    @property
    def inputs_path(self) -> Path:
        """The file that records what was found in the user's files."""
        return self.folder / "inputs.json"

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        """The source of the backgrounds."""
        return sources.BackgroundSource(
            self.description.folder("backgrounds"), self.usable["backgrounds"]
        )

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON."""
        return self.description.recorded()

    def missing(self) -> list[int]:
        """Return the numbers of the shards of which a file is missing."""
        return [
            shard
            for shard in range(self.description.shards)
            if not all(path.is_file() for path in self.shard_files(shard))
        ]
