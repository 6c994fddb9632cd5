"""Atomic writing: a file or folder is there completely or not at all, and errors name it."""

import contextlib
import errno
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

_LONGEST = 255  # largest number of bytes in a file's name, on all usual file systems
_MENDS = {
    errno.ENOSPC: "make room on its disk",
    errno.EDQUOT: "make room, the disk's quota is used up",
    errno.EFBIG: "its file system or a limit of the shell (`ulimit -f`) allows no larger file",
    errno.EACCES: "allow writing there, or pass another folder",
    errno.EPERM: "allow writing there, or pass another folder",
    errno.EROFS: "pass a folder that can be written to",
    errno.ENAMETOOLONG: "shorten its name",
    errno.EISDIR: "remove the folder of that name, or pass another",
    errno.ENOTDIR: "a file has the name of its folder: remove it, or pass another folder",
    errno.EEXIST: "a file has the name of its folder: remove it, or pass another folder",
}


@contextlib.contextmanager
def replacing(path: Path, *, shared: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and move what was written there to `path` at the end.

    The block writes a file or a folder to the temporary path. Missing parent folders are made, and
    the rest of an earlier interrupted write is removed first. If the block fails, the temporary
    path and the parent folders made for it are removed, and `path` stays as it was. A file is
    replaced in one step; a folder is moved aside just before the new one takes its name.

    Args:
        path: path of the file or folder to replace.
        shared: whether several processes may write `path` at once. Then each process has its own
            temporary path, and the last process to finish wins. The caller has to remove what a
            killed process left (`partial-*`).

    Raises:
        OSError: if the file cannot be written; the message names it and what to do.
    """
    partial = path.with_name(_partial(path.name, f"{uuid.uuid4().hex}-" if shared else ""))
    created = [parent for parent in path.parents if not parent.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        remove(partial)
        yield partial
        _take_place(partial, path)
    except BaseException as error:
        with contextlib.suppress(OSError):  # the first error is the one to report
            remove(partial)
        for parent in created:
            with contextlib.suppress(OSError):  # another process has written there meanwhile
                parent.rmdir()
        if isinstance(error, OSError) and _is_of(error, path, partial):
            raise _named(error, path) from error
        raise


def _take_place(partial: Path, path: Path) -> None:
    """Rename a finished file or folder to `path`, and remove a folder that was there before."""
    moved: list[Path] = []
    while True:
        if partial.is_dir():  # no folder can be renamed onto another
            old = path.with_name(_partial(path.name, f"old-{uuid.uuid4().hex}-"))
            with contextlib.suppress(FileNotFoundError):
                os.replace(path, old)
                moved.append(old)
        try:
            os.replace(partial, path)
            break
        except BaseException as error:
            # Another process put its folder there just now: the last one wins.
            number = error.errno if isinstance(error, OSError) and partial.is_dir() else None
            if number not in (errno.ENOTEMPTY, errno.EEXIST):
                with contextlib.suppress(IndexError, OSError):
                    os.replace(moved[-1], path)
                raise
    for old in moved:
        with contextlib.suppress(OSError):  # the new one is there: what is left does no harm
            remove(old)


@contextlib.contextmanager
def naming_writer(path: Path) -> Iterator[None]:
    """Name the file in the errors of a block that writes to it; for files that grow in place.

    Raises:
        OSError: in place of the system's errors, with the file's name and what to do.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise _named(error, path) from error


def _named(error: OSError, path: Path) -> OSError:
    """Return an error of the same kind and number that names the file that cannot be written.

    Python's own errors of a full disk name no file.
    """
    mend = _MENDS.get(error.errno or 0, "pass another folder")
    number = error.errno
    kind = type(OSError(number, ""))  # PermissionError and the like
    out = kind(f"{path} cannot be written: {error.strerror or error}; {mend}")
    out.errno = number
    return out


def _is_of(error: OSError, path: Path, partial: Path) -> bool:
    """Return whether an error is of writing `path`: it names no file, this one, or one inside."""
    if error.errno is None or error.filename is None:
        return error.errno is not None
    named = Path(os.fsdecode(error.filename))
    return not {path, partial}.isdisjoint((named, *named.parents)) or named in path.parents


def _partial(name: str, own: str) -> str:
    """Return the name for an unfinished file: of the same suffix, and no longer than allowed."""
    prefix, suffix = os.fsencode(f"partial-{own}"), os.fsencode(Path(name).suffix)
    left = _LONGEST - len(prefix) - len(suffix)
    stem = os.fsencode(name)[: len(os.fsencode(name)) - len(suffix)]
    while stem and len(stem) > left:  # a whole character at a time
        stem = os.fsencode(os.fsdecode(stem)[:-1])
    return os.fsdecode(prefix + stem + suffix)


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
