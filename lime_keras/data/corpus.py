"""A corpus on disk: `CORPUS/SPLIT/{00000.tfrecord, …, manifest.json}`, read through a `Split`."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted

SPLITS = ("train", "test")
LOBES = ("furnace", "printed")
"""Lobes of S: normalised to the white furnace, or Eq. 3 as printed (`shading.lobe_factor`)."""


@dataclass(frozen=True)
class Split:
    """A split of a corpus on disk: the paths of its files and, once it is complete, their content.

    The manifest is read once, when a property first needs it. Every such property raises
    FileNotFoundError if the split is not rendered completely, and ValueError if the manifest is
    broken.

    Attributes:
        corpus: folder that `lime-render` wrote.
        name: `train` or `test`.
    """

    corpus: Path
    name: str

    @property
    def folder(self) -> Path:
        """The folder of the split's files."""
        return Path(self.corpus) / self.name

    @property
    def manifest_path(self) -> Path:
        """The file that records how the split was rendered; written when the split is complete."""
        return self.folder / "manifest.json"

    @property
    def description_path(self) -> Path:
        """The file that records the split's settings; written before anything is rendered."""
        return self.folder / "description.json"

    @property
    def inputs_path(self) -> Path:
        """The file that records what was found in the user's files; beside the description."""
        return self.folder / "inputs.json"

    def shard_path(self, shard: int) -> Path:
        """Return the path of a shard's file."""
        return self.folder / f"{shard:05d}.tfrecord"

    def sidecar_path(self, shard: int) -> Path:
        """Return the path of the sidecar, the file beside a shard that records its checksum."""
        return self.shard_path(shard).with_suffix(".json")

    @functools.cached_property
    def manifest(self) -> dict[str, Any]:
        """The whole record of the complete split."""
        path = self.manifest_path
        if not path.is_file():
            raise FileNotFoundError(
                f"{path} is missing: `lime-render {self.corpus} --split {self.name} --count N` "
                "renders the split, or completes it where it was interrupted"
            )
        mend = "delete it and run the same `lime-render` command again"
        with untrusted.naming(path, "a manifest", mend):
            return untrusted.read_json(path)

    def shard_paths(self) -> list[Path]:
        """Return the paths of all shards of the complete split, in order.

        Raises:
            FileNotFoundError: if the split is incomplete or a shard is missing.
            ValueError: if the manifest is broken, or its numbers contradict each other.
        """
        paths: list[Path] = []
        if self.shards != -(-self.count // self.shard_size):
            raise ValueError(
                f"{self.manifest_path} contradicts itself: {self.count} examples do not make "
                f"{self.shards} shards of {self.shard_size}; render the split again"
            )
        for shard in range(self.shards):
            paths.append(self.shard_path(shard))
            if not paths[-1].is_file():
                raise FileNotFoundError(
                    f"{paths[-1]} is missing: run the same `lime-render` command again"
                )
        return paths

    @property
    def shards(self) -> int:
        """The number of shards."""
        return self._recorded("shards", int)

    @property
    def count(self) -> int:
        """The number of examples."""
        return self._recorded("examples", int)

    @property
    def sha256(self) -> list[str]:
        """The SHA-256 checksums of the shards, in order."""
        return self._texts("sha256")

    @functools.cached_property
    def shapes(self) -> list[str]:
        """The names of the shapes."""
        return self._texts("shapes")

    @functools.cached_property
    def lights(self) -> list[str]:
        """The names of the lights."""
        return self._texts("lights")

    @property
    def inputs(self) -> dict[str, dict[str, str]]:
        """The names and checksums of the user's files that were used, by kind of file."""
        inputs = self._recorded("inputs", dict)
        for kind, of_kind in inputs.items():
            for digest in self._checked(of_kind, dict, kind).values():
                self._checked(digest, str, kind)
        return inputs

    @property
    def seed(self) -> int:
        """The seed of everything random."""
        return self._described("seed", int)

    @property
    def shard_size(self) -> int:
        """The number of examples in each shard but the last."""
        return max(1, self._described("shard_size", int))

    @property
    def size(self) -> int:
        """The height and width of the images in pixels."""
        return self._described("size", int)

    def check_size(self, size: int) -> None:
        """Raise ValueError if the images cannot be reduced to the size that networks see."""
        if self.size % size:
            raise ValueError(
                f"{self.corpus} has images of {self.size} pixels, and the networks see {size}: "
                f"pass a corpus of `lime-render --size {size}`, or of a multiple of it, or train "
                f"with a --size that divides {self.size}"
            )

    @property
    def lobe(self) -> str:
        """The lobe of S, one of `corpus.LOBES`, which decides the unit of m_s."""
        lobe = self._described("shading", str, LOBES[0])
        if lobe not in LOBES:
            raise ValueError(f"{self.folder} has a lobe {lobe}, which is not read: render it again")
        return lobe

    @property
    def is_plain(self) -> bool:
        """Whether it is drawn as a test split is: single maps, shapes as they are."""
        described = self._recorded("description", dict)
        return described.get("light_law", "maps") == "maps" and not described.get("endless")

    def _described(self, name: str, kind: type, absent: Any = None) -> Any:
        description = self._recorded("description", dict)
        return self._checked(description.get(name, absent), kind, f"description.{name}")

    def _texts(self, name: str) -> list[str]:
        return [self._checked(one, str, name) for one in self._recorded(name, list)]

    def _recorded(self, name: str, kind: type) -> Any:
        return self._checked(self.manifest.get(name), kind, name)

    def _checked(self, value: Any, kind: type, name: str) -> Any:
        """Return a value of the manifest; raise ValueError if it is not of the expected kind."""
        if not isinstance(value, kind):
            raise ValueError(
                f"{self.manifest_path} is no manifest of `lime-render`, by its {name}: render the "
                "split again"
            )
        return value
