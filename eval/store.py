"""Results on disk, each with what it follows from: what is known is not measured again.

A result may follow from any line of this package and from any package that it computes with, so
the source and the versions of these are part of every key, beside what the caller names (weights,
data, options). That also lets go of what an edit did not touch, timings among it: to measure again
is slow, an old number for a new one is wrong.
"""

import functools
import hashlib
import importlib.util
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.io import atomic

DependsOn = Mapping[str, Any]
"""What a result follows from, as JSON; a result is reused while this is the same."""

_PACKAGES = ("lime_keras", "lime_keras.render", "lime_keras.train", "lime_keras.eval")


class Store:
    """A folder of results, each whole or not there.

    Every result is kept with the `code` that made it: `source_hash()` and the versions of the
    packages that this one asks for. It is reused while both that and its own key are the same.

    Args:
        folder: made when the first result is.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._code = {"source": source_hash(), "packages": package_versions()}

    def value(self, name: str, depends_on: DependsOn, make: Callable[[], Any]) -> Any:
        """A result as JSON, out of `folder/name.json` or `make`."""
        path = self._folder / f"{name}.json"
        known = _read(path)
        if known is not None and self._is_of(known, depends_on):
            return known["result"]
        result = make()
        _write(path, {**self._key(depends_on), "result": result})
        return _as_read(result)

    def file(self, name: str, depends_on: DependsOn, make: Callable[[Path], None]) -> Path:
        """A file or folder `folder/name`, which `make` writes to the path it is given."""
        path = self._folder / name
        record = _record(path)
        known = _read(record)
        if path.exists() and known is not None and self._is_of(known, depends_on):
            return path
        with atomic.replacing(path) as partial:
            make(partial)
            # In this order a record never vouches for another's file.
            record.unlink(missing_ok=True)
        _write(record, self._key(depends_on))
        return path

    def arrays(
        self, name: str, depends_on: DependsOn, make: Callable[[], Mapping[str, np.ndarray]]
    ) -> dict[str, np.ndarray]:
        """Arrays by name, of numbers, truth values or text, out of `folder/name.npz` or `make`."""

        def write(path: Path) -> None:
            arrays: Any = make()
            with path.open("wb") as file:
                np.savez(file, **arrays)

        path = self.file(f"{name}.npz", depends_on, write)
        try:
            return _read_arrays(path)
        except (OSError, EOFError, ValueError, zipfile.BadZipFile):
            # Damaged since it was written.
            _record(path).unlink()
            return _read_arrays(self.file(f"{name}.npz", depends_on, write))

    def _key(self, depends_on: DependsOn) -> dict[str, Any]:
        return {"depends_on": depends_on, "code": self._code}

    def _is_of(self, known: Mapping[str, Any], depends_on: DependsOn) -> bool:
        key = _as_read(self._key(depends_on))
        return all(known.get(part) == value for part, value in key.items())


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


@functools.cache
def package_versions() -> dict[str, str]:
    """Versions of the packages that this one asks for: any of them may have computed."""
    asked = [one for one in metadata.requires("lime-keras") or () if "extra ==" not in one]
    names = [re.split(r"[^\w.-]", one, maxsplit=1)[0] for one in asked]
    return {name: metadata.version(name) for name in names}


@functools.cache
def source_hash() -> str:
    """`hash_of_source` of this package: library, renderer, training and evaluation."""
    specs = {name: importlib.util.find_spec(name) for name in _PACKAGES}
    return hash_of_source(
        {
            name: Path(place)
            for name, spec in specs.items()
            if spec
            for place in spec.submodule_search_locations or ()
        }
    )


def hash_of_source(folders: Mapping[str, Path]) -> str:
    """One hash of the names and contents of all Python files.

    A wheel, which holds a package inside the other's folder, has the hash of its checkout.

    Args:
        folders: of packages, by their dotted names.
    """
    files = {
        f"{package.replace('.', '/')}/{path.relative_to(folder).as_posix()}": path
        for package, folder in folders.items()
        for path in folder.rglob("*.py")
    }
    digest = hashlib.sha256()
    for name in sorted(files):
        digest.update(f"{name}\0{sha256(files[name])}\n".encode())
    return digest.hexdigest()


def _record(path: Path) -> Path:
    """File beside a file or folder that says what it follows from."""
    return path.with_name(f"{path.name}.json")


def _read(path: Path) -> dict[str, Any] | None:
    """A record, or None where there is none that can be read."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file, np.load(file) as stored:
        return dict(stored)


def _as_read(content: Any) -> Any:
    """The content as it comes back from disk: tuples as lists."""
    return json.loads(json.dumps(content))


def _write(path: Path, content: Any) -> None:
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
