"""A folder of photos to evaluate on: its pictures, their masks, and the labels in `labels.csv`.

This module reads names and labels only; no picture is opened.
"""

import csv
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted
from lime_keras.io.sources import SUFFIXES, walk

LABELS = "labels.csv"
"""Name of the file of labels in the folder of photos."""
FINISHES = ("glossy", "matte")
COLUMNS = ("photo", "finish", "note", "dielectric", "pair")
"""Columns that a file of labels may have; the first is needed."""
_MASK = "mask"
_PHOTO = ("input", "image", "photo")
"""Words that may end a photo's name where its mask's name ends with `mask`."""
_SEPARATORS = " _-."


@dataclass(frozen=True)
class Photo:
    """A photo and its labels.

    Attributes:
        name: path below the folder of photos, with `/`.
        path: path of the file.
        mask: path of its mask, if it has one.
        finish: `glossy` or `matte`; None without a label.
        dielectric: whether the object is known to be of no metal, so that its specular share is
            that of a dielectric.
        pair: name of the photos that this one is to be compared with, if there are any.
    """

    name: str
    path: Path
    mask: Path | None = None
    finish: str | None = None
    dielectric: bool = False
    pair: str | None = None


def read(folder: Path, out: Path) -> list[Photo]:
    """Return the photos in a folder, at any depth, in the order of their names.

    A picture whose name ends with `mask` is the mask of the photo beside it whose name begins
    alike: `cup_mask.png` of `cup.jpg`, `1mask.png` of `1input.png` (`input`, `image` and `photo`
    may end a photo's name). Hidden files and folders are left out.

    Args:
        folder: folder of photos; its `labels.csv`, if it has one, holds their labels.
        out: folder of the results; it is left out if it lies inside `folder`.

    Raises:
        ValueError: if there is no photo; a mask belongs to no photo or to several; `out` is the
            folder itself; or the labels have an unknown column or value, or name a photo that is
            not there or that they name twice.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder: pass a folder of photos to --photos")
    if out.resolve() == folder.resolve():
        raise ValueError(
            f"{out} holds the photos: pass another --out, or its pictures would count as photos"
        )
    pictures = sorted(_pictures(folder, out.resolve()))
    masks = [path for path in pictures if path.stem.casefold().endswith(_MASK)]
    photos = [path for path in pictures if path not in set(masks)]
    if not photos:
        raise ValueError(f"{folder} has no photos: their names end in {', '.join(SUFFIXES)}")
    mask_of = _assigned(masks, photos)
    labels = _labels(folder / LABELS) if (folder / LABELS).is_file() else {}
    names = {path.relative_to(folder).as_posix(): path for path in photos}
    for name, (line, _) in labels.items():
        if name not in names:
            raise ValueError(
                f"{folder / LABELS}, line {line}: there is no photo {name} in {folder}: write its "
                "path below that folder, with its suffix"
            )
    return [
        Photo(name, path, mask_of.get(path), **(labels[name][1] if name in labels else {}))
        for name, path in names.items()
    ]


def _pictures(folder: Path, out: Path) -> Iterator[Path]:
    for path in walk(folder, SUFFIXES):
        if out not in path.resolve().parents:
            yield path


def _assigned(masks: Iterable[Path], photos: Iterable[Path]) -> dict[Path, Path]:
    """Return the mask of each photo that has one."""
    of_name: dict[tuple[Path, str], list[Path]] = {}
    for photo in photos:
        of_name.setdefault((photo.parent, _begin(photo, _PHOTO)), []).append(photo)
    found: dict[Path, Path] = {}
    for mask in masks:
        begin = _begin(mask, (_MASK,))
        belonging = of_name.get((mask.parent, begin), [])
        if not belonging:
            raise ValueError(
                f"{mask} is named as a mask, but no photo beside it is called {begin or 'photo'}: "
                f"call a mask NAME_mask of a photo NAME; if this is a photo, let its name not end "
                f"with {_MASK}"
            )
        several = [*belonging, *(found[photo] for photo in belonging if photo in found)]
        if len(several) > 1:
            raise ValueError(
                f"{mask} does not fit one photo alone, with {', '.join(p.name for p in several)} "
                "beside it: rename them so that each mask has one photo"
            )
        found[belonging[0]] = mask
    return found


def _begin(path: Path, ends: tuple[str, ...]) -> str:
    """Return a picture's name without its suffix, its end (if it has one) and separators."""
    stem = re.sub(f"({'|'.join(ends)})$", "", path.stem.casefold())
    return stem.rstrip(_SEPARATORS)


def _labels(path: Path) -> dict[str, tuple[int, dict[str, Any]]]:
    """Return line and fields of `Photo` of each photo that a file of labels names."""
    labels: dict[str, tuple[int, dict[str, Any]]] = {}
    with (
        untrusted.naming(path, "labels"),
        path.open(newline="", encoding="utf-8-sig") as file,
    ):
        reader = csv.DictReader(file, skipinitialspace=True)
        header = reader.fieldnames or []
        unknown = [name for name in header if name not in COLUMNS]
        if unknown or COLUMNS[0] not in header:
            raise ValueError(
                f"{path} has the columns {', '.join(header) or 'of no header'}: it needs "
                f"{COLUMNS[0]} and may have {', '.join(COLUMNS[1:])}"
            )
        for row in reader:
            try:
                name, fields = _label(row)
                if name in labels:
                    raise ValueError(f"{name} is named in line {labels[name][0]} already")
            except ValueError as error:
                raise ValueError(f"{path}, line {reader.line_num}: {error}") from error
            labels[name] = reader.line_num, fields
    return labels


def _label(row: dict[str, str]) -> tuple[str, dict[str, Any]]:
    if None in row:
        raise ValueError("there are more fields than columns: quote a text that holds a comma")
    given = {name: (value or "").strip() for name, value in row.items()}
    finish, dielectric = given.get("finish", ""), given.get("dielectric", "")
    if finish and finish not in FINISHES:
        raise ValueError(f"finish is {finish!r}: write {' or '.join(FINISHES)}, or nothing")
    if dielectric not in ("", "0", "1"):
        raise ValueError(f"dielectric is {dielectric!r}: write 1 or 0, or nothing")
    return given["photo"], {
        "finish": finish or None,
        "dielectric": dielectric == "1",
        "pair": given.get("pair") or None,
    }
