"""Files and folders that are whole or not there."""

import contextlib
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replacing(path: Path, *, shared: bool = False) -> Iterator[Path]:
    """Yield a path beside `path` to write to, a file or a folder, which replaces it at the end.

    Missing parent folders are made. What an interrupted write left there is removed first. If the
    block fails, what it wrote and the parent folders made for it are removed, and what was at
    `path` stays.

    Args:
        path: of the file or folder to replace.
        shared: whether several processes may write `path` at once. Each then has a path of its
            own, and the last to finish wins; what a killed process left, `partial-*`, is the
            caller's to remove.
    """
    own = f"{uuid.uuid4().hex}-" if shared else ""
    partial = path.with_name(f"partial-{own}{path.name}")
    made = [parent for parent in path.parents if not parent.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    remove(partial)
    try:
        yield partial
        if partial.is_dir():  # no folder can be renamed onto another
            remove(path)
        os.replace(partial, path)
    except BaseException:
        remove(partial)
        for parent in made:
            with contextlib.suppress(OSError):  # another's file is in it by now
                parent.rmdir()
        raise


def write(path: Path, content: bytes | str, *, shared: bool = False) -> None:
    """Write a file, and its folders, whole or not at all; text as UTF-8.

    Args:
        path: of the file.
        content: all of it.
        shared: as for `replacing`.
    """
    with replacing(path, shared=shared) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


def remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; do nothing where neither is."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
