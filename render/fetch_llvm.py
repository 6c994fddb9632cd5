"""`python -m lime_keras.render.fetch_llvm`: a libLLVM for the fast renderer, without root.

Does nothing where a usable one is found. Else downloads Debian's or Ubuntu's package, with the
libraries it needs, and unpacks them into the virtual environment, where `variants` looks first.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from lime_keras import console

from . import variants

_VERSIONS = ("20", "19", "18", "17")
_COMPANIONS = ("libz3-4", "libedit2", "libbsd0", "libmd0", "libxml2", "libffi8", "libzstd1")
"""What libLLVM is linked to and a small system may lack."""


def main() -> int:
    """Fetch a library if none is usable; 0 even if that fails, since rendering works without."""
    return console.run(_fetch, "run it again to have the fast renderer")


def _fetch() -> int:
    choice = variants.choose()
    if choice.library is None:
        print("no usable libLLVM here: fetching one into the virtual environment", file=sys.stderr)
        try:
            _unpack(variants.own_folder())
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"could not fetch one: {error}", file=sys.stderr)
        choice = variants.choose()
    print(choice.explain(), file=sys.stderr)
    return 0


def _unpack(target: Path) -> None:
    """Download the newest packaged libLLVM and unpack its files into a folder.

    Raises:
        OSError: if there is no `apt-get`, or no package of a usable version.
        CalledProcessError: if a package cannot be unpacked.
    """
    with tempfile.TemporaryDirectory() as scratch:
        apt = _apt(Path(scratch))
        packages = next(
            (found for version in _VERSIONS if (found := _download(apt, version, scratch))), []
        )
        if not packages:
            raise OSError(f"apt-get has no libllvm{_VERSIONS[-1]} … libllvm{_VERSIONS[0]}")
        for package in packages:
            subprocess.run(["dpkg", "-x", package, target], check=True)


def _apt(scratch: Path) -> list[str]:
    """An `apt-get` with lists and cache of its own, which an ordinary user may update."""
    for folder in ("lists/partial", "cache/archives/partial"):
        (scratch / folder).mkdir(parents=True)
    apt = [
        "apt-get",
        "-qq",
        "-o",
        f"Dir::State::Lists={scratch / 'lists'}",
        "-o",
        f"Dir::Cache={scratch / 'cache'}",
        "-o",
        "APT::Sandbox::User=",
    ]
    subprocess.run([*apt, "update"], check=True, capture_output=True, timeout=300)
    return apt


def _download(apt: list[str], version: str, folder: str) -> list[Path]:
    """The package of a version with its companions, or nothing if there is none."""
    got = subprocess.run(
        [*apt, "download", f"libllvm{version}"], cwd=folder, capture_output=True, timeout=600
    )
    if got.returncode:
        return []
    for companion in _COMPANIONS:
        # One that this release names otherwise is on the system already, or the probe will tell.
        subprocess.run([*apt, "download", companion], cwd=folder, capture_output=True, timeout=600)
    return sorted(path for path in Path(folder).iterdir() if path.suffix == ".deb")


if __name__ == "__main__":
    os.environ.pop("DRJIT_LIBLLVM_PATH", None)
    sys.exit(main())
