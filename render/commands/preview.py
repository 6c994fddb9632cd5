"""`lime-render preview`: draw what a corpus or a bank holds."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "preview",
        run,
        "Draw CORPUS/SPLIT/preview.png, a contact sheet. Of a bank, draw BANK/preview.png, 100 "
        "G-buffers with lights and textures.",
        "  lime-render preview corpus\n  lime-render preview corpus --split test\n"
        "  lime-render preview bank --out sheet.png",
    )
    shared.add_folder(command)
    command.add_argument(
        "--out", type=Path, metavar="PNG", help="of a bank (default: BANK/preview.png)"
    )


def run(options: argparse.Namespace) -> int:
    """Draw the picture and return the exit status."""
    if shared.is_bank(options):
        from ..bank import preview as of_bank

        out = options.out or options.corpus / "preview.png"
        of_bank.preview(options.corpus, out)
        print(out)
        return 0
    if options.out:
        raise ValueError(f"{options.corpus} is no bank: --out is for the preview of a bank")
    console.import_tensorflow()
    from ..inspect import preview

    for split in shared.splits(options.corpus, options.split):
        with console.Bar(f"preview {split.name}", "example") as bar:
            path = preview.preview(options.corpus, split.name, bar.move)
        print(path)
    return 0
