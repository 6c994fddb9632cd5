"""What a run prints of its results: words for a person at a terminal, else lines of JSON."""

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from tqdm import tqdm

from lime_keras.material import srgb_hex
from lime_keras.optics import gloss

_SWATCH = 4  # width of the colour in letters
_FORMATS = (".gltf", ".mtl", "-mitsuba.json", "-clone.png", "-overlay.mp4", ".csv", ".json")
"""Ends of the files that are named; the layers lie beside them."""


def takes_colour(stream: IO[str]) -> bool:
    """Return whether a stream is a terminal that shows colours (https://no-color.org)."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return stream.isatty() and not plain


class Printer:
    """The printer of a run's results, beside its progress bar.

    Args:
        for_people: whether standard output gets words (`describe`) in place of JSON; warnings are
            then a part of them, else they go to standard error.
    """

    def __init__(self, *, for_people: bool):
        self._for_people = for_people

    def show(self, content: Mapping[str, Any], folder: Path, remarks: Sequence[str] = ()) -> None:
        """Print a result, by the content of its JSON and its files' folder, with `remarks`."""
        colour = takes_colour(sys.stdout)
        words = describe(content, folder, remarks, colour=colour) if self._for_people else None
        tqdm.write(words or json.dumps(content))

    def result(self, content: Mapping[str, Any], folder: Path, remarks: Sequence[str] = ()) -> None:
        """Print a result of this run with its warnings, to which `remarks` are added."""
        self.show(content, folder, remarks)
        if not self._for_people:
            for part in content.get("scenes") or [content]:
                where = f", scene {part['scene']}" if "scene" in part else ""
                for message in _messages(part):
                    self.warning(f"{_source(content)}{where}: {message}")
            for remark in remarks:
                self.warning(f"{_source(content)}: {remark}")

    def warning(self, text: str) -> None:
        """Print a warning to standard error."""
        tqdm.write(f"warning: {text}", file=sys.stderr)

    def error(self, text: str) -> None:
        """Print an error to standard error, which may not take a name that is no UTF-8."""
        tqdm.write(f"error: {os.fsencode(text).decode(errors='replace')}", file=sys.stderr)


def describe(
    content: Mapping[str, Any], folder: Path, remarks: Sequence[str] = (), *, colour: bool
) -> str:
    """Return the lines of one result: its source, its material, its warnings and its files.

    With `colour`, the diffuse albedo is shown as a swatch, by ANSI true colour.
    """
    lines = [_source(content)]
    scenes = content.get("scenes", ())
    for part in scenes if len(scenes) > 1 else [content]:
        which = f"scene {part['scene']}  " if part is not content else ""
        lines.append(f"  {which}{material(part, colour=colour)}")
        lines += [f"  ! {message}" for message in _messages(part)]
    lines += [f"  ! {remark}" for remark in remarks]
    lines.append(f"  {_places(content['files'], folder)}")
    return "\n".join(lines)


def material(numbers: Mapping[str, Any], *, colour: bool) -> str:
    """Return the numbers of a material in one line; what was not estimated is left out."""
    parts = []
    diffuse = numbers.get("diffuse_albedo")
    if diffuse is not None:
        hexadecimal = srgb_hex(diffuse)
        red, green, blue = (int(hexadecimal[at : at + 2], 16) for at in (1, 3, 5))
        swatch = f"\x1b[48;2;{red};{green};{blue}m{' ' * _SWATCH}\x1b[0m " if colour else ""
        parts.append(f"{swatch}{hexadecimal}")
    if numbers.get("exponent") is not None:
        shininess = gloss.numbers(numbers["exponent"], numbers.get("exponent_interval"))
        parts.append(f"{numbers['gloss']}, {shininess}")
    if numbers.get("specular_albedo") is not None:
        parts.append(f"specular {numbers['specular_albedo']:.2f}")
    if not parts and numbers.get("mask_coverage"):
        parts.append(f"mask alone, {numbers['mask_coverage']:.1%} of the picture")
    return "   ".join(parts) or "no material"


def _source(content: Mapping[str, Any]) -> str:
    return str(content.get("photo", content.get("video")))


def _messages(numbers: Mapping[str, Any]) -> Iterator[str]:
    for warning in numbers.get("warnings", ()):
        yield warning["message"]


def _places(files: Sequence[str], folder: Path) -> str:
    """Return where the files are: the preview first, then the formats."""
    previews = [file for file in files if file.endswith("-preview.png")]
    formats = [file for end in _FORMATS for file in files if file.endswith(end)]
    named = list(dict.fromkeys([*previews, *formats]))
    rest = len(files) - len(named)
    return f"{folder}{os.sep}: {', '.join(named)}" + (f" and {rest} more" if rest else "")
