"""Where a corpus keeps its files: `CORPUS/SPLIT/{00000.tfrecord, …, manifest.json}`."""

import json
from pathlib import Path

SPLITS = ("train", "test")


def shard_path(corpus: Path, split: str, shard: int) -> Path:
    """File of one shard."""
    return Path(corpus) / split / f"{shard:05d}.tfrecord"


def manifest_path(corpus: Path, split: str) -> Path:
    """File that records how a split was rendered; written when the split is complete."""
    return Path(corpus) / split / "manifest.json"


def read_manifest(corpus: Path, split: str) -> dict:
    """The manifest of a complete split.

    Raises:
        FileNotFoundError: if the split was not rendered, or not to the end.
        ValueError: if the file is broken.
    """
    path = manifest_path(corpus, split)
    if not path.is_file():
        raise FileNotFoundError(
            f"{path} is missing: `lime-render {corpus} --split {split} --count N` renders the "
            "split, or completes it where it was interrupted"
        )
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(
            f"{path} is broken ({error}): delete it and run the same `lime-render` command again"
        ) from error


def shard_paths(corpus: Path, split: str) -> list[Path]:
    """All shards of a complete split, in order.

    Raises:
        FileNotFoundError: if the split is incomplete or a shard is missing.
    """
    count = read_manifest(corpus, split)["shards"]
    paths = [shard_path(corpus, split, shard) for shard in range(count)]
    for path in paths:
        if not path.is_file():
            raise FileNotFoundError(f"{path} is missing: run the same `lime-render` command again")
    return paths
