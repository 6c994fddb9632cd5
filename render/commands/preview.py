"""`lime-render preview`: draw what a corpus holds."""

import argparse
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "preview",
        run,
        "Draw CORPUS/SPLIT/preview.png, a contact sheet.",
        "  lime-render preview corpus\n  lime-render preview corpus --split test",
    )
    shared.add_folder(command)


def run(options: argparse.Namespace) -> int:
    """Draw the picture and return the exit status."""
    console.import_tensorflow()
    from ..inspect import preview

    for split in shared.splits(options.corpus, options.split):
        with console.Bar(f"preview {split.name}", "example") as bar:
            path = preview.preview(options.corpus, split.name, bar.move)
        print(path)
    return 0
