"""Doors with a fault each, by which the command shows that it can find one."""

import ctypes
import os
import time
from pathlib import Path

from .doors import Door
from .verdicts import Limits

SOUND = b"sound\n"
LIMITS = Limits(bytes=1 << 27)
"""Limits under which they are read; all but these are those of the command."""
TOO_MANY = 3 << 26  # bytes beyond the limit


def _damaged(folder: Path) -> Path | None:
    """Return the input's file if it is damaged; as every door, these read a sound one."""
    [path] = folder.iterdir()
    return None if path.read_bytes() == SOUND else path


def _names(folder: Path) -> None:
    if path := _damaged(folder):
        raise ValueError(f"{path} is damaged: copy it again")


def _names_nothing(folder: Path) -> None:
    if _damaged(folder):
        raise ValueError("it is damaged")


def _stumbles(folder: Path) -> None:
    if _damaged(folder):
        [][0]


def _leaves(folder: Path) -> None:
    if _damaged(folder):
        raise SystemExit(0)


def _crashes(folder: Path) -> None:
    if _damaged(folder):
        ctypes.string_at(0)


def _ends(folder: Path) -> None:
    if _damaged(folder):
        os._exit(3)


def _hangs(folder: Path) -> None:
    if _damaged(folder):
        time.sleep(3600)


def _dawdles(folder: Path) -> None:
    if _damaged(folder):
        time.sleep(1)


def _swells(folder: Path) -> None:
    if _damaged(folder):
        taken = b"x" * TOO_MANY
        time.sleep(3600 + 0 * len(taken))


def _swelled(folder: Path) -> None:
    """Take too much memory for a moment, which only the process itself can see for sure."""
    if _damaged(folder):
        len(b"x" * TOO_MANY)


def _refuses_all(folder: Path) -> None:
    [path] = folder.iterdir()
    raise ValueError(f"{path} is refused whatever it holds")


DOORS = {
    read.__name__.strip("_").replace("_", "-"): Door(read, "runs", 1)
    for read in (
        *(_names, _names_nothing, _stumbles, _leaves, _crashes, _ends, _hangs),
        *(_dawdles, _swells, _swelled, _refuses_all),
    )
}


def make(folder: Path, names: tuple[str, ...]) -> None:
    """Write one seed of a few bytes for the doors, in place of `seeds.make`."""
    for name in names:
        (folder / name / "seed").mkdir(parents=True)
        (folder / name / "seed" / "sound.bin").write_bytes(SOUND)
