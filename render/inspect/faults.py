"""What was found wrong, in words and numbers."""

import collections
from pathlib import Path

_LISTED = 10


class Faults:
    """The faults of a split, gathered by kind.

    Attributes:
        examples: how many records were read and decoded.
    """

    def __init__(self) -> None:
        self.examples = 0
        self._listed: dict[str, list[str]] = {}
        self._counts: collections.Counter[str] = collections.Counter()

    @property
    def count(self) -> int:
        """Number of faults; 0 says that the split is sound."""
        return self._counts.total()

    @property
    def kinds(self) -> dict[str, int]:
        """Number of faults of each kind."""
        return dict(self._counts)

    def add(self, kind: str, where: Path | str, what: str) -> None:
        """Record a fault; of each kind the first few are kept in words."""
        self._counts[kind] += 1
        if self._counts[kind] <= _LISTED:
            self._listed.setdefault(kind, []).append(f"{kind}: {where}: {what}")

    def lines(self) -> list[str]:
        """A line for each fault, and one for those of a kind that are only counted."""
        out = []
        for kind, listed in self._listed.items():
            out += listed
            if self._counts[kind] > len(listed):
                out.append(f"{kind}: … and {self._counts[kind] - len(listed)} more")
        return out
