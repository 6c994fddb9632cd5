"""Checks of files that come in: their kind, their size, and whatever their readers raise."""

import contextlib
import hashlib
import json
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LARGEST_JSON = 64 * 2**20
"""Largest number of bytes of a JSON file; read, it takes some ten times this memory."""
_LONGEST = 200  # longest part of a reader's message that is quoted, in characters
_CHANNELS = 4  # channels of a picture of the largest size; a smaller picture may have more
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def check(path: Path, what: str) -> None:
    """Raise ValueError unless a path is a regular file: a pipe would be waited for without end.

    Args:
        path: path of the file.
        what: what it is read as, for the message: `a picture`.
    """
    refused = f"{path} cannot be read as {what}"
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"{refused} ({reason}): check the path") from error
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "no file")
        raise ValueError(f"{refused}, it is {kind}: pass a file")
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise ValueError(f"{refused}, its name is not UTF-8: rename it") from error


def check_size(path: Path, width: int, height: int, channels: int, largest: int) -> None:
    """Raise ValueError if a picture is too large to be decoded.

    Args:
        path: path of the picture, for the message.
        width: its width in pixels, by its header.
        height: its height in pixels.
        channels: its number of channels.
        largest: largest number of pixels to decode; of more than four channels, fewer are allowed.
    """
    if width * height > largest:
        raise ValueError(
            f"{path} has {width}×{height} pixels, more than the {largest // 10**6} million that "
            "are taken: make it smaller first"
        )
    if width * height * channels > largest * _CHANNELS:
        raise ValueError(
            f"{path} has {channels} channels of {width}×{height} pixels, more than the "
            f"{largest * _CHANNELS // 10**6} million values that are taken: leave some out"
        )


@contextlib.contextmanager
def naming(path: Path, what: str, mend: str = "") -> Iterator[None]:
    """Turn whatever a reader raises into a ValueError that names the file.

    Args:
        path: path of the file.
        what: what it is read as, for the message: `a picture`.
        mend: what to do about it, for the end of the message, if the reason does not say so.

    Raises:
        ValueError: in place of any other error of the block.
        MemoryError: if the file does not fit into memory; the message names it, too.
    """
    try:
        yield
    except MemoryError as error:
        raise MemoryError(
            f"{path} does not fit into this machine's memory: make it smaller, or close other "
            "programs"
        ) from error
    except Exception as error:  # readers of many formats raise whatever a byte leads them to
        if isinstance(error, ValueError) and str(error).startswith(str(path)):
            first, *others = str(error).removeprefix(str(path)).splitlines()
            if not others:
                raise
            raise ValueError(f"{path}{' '.join((first, *map(str.strip, others)))}") from error
        lines = dict.fromkeys(" ".join(line.split()) for line in str(error).splitlines())
        reason = " ".join(filter(None, lines))[:_LONGEST] or type(error).__name__
        if path.is_file() and not path.stat().st_size:
            reason = "it is empty" if mend else "it is empty; copy or make it again"
        raise ValueError(
            f"{path} cannot be read as {what}: {'; '.join(filter(None, (reason, mend)))}"
        ) from error


def read_json(path: Path) -> Any:
    """Return the object in a JSON file.

    Raises:
        ValueError: if there is no such file, or it is too large, too deep, no JSON or no
            object; the message has the reason alone, and the caller adds what to do.
    """
    check(path, "JSON")
    if (size := path.stat().st_size) > LARGEST_JSON:
        raise ValueError(f"it has {size} bytes, more than {LARGEST_JSON}")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(content, dict):
        raise ValueError("it holds no JSON object")
    return content


def json_or_none(path: Path) -> Any:
    """Return the object in a JSON file; None if the file is missing, broken or of another kind."""
    try:
        return read_json(path)
    except ValueError:
        return None


def sha256(path: Path) -> str:
    """Return the SHA-256 checksum of a file, which is read in parts."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
