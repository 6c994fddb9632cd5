"""A folder that one rendering has claimed: its description, which must not change, and its lock."""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, incoming


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Lock a folder against a second process; the lock ends with this process.

    Raises:
        RuntimeError: if another process is rendering into the folder.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise RuntimeError(f"another lime-render is rendering {folder}: wait for it") from error
    except OSError:  # some network file systems cannot lock folders
        pass
    try:
        yield
    finally:
        os.close(handle)


def held(path: Path) -> dict[str, Any] | None:
    """Return the description with which a folder was begun; None for a new folder.

    Args:
        path: file of the description.

    Raises:
        ValueError: if the description cannot be read.
    """
    if not path.is_file():
        return None
    try:
        return incoming.read_json(path)
    except ValueError as error:
        raise ValueError(
            f"{path} is broken ({error}): remove {path.parent} to render anew"
        ) from error


def refuse_another(
    folder: Path, kind: str, held: dict[str, Any] | None, wanted: dict[str, Any]
) -> None:
    """Raise ValueError if a folder was begun with another description.

    Args:
        folder: the folder.
        kind: kind of thing that it holds, for the message.
        held: description with which it was begun; None for a new folder.
        wanted: description that is asked for.
    """
    if held is None:
        return
    differing = sorted(key for key in wanted | held if wanted.get(key) != held.get(key))
    if differing:
        raise ValueError(
            f"{folder} holds another {kind}: "
            + ", ".join(
                f"{key} {held.get(key)} there, {wanted.get(key)} asked" for key in differing
            )
            + ". Pass another folder, the same options, or remove it"
        )


def remove_partials(*folders: Path) -> None:
    """Remove what killed processes left in folders."""
    for folder in folders:
        for partial in folder.glob("partial-*"):
            partial.unlink(missing_ok=True)


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file completely or not at all."""
    atomic.write(path, json.dumps(value, indent=1) + "\n")
