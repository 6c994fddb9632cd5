"""Where what is made comes from: the commit of this code, and how two records differ."""

import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any


def commit() -> str | None:
    """Return the git commit of this code, with "-dirty" if changed; None outside a checkout."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        # An installed copy may lie inside somebody else's repository.
        git("ls-files", "--error-unmatch", Path(__file__).name)
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return None


def differences(
    recorded: Mapping[str, Any], wanted: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Yield (name, value held, value wanted) of each difference; dots join nested names."""
    for key in sorted(wanted.keys() | recorded.keys()):
        there, asked = recorded.get(key), wanted.get(key)
        if isinstance(there, dict) and isinstance(asked, dict):
            yield from differences(there, asked, f"{prefix}{key}.")
        elif there != asked:
            yield f"{prefix}{key}", there, asked
