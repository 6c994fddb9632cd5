"""The colours of a report's page, light and dark, that its figures are drawn in."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """Colours of a page: background, text, faint lines, and the accent of data and full shares."""

    paper: str
    ink: str
    faint: str
    accent: str


LIGHT = Theme(paper="#ffffff", ink="#1d2430", faint="#d5dae1", accent="#1f63b0")
DARK = Theme(paper="#1b212b", ink="#e4e8ee", faint="#3a4454", accent="#74b0f4")
