"""A corpus on disk: `CORPUS/SPLIT/{00000.tfrecord, …, manifest.json}`, read through a `Split`."""

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SPLITS = ("train", "test")


@dataclass(frozen=True)
class Split:
    """One half of a corpus: where its files lie and, once it is complete, what they hold.

    The manifest is read once, when something of it is first asked for. Every property that needs it
    raises FileNotFoundError if the split was not rendered, or not to the end, and ValueError if the
    file is broken.

    Attributes:
        corpus: folder that `lime-render` wrote.
        name: `train` or `test`.
    """

    corpus: Path
    name: str

    @property
    def folder(self) -> Path:
        """Holds all files of the split."""
        return Path(self.corpus) / self.name

    @property
    def manifest_path(self) -> Path:
        """File that records how the split was rendered; written when it is complete."""
        return self.folder / "manifest.json"

    @property
    def description_path(self) -> Path:
        """File that records what the split is to be; written before anything is rendered."""
        return self.folder / "description.json"

    @property
    def inputs_path(self) -> Path:
        """File that records what was found in the user's files, beside the description."""
        return self.folder / "inputs.json"

    def shard_path(self, shard: int) -> Path:
        """File of one shard."""
        return self.folder / f"{shard:05d}.tfrecord"

    def sidecar_path(self, shard: int) -> Path:
        """File beside a shard that vouches for it."""
        return self.shard_path(shard).with_suffix(".json")

    @functools.cached_property
    def manifest(self) -> dict[str, Any]:
        """All that is recorded of the complete split."""
        path = self.manifest_path
        if not path.is_file():
            raise FileNotFoundError(
                f"{path} is missing: `lime-render {self.corpus} --split {self.name} --count N` "
                "renders the split, or completes it where it was interrupted"
            )
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(
                f"{path} is broken ({error}): delete it and run the same `lime-render` command "
                "again"
            ) from error

    def shard_paths(self) -> list[Path]:
        """Files of all shards of the complete split, in order.

        Raises:
            FileNotFoundError: if the split is incomplete or a shard is missing.
            ValueError: if the manifest is broken.
        """
        paths = [self.shard_path(shard) for shard in range(self._recorded("shards", int))]
        for path in paths:
            if not path.is_file():
                raise FileNotFoundError(
                    f"{path} is missing: run the same `lime-render` command again"
                )
        return paths

    @property
    def count(self) -> int:
        """Number of examples."""
        return self._recorded("examples", int)

    @property
    def sha256(self) -> list[str]:
        """Checksums of the shards, in order."""
        return self._recorded("sha256", list)

    @property
    def inputs(self) -> dict[str, dict[str, str]]:
        """Names and checksums of the user's files that were used, by kind."""
        return self._recorded("inputs", dict)

    @property
    def shard_size(self) -> int:
        """Examples in each shard but the last."""
        return self._checked(self._description.get("shard_size"), int)

    @property
    def size(self) -> int | None:
        """Height and width of the images in pixels; None of a corpus that does not tell."""
        return self._description.get("size")

    @property
    def shading(self) -> str:
        """`furnace`, or `literal` if D and S are stored as Eqs. 2 and 3 are printed."""
        return self._description.get("shading", "furnace")

    @property
    def is_literal(self) -> bool:
        """Whether D and S are stored as Eqs. 2 and 3 are printed."""
        return self.shading == "literal"

    @property
    def _description(self) -> dict[str, Any]:
        return self._checked(self._checked(self.manifest, dict).get("description", {}), dict)

    def _recorded(self, name: str, kind: type) -> Any:
        return self._checked(self._checked(self.manifest, dict).get(name), kind)

    def _checked(self, value: Any, kind: type) -> Any:
        """The value, if it is what a manifest holds in its place."""
        if not isinstance(value, kind):
            raise ValueError(
                f"{self.manifest_path} is no manifest of `lime-render`: render the split again"
            )
        return value
