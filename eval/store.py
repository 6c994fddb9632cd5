"""A cache of results on disk: each result is kept with its key, and made again if the key changes.

A key holds all that a result follows from: the inputs that the caller names (weights, data,
options), the code that makes it (`source_code`), and the versions of the packages that compute.
"""

import functools
import hashlib
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.io import atomic, untrusted
from lime_keras.version import installed

DependsOn = Mapping[str, Any]
"""The inputs of a result, as JSON; the result is reused while they are the same."""

_COMPUTING = ("train", "render")
"""Extras of the installation whose packages compute."""


class Store:
    """A folder of cached results, each of them complete or absent.

    Every result is kept with its inputs (`depends_on`), with the hash of the `code` that made it,
    and with `package_versions()`. The result is reused while all of them are the same.

    Args:
        folder: folder of the results; it is created with the first of them.
    """

    def __init__(self, folder: Path):
        self._folder = folder

    def value(self, name: str, depends_on: DependsOn, make: Callable[[], Any], *, code: str) -> Any:
        """Return a JSON result: read from `folder/name.json`, or made by `make` and kept there.

        Args:
            name: path below the store's folder, without its suffix.
            depends_on: inputs of the result.
            make: function that makes the result.
            code: hash of the source that `make` runs (`source_code.code_of`).
        """
        path = self._folder / f"{name}.json"
        key = _key(depends_on, code)
        known = untrusted.json_or_none(path)
        if known is not None and _is_of(known, key):
            return known["result"]
        result = make()
        _write(path, {**key, "result": result})
        return _as_read(result)

    def file(
        self, name: str, depends_on: DependsOn, make: Callable[[Path], None], *, code: str
    ) -> Path:
        """Return the path of `folder/name`, a file or folder that `make` writes if it is not kept.

        Args:
            name: path below the store's folder.
            depends_on: inputs of the result.
            make: function that writes the file or folder to the path that it is given.
            code: hash of the source that `make` runs.
        """
        path = self._folder / name
        record, key = _record(path), _key(depends_on, code)
        known = untrusted.json_or_none(record)
        if path.exists() and known is not None and _is_of(known, key):
            return path
        with atomic.replacing(path) as partial:
            make(partial)
            # The old record goes before the new file comes, so no record describes a wrong file.
            record.unlink(missing_ok=True)
        _write(record, key)
        return path

    def arrays(
        self,
        name: str,
        depends_on: DependsOn,
        make: Callable[[], Mapping[str, np.ndarray]],
        *,
        code: str,
    ) -> dict[str, np.ndarray]:
        """Return arrays by name, read from `folder/name.npz`, or made by `make` and kept there.

        The arrays hold numbers, truth values or text. The arguments are those of `value`.
        """

        def write(path: Path) -> None:
            arrays: Any = make()
            with path.open("wb") as file:
                np.savez(file, **arrays)

        path = self.file(f"{name}.npz", depends_on, write, code=code)
        try:
            return _read_arrays(path)
        except (OSError, EOFError, ValueError, zipfile.BadZipFile):
            # The file was damaged after it was written.
            _record(path).unlink()
            return _read_arrays(self.file(f"{name}.npz", depends_on, write, code=code))


def files_of(path: Path) -> list[Path]:
    """Return a file, or all files of a folder, sorted."""
    inside = path.rglob("*") if path.is_dir() else [path]
    return sorted(file for file in inside if file.is_file())


def sha256(*paths: Path) -> str:
    """Return one SHA-256 hash of the contents of all files, in the given order."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def size(path: Path) -> int:
    """Return the number of bytes in a file, or in all files of a folder."""
    return sum(file.stat().st_size for file in files_of(path))


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


def _key(depends_on: DependsOn, code: str) -> dict[str, Any]:
    return {
        "depends_on": depends_on,
        "code": {"source": code, "packages": package_versions()},
    }


def _is_of(known: Mapping[str, Any], key: Mapping[str, Any]) -> bool:
    return all(known.get(part) == value for part, value in _as_read(key).items())


def _record(path: Path) -> Path:
    """Return the path of the JSON file, beside a file or folder, that holds its key."""
    return path.with_name(f"{path.name}.json")


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file, np.load(file) as stored:
        return dict(stored)


def _as_read(content: Any) -> Any:
    """Return the content as it comes back from JSON: tuples become lists."""
    return json.loads(json.dumps(content))


def _write(path: Path, content: Any) -> None:
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
