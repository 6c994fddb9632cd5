"""`lime-render layers`: write one example as OpenEXR layers."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.data.corpus import SPLITS

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "layers",
        run,
        "Write one example as OpenEXR layers, and its environment beside them.",
        "  lime-render layers corpus 12 --split test\n"
        "  lime-render layers corpus 12 --split test --out example.exr",
    )
    command.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    command.add_argument(
        "index", type=console.whole(0), metavar="INDEX", help="of the example in the split"
    )
    command.add_argument("--split", choices=SPLITS, required=True, help="which half of the corpus")
    command.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="an .exr file (default: CORPUS/SPLIT/example-INDEX.exr)",
    )


def run(options: argparse.Namespace) -> int:
    """Write the layers and return the exit status."""
    console.import_tensorflow()
    from ..inspect import exr_layers

    out = options.out or exr_layers.default_path(options.corpus, options.split, options.index)
    exr_layers.export(options.corpus, options.split, options.index, out)
    print(out)
    print(exr_layers.environment_path(out))
    return 0
