"""Resuming: how a folder was begun, and the shards that are finished."""

import json
import os
import uuid
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, untrusted


def read_description(path: Path) -> dict[str, Any] | None:
    """Return the description with which a folder was begun; None for a new folder.

    Raises:
        ValueError: if the description cannot be read.
    """
    if not path.is_file():
        return None
    with untrusted.naming(path, "a description", f"remove {path.parent} to render anew"):
        return untrusted.read_json(path)


def sidecar(path: Path) -> dict[str, Any]:
    """Return the sidecar of a finished shard.

    Raises:
        ValueError: if the file is missing, or is not the record of a finished shard.
    """
    mend = "delete it, and run the same command again"
    with untrusted.naming(path, "the record of a finished shard", mend):
        content = untrusted.read_json(path)
        kinds = [type(content[name]) for name in ("failures", "packages")]
        if kinds != [list, dict] or "sha256" not in content:
            raise ValueError("a part is missing")
    return content


def write_json(path: Path, value: Any, *, shared: bool = False) -> None:
    """Write a JSON file completely or not at all; `shared` as for `atomic.replacing`."""
    atomic.write(path, json.dumps(value, indent=1) + "\n", shared=shared)


def claim(path: Path, value: Any) -> None:
    """Write a JSON file unless it is there; of several processes that try at once, one does."""
    own = path.with_name(f"partial-{uuid.uuid4().hex}-{path.name}")
    write_json(own, value)
    try:
        os.link(own, path)
    except OSError:  # it is there, or the file system has no links
        if not path.exists():
            os.replace(own, path)
    own.unlink(missing_ok=True)
