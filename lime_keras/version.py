"""The version of the package, defined here alone, and those of the packages installed beside it."""

from collections.abc import Iterable

__version__ = "0.1.0"


def installed(packages: Iterable[str]) -> dict[str, str | None]:
    """Return the version of each package by its name; None if it is not installed."""
    # Commands begin faster without it.
    from importlib import metadata

    def version(package: str) -> str | None:
        try:
            return metadata.version(package)
        except metadata.PackageNotFoundError:
            return None

    return {package: version(package) for package in packages}
