"""A command that fetches a libLLVM for the fast renderer, without root.

    python -m lime_keras.render.mitsuba_setup.fetch_llvm

It does nothing if a usable libLLVM is found. Else it downloads the package of Debian or Ubuntu, and
the packages that libLLVM and Mitsuba need and this system lacks, and unpacks them into the virtual
environment, where `variants` looks before it looks at the system's.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from lime_keras import console

from . import variants

_VERSIONS = ("20", "19", "18", "17")
_NEEDED_BY_MITSUBA = "libatomic1"
_NEVER_UNPACKED = ("libc6_", "libgcc-s1_", "libstdc++6_")
"""Packages of libraries that the running process has loaded; a second copy would break it."""


def _fetch() -> int:
    """Fetch a libLLVM if none is usable; return 0 in any case, as rendering works without one."""
    if not any(variants.works(library) for library in variants.candidates()):
        print("no usable libLLVM here: fetching one into the virtual environment", file=sys.stderr)
        try:
            _unpack(variants.own_folder())
        except (OSError, subprocess.SubprocessError) as error:
            print(f"could not fetch one: {error}", file=sys.stderr)
    print(variants.choose().explain(), file=sys.stderr)
    return 0


def _unpack(target: Path) -> None:
    """Download the newest packaged libLLVM and its missing dependencies, and unpack them."""
    with tempfile.TemporaryDirectory() as scratch:
        apt = _apt(Path(scratch))
        archives = Path(scratch) / "cache" / "archives"
        if not any(_download(apt, version) for version in _VERSIONS):
            raise OSError(f"apt-get has no libllvm{_VERSIONS[-1]} … libllvm{_VERSIONS[0]}")
        for package in archives.glob("*.deb"):
            if not package.name.startswith(_NEVER_UNPACKED):
                subprocess.run(["dpkg", "-x", package, target], check=True)


def _apt(scratch: Path) -> list[str]:
    """Return an `apt-get` command with its own lists and cache, which need no root to update."""
    for folder in ("lists/partial", "cache/archives/partial"):
        (scratch / folder).mkdir(parents=True)
    options = {
        "Dir::State::Lists": scratch / "lists",
        "Dir::Cache": scratch / "cache",
        "APT::Sandbox::User": "",
        "Debug::NoLocking": "true",
    }
    apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in options.items())]
    subprocess.run([*apt, "update"], check=True, capture_output=True, timeout=300)
    return apt


def _download(apt: list[str], version: str) -> bool:
    """Download the packages that a version of libLLVM needs here, and return whether it worked."""
    command = [*apt, "install", "--yes", "--download-only", "--no-install-recommends"]
    answer = subprocess.run(
        [*command, f"libllvm{version}", _NEEDED_BY_MITSUBA], capture_output=True, timeout=600
    )
    return answer.returncode == 0


if __name__ == "__main__":
    sys.exit(console.run(_fetch, "run it again to have the fast renderer"))
