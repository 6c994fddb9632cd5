"""`lime-render verify`: check a corpus."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lime_keras import console

from . import options as shared

if TYPE_CHECKING:
    from ..inspect.faults import Faults


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "verify",
        run,
        "Check files, counts, checksums and every record: that layers recompose to the image, that "
        "the stored light shades the stored normals, and more. Exit status 1 if anything is wrong.",
        "  lime-render verify corpus\n  lime-render verify corpus --split test",
    )
    shared.add_folder(command)


def run(options: argparse.Namespace) -> int:
    """Check what the folder holds and return the exit status: 1 if anything is wrong."""
    console.import_tensorflow()
    from ..inspect import verification

    status = 0
    for split in shared.splits(options.corpus, options.split):
        with console.Bar(f"verify {split.name}", "example") as bar:
            faults = verification.verify(options.corpus, split.name, bar.move)
        status = max(status, _report(faults, split.folder))
    return status


def _report(faults: "Faults", folder: Path) -> int:
    """Print the faults and their number, and return the exit status."""
    for line in faults.lines():
        print(line, file=sys.stderr)
    count = f"{faults.count} fault{'s' if faults.count > 1 else ''}"
    print(f"{faults.examples} examples in {folder}: {count if faults.count else 'sound'}")
    return int(faults.count > 0)
