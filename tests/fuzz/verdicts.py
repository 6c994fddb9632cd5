"""The verdict on one input: read, refused by name, or fallen through, and why."""

import os
import traceback
from dataclasses import dataclass
from pathlib import Path

from lime_keras import console

from .doors import Door

READ, REFUSED, FELL = "read", "refused by name", "fell through"
KINDS = (READ, REFUSED, FELL)


@dataclass(frozen=True)
class Limits:
    """The limits of reading one input.

    Attributes:
        seconds: time that it may take, but for what it waits while others have the processor.
        bytes: memory that it may take beside what the process holds already.
    """

    seconds: float = 10.0
    bytes: int = 2 << 30


LIMITS = Limits()  # the limits of the command


@dataclass(frozen=True)
class Verdict:
    """What became of an input.

    Attributes:
        kind: one of `KINDS`.
        reason: what was said, or why it fell through; empty if it was read.
    """

    kind: str
    reason: str = ""


def judged(door: Door, folder: Path, limits: Limits) -> Verdict:
    """Read an input in this process and judge how that ended.

    Args:
        door: what reads it.
        folder: folder that holds the input and nothing else.
        limits: limits of memory; those of time are the parent's to watch.
    """
    before = resident()
    is_known = _forget_peak()
    try:
        door.read(folder)
    except Exception as error:
        verdict = _of_error(error, folder, door.is_named)
    except BaseException as error:  # whatever ends a command without a word
        verdict = Verdict(FELL, _told(error))
    else:
        verdict = Verdict(READ)
    taken = (_peak() if is_known else resident()) - before
    if taken > limits.bytes and verdict.kind != FELL:
        return Verdict(FELL, f"took {taken / 2**30:.1f} GB of memory; else {verdict}")
    return verdict


def _of_error(error: Exception, folder: Path, is_named: bool) -> Verdict:
    said = console.message(error)
    if said is None:
        return Verdict(FELL, f"no command expects this error\n{_told(error)}")
    # Any file of the input will do: a manifest and a shard that disagree accuse each other.
    if is_named and f"{folder}{os.sep}" not in said:
        return Verdict(FELL, f"refused without the file's name\n{_told(error)}")
    return Verdict(REFUSED, said)


def _told(error: BaseException) -> str:
    return "".join(traceback.format_exception(error))


def resident(pid: int | str = "self") -> int:
    """Return the bytes of memory that a process holds; 0 if it has ended."""
    try:
        pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    except (OSError, IndexError):
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def queued(pid: int | str = "self") -> float:
    """Return the seconds that a process stood ready while others had the processor; 0 if unknown.

    Of its main thread, from its start.
    """
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError):
        return 0.0


def _forget_peak() -> bool:
    """Let `_peak` count from now on; return whether that is allowed, as not in every container."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return False
    return True


def _peak() -> int:
    """Return the most memory that this process held since `_forget_peak`, in bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) << 10
    return 0
