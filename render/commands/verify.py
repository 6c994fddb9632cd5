"""`lime-render verify`: check a corpus or a bank."""

import argparse
import sys
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "verify",
        run,
        "Check files, counts, checksums and every record: that layers recompose to the image, that "
        "the stored light shades the stored normals, and more. Of a bank, check every entry: that "
        "normals face the viewer, that lights shine with a mean of 1, and more. Exit status 1 if "
        "anything is wrong.",
        "  lime-render verify corpus\n  lime-render verify corpus --split test\n"
        "  lime-render verify bank",
    )
    shared.add_folder(command)


def run(options: argparse.Namespace) -> int:
    """Check what the folder holds and return the exit status: 1 if anything is wrong."""
    if shared.is_bank(options):
        from ..bank import verification as of_bank

        with console.Bar("verify", "entry") as bar:
            faults = of_bank.verify(options.corpus, bar.move)
        return _told(faults, "entries", options.corpus)
    console.import_tensorflow()
    from ..inspect import verification

    status = 0
    for split in shared.splits(options.corpus, options.split):
        with console.Bar(f"verify {split.name}", "example") as bar:
            faults = verification.verify(options.corpus, split.name, bar.move)
        status = max(status, _told(faults, "examples", split.folder))
    return status


def _told(faults: Any, unit: str, folder: Any) -> int:
    """Print the faults and their number, and return the exit status."""
    for line in faults.lines():
        print(line, file=sys.stderr)
    found = f"{faults.count} fault{'s' if faults.count > 1 else ''}"
    print(f"{faults.examples} {unit} in {folder}: {found if faults.count else 'sound'}")
    return int(faults.count > 0)
