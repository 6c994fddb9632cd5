"""Files that are whole or not there."""

import os
from pathlib import Path


def write(path: Path, content: bytes) -> None:
    """Write a file, and its folders, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"partial-{path.name}")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
