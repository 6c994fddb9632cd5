"""The JSON of a result of `lime-estimate`.

Besides the numbers it holds `made`, what the result was made of and with, and `files`, the names of
all files of the result, which lie beside the JSON.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, untrusted


def write(
    path: Path, numbers: Mapping[str, Any], made: Mapping[str, Any], files: list[str]
) -> dict[str, Any]:
    """Write the JSON of a result, and return its content.

    Args:
        path: path of the JSON.
        numbers: what was estimated.
        made: what the result is made of and with (`Results.made`).
        files: names of all its files.
    """
    content = dict(numbers) | {"files": files, "made": dict(made)}
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return content


def read(path: Path) -> dict[str, Any] | None:
    """Return the content of a result's JSON, or None if the file is missing or something else."""
    try:
        content = untrusted.read_json(path)
    except (OSError, ValueError):
        return None
    made = content.get("made")
    if not isinstance(made, dict) or not isinstance(made.get("options") or {}, dict):
        return None
    if not isinstance(content.get("files"), list):
        return None
    # Nothing outside the folder is ever a file of a result, whatever the JSON says.
    content["files"] = [
        file for file in content["files"] if file == Path(str(file)).name and file not in ("", "..")
    ]
    return content
