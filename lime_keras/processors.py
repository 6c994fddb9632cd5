"""The processors that this process may use, which may be fewer than the machine has."""

import math
import os
from collections.abc import Iterator
from pathlib import Path

_GROUPS, _MEMBERSHIP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
_TOPOLOGY = Path("/sys/devices/system/cpu")


def count() -> int:
    """Return how many cores this process may keep busy at once, at least 1.

    Two threads of one core count as one. `taskset` and a batch system's affinity, and the quota of
    a control group, as containers and `systemd` set it, lower the number.
    """
    if not hasattr(os, "sched_getaffinity"):
        return os.cpu_count() or 1
    cores = len({core(number) for number in os.sched_getaffinity(0)})
    return max(1, min([cores, *map(math.ceil, _quotas())]))


def core(number: int) -> str:
    """Return what processor `number` has in common with the other threads of its core."""
    try:
        return (_TOPOLOGY / f"cpu{number}/topology/thread_siblings_list").read_text()
    except OSError:
        return str(number)


def _quotas() -> Iterator[float]:
    """Yield the processors that this process's control groups, and those above them, allow."""
    try:
        lines = _MEMBERSHIP.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, kinds, inside = line.split(":", 2)
        if kinds and "cpu" not in kinds.split(","):
            continue
        root = _GROUPS / "cpu" if kinds else _GROUPS  # version 1, or 2
        group = root / inside.strip("/")
        for folder in (group, *group.parents):
            yield from _quota(folder)
            if folder == root:
                break


def _quota(folder: Path) -> Iterator[float]:
    """Yield the processors that one control group allows, if it limits them."""
    try:
        if (folder / "cpu.max").exists():
            quota, period = (folder / "cpu.max").read_text().split()
        else:
            quota = (folder / "cpu.cfs_quota_us").read_text()
            period = (folder / "cpu.cfs_period_us").read_text()
        if float(quota) > 0:
            yield float(quota) / float(period)
    except (OSError, ValueError):  # no such file, or "max"
        return
