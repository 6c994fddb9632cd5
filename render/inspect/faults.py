"""The faults that verification finds in a split, in words and numbers."""

import collections
from pathlib import Path

_LISTED = 10


class Faults:
    """The faults of a split, gathered by kind.

    Attributes:
        examples: number of records that were read and decoded.
        kinds: number of faults of each kind.
    """

    def __init__(self) -> None:
        self.examples = 0
        self._listed: dict[str, list[str]] = {}
        self.kinds: collections.Counter[str] = collections.Counter()

    @property
    def count(self) -> int:
        """The number of faults; 0 means that the split is sound."""
        return self.kinds.total()

    def add(self, kind: str, where: Path | str, what: str) -> None:
        """Record a fault; only the first few of each kind are kept in words."""
        self.kinds[kind] += 1
        if self.kinds[kind] <= _LISTED:
            self._listed.setdefault(kind, []).append(f"{kind}: {where}: {what}")

    def lines(self) -> list[str]:
        """Return a line for each fault kept in words, and a line for the rest of each kind."""
        out = []
        for kind, listed in self._listed.items():
            out += listed
            if self.kinds[kind] > len(listed):
                out.append(f"{kind}: … and {self.kinds[kind] - len(listed)} more")
        return out
