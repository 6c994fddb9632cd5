"""The kinds of sources, told by their names: photos, videos and cameras.

This module imports no library but Python's own, so that a command can sort what it is given, and
refuse what is not there, before any is loaded.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from lime_keras.io import result_json

SUFFIXES = (
    *(".jpg", ".jpeg", ".png", ".heic", ".heif", ".hif", ".avif", ".exr", ".hdr", ".pfm"),
    *(".tif", ".tiff", ".webp", ".jp2", ".jxl", ".bmp", ".gif", ".tga", ".ppm"),
)
"""Suffixes of the files in a folder that count as photos; a named file may have any suffix."""
EXTENSIONS = (
    *(".mp4", ".m4v", ".mov", ".3gp", ".mkv", ".webm", ".avi", ".wmv"),
    *(".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".ogv"),
)
"""Suffixes of files that count as videos; FFmpeg itself looks only at a file's content."""
CAMERA = "camera:"
"""Prefix of a camera's name: `camera:0`, `camera:/dev/video2`, `camera:FaceTime HD Camera`."""
_MASK = "_mask"
"""End of the stem of a PNG that is the mask of the photo beside it."""


def mask_beside(photo: Path) -> Path | None:
    """Return `NAME_mask.png` beside the photo `NAME.*`, or None if there is none."""
    mask = photo.with_name(f"{photo.stem}{_MASK}.png")
    # Unlike `Path.is_file`, this raises no error if the name is too long for a file.
    return mask if os.path.isfile(mask) else None


def photo_of_mask(path: Path) -> Path | None:
    """Return the photo that a mask lies beside (see `mask_beside`); None for any other file."""
    if path.suffix != ".png" or not path.stem.endswith(_MASK) or not path.is_file():
        return None
    name = path.stem.removesuffix(_MASK)
    beside = (path.with_name(f"{name}{s}") for ending in SUFFIXES for s in (ending, ending.upper()))
    return next((photo for photo in beside if photo.is_file()), None)


def is_video(source: str) -> bool:
    """Return whether `source` names a camera or a video file."""
    return is_camera(source) or Path(source).suffix.lower() in EXTENSIONS


def is_camera(source: str) -> bool:
    """Return whether `source` names a camera."""
    return source.startswith((CAMERA, "/dev/video"))


def inside(folder: Path) -> Iterator[Path]:
    """Yield the photos and videos in a folder and in all folders below it, in a fixed order.

    Hidden folders, unfinished results and the masks of photos (`photo_of_mask`) are left out, and
    so are files that `lime-estimate` wrote: the layers of a photo are no photos. Links to folders
    are not followed.

    Args:
        folder: an existing folder.
    """
    for path, below, names in os.walk(folder):
        below[:] = sorted(name for name in below if not name.startswith((".", "partial-")))
        results = [result_json.read(Path(path, name)) for name in names if name.endswith(".json")]
        written = {file for result in results if result for file in result["files"]}
        for name in sorted(set(names) - written):
            file = Path(path, name)
            is_source = file.suffix.lower() in SUFFIXES or is_video(str(file))
            if is_source and not photo_of_mask(file):
                yield file
