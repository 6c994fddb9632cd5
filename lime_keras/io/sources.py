"""The kinds of sources, told by their names: photos, videos and cameras.

This module imports no library, so that a command can sort what it is given, and refuse what is not
there, before any is loaded.
"""

from pathlib import Path

SUFFIXES = tuple(
    ".jpg .jpeg .png .heic .heif .exr .hdr .tif .tiff .webp .jp2 .jxl .bmp .gif .tga .ppm".split()
)
"""Suffixes of the files in a folder that count as photos; a named file may have any suffix."""
EXTENSIONS = (
    *(".mp4", ".m4v", ".mov", ".3gp", ".mkv", ".webm", ".avi", ".wmv"),
    *(".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".ogv"),
)
"""Suffixes of files that count as videos; FFmpeg itself looks only at a file's content."""
CAMERA = "camera:"
"""Prefix of a camera's name: `camera:0`, `camera:/dev/video2`, `camera:FaceTime HD Camera`."""


def is_video(source: str) -> bool:
    """Return whether `source` names a camera or a video file."""
    return is_camera(source) or Path(source).suffix.lower() in EXTENSIONS


def is_camera(source: str) -> bool:
    """Return whether `source` names a camera."""
    return source.startswith((CAMERA, "/dev/video"))
