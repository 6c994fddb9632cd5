"""Locks of folders against a second process that writes there."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def lock_folder(folder: Path, work: str, *, shared: bool = False) -> Iterator[None]:
    """Lock a folder against a second process; the lock ends with this process, if it is killed.

    Missing folders are made, and removed at the end if nothing was written there.

    Args:
        folder: the folder.
        work: who does what to it, for the message: `lime-render is rendering`.
        shared: whether others that pass it may lock the folder, too.

    Raises:
        RuntimeError: if another process has locked the folder.
    """
    created = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_NB | (fcntl.LOCK_SH if shared else fcntl.LOCK_EX))
    except BlockingIOError as error:
        os.close(handle)
        raise RuntimeError(f"another {work} {folder}: wait for it") from error
    except OSError:  # some network file systems cannot lock folders
        pass
    try:
        yield
    finally:
        for path in created:
            with contextlib.suppress(OSError):  # something is in it
                path.rmdir()
        os.close(handle)
