"""The check of what a corpus records of the user's files: `inputs.json`."""

import re
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted

from .faults import Faults

_BUILT_IN = re.compile(r"room-\d{4}\.exr|sky-\d{4}|endless-\d{5}-\d{2}")
"""Names of lights and bodies that a corpus may have beside those of the user's files."""


def check(path: Path, manifest: dict[str, Any], faults: Faults) -> None:
    """Check that the findings agree with the manifest beside them, and names with the findings.

    Args:
        path: file of the findings.
        manifest: manifest of a split.
        faults: list of faults to add to.
    """
    listed = manifest.get("inputs")
    try:
        recorded = {
            kind: {found["name"]: found["sha256"] for found in of_kind if found["problem"] is None}
            for kind, of_kind in untrusted.read_json(path).items()
        }
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        faults.add("inputs", path, f"is missing or holds no findings ({error}): render again")
        return
    if recorded != listed:
        faults.add("inputs", path, "differs from the inputs in the manifest: render again")
    for kind, key in (("shapes", "shapes"), ("environments", "lights")):
        used, named = set(recorded.get(kind, {})), set(manifest.get(key, []))
        others = {name for name in named - used if not _BUILT_IN.fullmatch(str(name))}
        if used and (used - named or others):
            some = ", ".join(sorted(map(str, (used - named) | others))[:5])
            faults.add("inputs", path, f"has other {kind} than the manifest: {some}; render again")
