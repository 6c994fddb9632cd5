"""The kinds of sources by their names (photos, videos, cameras), and the search of folders.

This module imports no library but Python's own, so that a command can sort what it is given, and
refuse what is not there, before any is loaded.
"""

import functools
import itertools
import os
import unicodedata
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from lime_keras.io import result_json

SUFFIXES = (
    *(".jpg", ".jpeg", ".jpe", ".jfif", ".png", ".heic", ".heif", ".hif", ".avif", ".exr"),
    *(".hdr", ".pfm", ".tif", ".tiff", ".webp", ".jp2", ".jxl", ".bmp", ".gif", ".tga"),
    *(".ppm", ".pgm", ".pbm", ".pnm"),
)
"""Suffixes of the files in a folder that count as photos; a named file may have any suffix."""
EXTENSIONS = (
    *(".mp4", ".m4v", ".mov", ".3gp", ".3g2", ".mkv", ".webm", ".avi", ".wmv", ".flv"),
    *(".mpg", ".mpeg", ".m2v", ".vob", ".ts", ".mts", ".m2ts", ".mxf", ".ogv", ".y4m"),
)
"""Suffixes of files that count as videos; FFmpeg itself looks only at a file's content."""
CAMERA = "camera:"
"""Prefix of a camera's name: `camera:0`, `camera:/dev/video2`, `camera:FaceTime HD Camera`."""
_MASK = "_mask"  # end of the stem of a PNG that is the mask of the photo beside it
_OF_SYSTEMS = ("__MACOSX", "@eaDir", "#recycle", "$RECYCLE.BIN", "System Volume Information")
"""Folders that archives, network disks and Windows make, with small copies of pictures in some."""


class AmbiguousName(ValueError):
    """Two files that could be meant by one name."""


def list_folder(folder: Path, suffixes: Collection[str]) -> list[Path]:
    """Return the files of a folder with these suffixes, in lower case, sorted; no hidden ones.

    Links are listed wherever they lead, unless it is a folder.
    """
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if not is_hidden(entry.name)]
    paths = (folder / name for name in names if Path(name).suffix.lower() in suffixes)
    # Unlike `Path.is_dir`, this raises no error if a link leads to itself.
    return sorted(path for path in paths if not os.path.isdir(path))


def walk(folder: Path, suffixes: Collection[str]) -> Iterator[Path]:
    """Yield what `list_folder` lists, of a folder and all below it, in a fixed order.

    Links to folders are not followed.
    """
    for path, below, _ in os.walk(folder):
        below[:] = sorted(name for name in below if not is_hidden(name))
        yield from list_folder(Path(path), suffixes)


def is_hidden(name: str) -> bool:
    """Return whether a file or folder is no user's: hidden, unfinished, or a file system's own."""
    return name.startswith((".", "partial-")) or name in _OF_SYSTEMS


def mask_beside(photo: Path) -> Path | None:
    """Return `NAME_mask.png` beside the photo `NAME.*`, or None if there is none.

    Where the letters' case differs, the name as it is written here counts first.
    """
    ends = itertools.product(_cases(_MASK), _cases(".png"))
    return _beside(photo, photo.stem, map("".join, ends))


def photo_of_mask(path: Path) -> Path | None:
    """Return the photo that a mask lies beside (see `mask_beside`); None for any other file."""
    is_mask = path.suffix.lower() == ".png" and path.stem.lower().endswith(_MASK)
    if not is_mask or not os.path.isfile(path):
        return None
    return _beside(path, path.stem[: -len(_MASK)], itertools.chain(*map(_cases, SUFFIXES)))


def _beside(path: Path, stem: str, ends: Iterable[str]) -> Path | None:
    """Return the first file beside another that has a stem, in any case, and one of the ends."""
    named = [path.with_name(f"{own}{end}") for end in ends for own in _cases(stem)]
    # Unlike `Path.is_file`, this raises no error if the name is too long for a file.
    return next((file for file in named if os.path.isfile(file)), None)


def _cases(name: str) -> Iterator[str]:
    """Yield a name as it is, in lower case and in capitals, and with accents as systems have them.

    A Mac may write é as two characters, and other systems as one.
    """
    cases = (name, name.lower(), name.upper())
    others = (unicodedata.normalize(form, case) for form in ("NFC", "NFD") for case in cases)
    yield from dict.fromkeys((*cases, *others))


def folded(name: str) -> str:
    """Return a name casefolded and in NFC, to compare names without case or form of accents."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


@functools.lru_cache
def _by_stem(place: Path, changed_ns: int) -> dict[str, list[Path]]:
    """Return a folder's pictures by folded stem, listed once: each of thousands of photos asks."""
    out: dict[str, list[Path]] = {}
    for file in list_folder(place, SUFFIXES):
        out.setdefault(folded(file.stem), []).append(file)
    return out


def of_photo(photo: Path, folder: Path) -> Path:
    """Return the file of a photo, its mask say, in a folder for those of many photos.

    The file has the photo's own name, its stem, its name and another suffix (`a.jpg.png`, as COLMAP
    has it), or its stem and `_mask`, in this order; the letters' case counts last. In subfolders
    that are called as the photo's own folders, a file is nearer to the photo.

    Raises:
        AmbiguousName: if two files have such names, and neither is nearer.
        ValueError: if none has.
    """
    above = Path(os.path.abspath(photo)).parent.parts[1:]
    for place in (*(folder.joinpath(*above[start:]) for start in range(len(above))), folder):
        if not place.is_dir():
            continue
        own = os.path.realpath(photo)  # however it is spelled
        listed = _by_stem(place, place.stat().st_mtime_ns)
        for stem in (photo.stem, photo.name, f"{photo.stem}{_MASK}"):
            files = [one for one in listed.get(folded(stem), ()) if os.path.realpath(one) != own]
            for fold in (str, folded):
                named = [file for file in files if fold(file.stem) == fold(stem)]
                exact = [file for file in named if fold(file.name) == fold(photo.name)]
                if len(exact or named) > 1:
                    names = " and ".join(file.name for file in exact or named)
                    raise AmbiguousName(f"{place} holds {names} for {photo}: keep one of them")
                if named:
                    return (exact or named)[0]
    raise ValueError(f"{folder} holds nothing for {photo}: call it {photo.stem}, as the photo")


def is_video(source: str) -> bool:
    """Return whether `source` names a camera or a video file."""
    return is_camera(source) or Path(source).suffix.lower() in EXTENSIONS


def is_camera(source: str) -> bool:
    """Return whether `source` names a camera."""
    return source.startswith((CAMERA, "/dev/video"))


def inside(folder: Path) -> Iterator[Path]:
    """Yield the photos and videos in a folder and in all folders below it, in a fixed order.

    Hidden files and folders, unfinished results and the masks of photos (`photo_of_mask`) are left
    out, and so are files that `lime-estimate` wrote: the layers of a photo are no photos. Links to
    folders are not followed.
    """
    written: dict[Path, set[str]] = {}
    for file in walk(folder, (*SUFFIXES, *EXTENSIONS)):
        if file.parent not in written:
            results = map(result_json.read, list_folder(file.parent, (".json",)))
            written = {
                file.parent: {name for result in results if result for name in result["files"]}
            }
        if file.name not in written[file.parent] and not photo_of_mask(file):
            yield file
