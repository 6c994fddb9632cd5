"""A cache of results on disk: each result is kept with its key, and made again if the key changes.

A result may depend on any line of this package and on any package that it computes with. Every key
therefore holds a hash of the source and the versions of these packages, beside the inputs that the
caller names (weights, data, options). An edit so discards also results that it does not affect,
timings among them: measuring again is slow, but reusing an outdated number is wrong.
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

from lime_keras.io import atomic, incoming
from lime_keras.version import installed

DependsOn = Mapping[str, Any]
"""The inputs of a result, as JSON; the result is reused while they are the same."""

_COMPUTING = ("train", "render")
"""Extras of the installation whose packages compute."""
_PACKAGES = ("lime_keras", "lime_keras.render", "lime_keras.train", "lime_keras.eval")


class Store:
    """A folder of cached results, each of them complete or absent.

    Every result is kept with its inputs (`depends_on`) and with the `code` that made it:
    `source_hash()` and `package_versions()`. The result is reused while all of them are the same.

    Args:
        folder: folder of the results; it is created with the first of them.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._code = {"source": source_hash(), "packages": package_versions()}

    def value(self, name: str, depends_on: DependsOn, make: Callable[[], Any]) -> Any:
        """Return a JSON result: read from `folder/name.json`, or made by `make` and kept there."""
        path = self._folder / f"{name}.json"
        known = _read(path)
        if known is not None and self._is_of(known, depends_on):
            return known["result"]
        result = make()
        _write(path, {**self._key(depends_on), "result": result})
        return _as_read(result)

    def file(self, name: str, depends_on: DependsOn, make: Callable[[Path], None]) -> Path:
        """Return the path of `folder/name`, a file or folder that `make` writes if it is not kept.

        Args:
            name: path below the store's folder.
            depends_on: inputs of the result.
            make: function that writes the file or folder to the path that it is given.
        """
        path = self._folder / name
        record = _record(path)
        known = _read(record)
        if path.exists() and known is not None and self._is_of(known, depends_on):
            return path
        with atomic.replacing(path) as partial:
            make(partial)
            # The old record goes before the new file comes, so no record describes a wrong file.
            record.unlink(missing_ok=True)
        _write(record, self._key(depends_on))
        return path

    def arrays(
        self, name: str, depends_on: DependsOn, make: Callable[[], Mapping[str, np.ndarray]]
    ) -> dict[str, np.ndarray]:
        """Return arrays by name, read from `folder/name.npz`, or made by `make` and kept there.

        The arrays hold numbers, truth values or text.
        """

        def write(path: Path) -> None:
            arrays: Any = make()
            with path.open("wb") as file:
                np.savez(file, **arrays)

        path = self.file(f"{name}.npz", depends_on, write)
        try:
            return _read_arrays(path)
        except (OSError, EOFError, ValueError, zipfile.BadZipFile):
            # The file was damaged after it was written.
            _record(path).unlink()
            return _read_arrays(self.file(f"{name}.npz", depends_on, write))

    def _key(self, depends_on: DependsOn) -> dict[str, Any]:
        return {"depends_on": depends_on, "code": self._code}

    def _is_of(self, known: Mapping[str, Any], depends_on: DependsOn) -> bool:
        key = _as_read(self._key(depends_on))
        return all(known.get(part) == value for part, value in key.items())


def sha256(*paths: Path) -> str:
    """Return one SHA-256 hash of the contents of all files, in the given order."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def size(path: Path) -> int:
    """Return the number of bytes in a file, or in all files of a folder."""
    inside = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in inside if file.is_file())


@functools.cache
def package_versions() -> dict[str, str | None]:
    """Return the versions of the packages that compute, by name: required ones and some extras'."""
    asked = [
        one
        for one in metadata.requires("lime-keras") or ()
        if "extra ==" not in one or any(f'extra == "{extra}"' in one for extra in _COMPUTING)
    ]
    names = [re.split(r"[^\w.-]", one, maxsplit=1)[0] for one in asked]
    return installed(names)


@functools.cache
def source_hash() -> str:
    """Return `hash_of_source` of this package: library, renderer, training and evaluation."""
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
    """Return one hash of the names and contents of all Python files of some packages.

    A wheel has the same hash as the checkout it was built from, although the wheel holds the other
    packages inside the folder of `lime_keras`.

    Args:
        folders: folders of the packages, by dotted name.
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
    """Return the path of the JSON file, beside a file or folder, that holds its key."""
    return path.with_name(f"{path.name}.json")


def _read(path: Path) -> dict[str, Any] | None:
    """Return the content of a JSON file, or None if it is missing or not JSON."""
    try:
        return incoming.read_json(path)
    except ValueError:
        return None


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file, np.load(file) as stored:
        return dict(stored)


def _as_read(content: Any) -> Any:
    """Return the content as it comes back from JSON: tuples become lists."""
    return json.loads(json.dumps(content))


def _write(path: Path, content: Any) -> None:
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
