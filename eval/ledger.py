"""Results on disk, each with what it follows from: what is known is not measured again."""

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lime_keras.io import atomic

DependsOn = Mapping[str, Any]
"""What a result follows from, as JSON; a result is reused while this is the same."""


class Ledger:
    """A folder of results, each whole or not there.

    Args:
        folder: made when the first result is.
    """

    def __init__(self, folder: Path):
        self._folder = folder

    def value(self, name: str, depends_on: DependsOn, make: Callable[[], Any]) -> Any:
        """A result as JSON, out of `folder/name.json` or `make`."""
        path = self._folder / f"{name}.json"
        known = _read(path)
        if known is not None and known["depends_on"] == _as_read(depends_on):
            return known["result"]
        result = make()
        _write(path, {"depends_on": depends_on, "result": result})
        return _as_read(result)

    def file(self, name: str, depends_on: DependsOn, make: Callable[[Path], None]) -> Path:
        """A file or folder `folder/name`, which `make` writes to the path it is given."""
        path = self._folder / name
        record = path.with_name(f"{path.name}.json")
        known = _read(record)
        if path.exists() and known is not None and known["depends_on"] == _as_read(depends_on):
            return path
        partial = path.with_name(f"partial-{path.name}")
        partial.parent.mkdir(parents=True, exist_ok=True)
        _remove(partial)
        try:
            make(partial)
            # In this order a record never vouches for another's file.
            _remove(record)
            _remove(path)
            partial.rename(path)
            _write(record, {"depends_on": depends_on})
        finally:
            _remove(partial)
        return path


def sha256(*paths: Path) -> str:
    """One hash of files, in this order."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def size(path: Path) -> int:
    """Bytes of a file, or of all in a folder."""
    inside = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in inside if file.is_file())


def _read(path: Path) -> dict | None:
    """A record, or None where there is none that can be read."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None


def _as_read(content: Any) -> Any:
    """The content as it comes back from disk: tuples as lists."""
    return json.loads(json.dumps(content))


def _write(path: Path, content: Any) -> None:
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
