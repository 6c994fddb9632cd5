"""The check of what a corpus or a bank records of the user's files: `inputs.json`."""

from pathlib import Path
from typing import Any

from lime_keras.io import incoming

from .faults import Faults


def check(path: Path, manifest: dict[str, Any], faults: Faults) -> None:
    """Check that the findings agree with the manifest beside them, and names with the findings.

    Args:
        path: file of the findings.
        manifest: manifest of a split or a bank.
        faults: list of faults to add to.
    """
    listed = manifest.get("inputs")
    try:
        held = {
            kind: {found["name"]: found["sha256"] for found in of_kind if found["problem"] is None}
            for kind, of_kind in incoming.read_json(path).items()
        }
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        faults.add("inputs", path, f"is missing or holds no findings ({error}): render again")
        return
    if held != listed:
        faults.add("inputs", path, "differs from the inputs in the manifest: render again")
    # Names of built-in shapes and lights are in no record.
    names = sorted(held.get("shapes", {}))
    if names and sorted(manifest.get("shapes", [])) != names:
        faults.add("inputs", path, "holds other shapes than the manifest names: render again")
    names = sorted(held.get("environments", {}))
    if names and "lights" in manifest and sorted(manifest["lights"]) != names:
        faults.add("inputs", path, "holds other lights than the manifest names: render again")
