"""`lime-render images`: write the images of the test split, for other systems to answer."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "images",
        run,
        "Write the images of the test split, 00000.png and so on, without the truth, for another "
        "system to answer (lime-eval --predictions).",
        "  lime-render images corpus images/\n"
        "  lime-eval corpus --predictions answers/ --out results",
        "the same command goes on with the images that are missing",
    )
    command.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    command.add_argument("out", type=Path, metavar="OUT", help="folder of the images")


def run(options: argparse.Namespace) -> int:
    """Write the images and return the exit status."""
    console.check_folder(options.out, "OUT")
    console.import_tensorflow()
    from ..inspect import images

    with console.Bar("images", "image") as bar:
        count = images.write(options.corpus, options.out, bar.move)
    print(f"{count} images in {options.out}")
    return 0
