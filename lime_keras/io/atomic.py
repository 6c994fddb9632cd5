"""Atomic writing: a file or folder is there completely, or not at all."""

import contextlib
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replacing(path: Path, *, shared: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and move what was written there to `path` at the end.

    The block writes a file or a folder to the temporary path. Missing parent folders are made, and
    the rest of an earlier interrupted write is removed first. If the block fails, the temporary
    path and the parent folders made for it are removed, and `path` stays as it was. A file is
    replaced in one step; a folder is removed just before the new one takes its name.

    Args:
        path: path of the file or folder to replace.
        shared: whether several processes may write `path` at once. Then each process has its own
            temporary path, and the last process to finish wins. The caller has to remove what a
            killed process left (`partial-*`).
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
            with contextlib.suppress(OSError):  # another process has written there meanwhile
                parent.rmdir()
        raise


def write(path: Path, content: bytes | str, *, shared: bool = False) -> None:
    """Write a file completely or not at all; make its missing folders.

    Args:
        path: path of the file.
        content: whole content of the file; text is written as UTF-8.
        shared: whether several processes may write `path` at once (see `replacing`).
    """
    with replacing(path, shared=shared) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


def remove(path: Path) -> None:
    """Remove a file, or a folder with its content; do nothing if `path` does not exist."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
