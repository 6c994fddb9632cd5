"""`lime-render scenes`: make a corpus of a bank's scenes."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "scenes",
        run,
        "Make scenes of a bank, as training does, and store them as the train split of a corpus. "
        "On a processor, reading them is three to six times as fast as making them.",
        "  lime-render scenes bank corpus --count 20000\n"
        "  lime-train corpus --out runs/live --preset live",
        shared.GOES_ON,
    )
    command.add_argument("bank", type=Path, metavar="BANK", help="folder of the bank")
    command.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    command.add_argument(
        "--count", type=console.count, required=True, help="number of examples to make"
    )
    command.add_argument(
        "--seed", type=shared.seed, default=0, help="of everything random (default: 0)"
    )
    command.add_argument(
        "--materials",
        choices=shared.MATERIALS,
        default=shared.MATERIALS[0],
        help="law of the materials; training may draw others (default: uniform)",
    )
    shared.add_shard_size(command, "examples", " (default: a twentieth of the count, at most 512)")


def run(options: argparse.Namespace) -> int:
    """Make the scenes and return the exit status."""
    console.require("lime-render scenes", "keras", "tensorflow")
    console.import_tensorflow()
    from .. import cards
    from ..corpus import from_bank

    shard_size = shared.shard_size(options, 512)
    with console.Bar("scenes", "example") as bar:
        manifest = from_bank.make_split(
            options.bank,
            options.out,
            count=options.count,
            seed=options.seed,
            shard_size=shard_size,
            materials=options.materials,
            tell=bar.move,
        )
    cards.write(options.out)
    print(f"{manifest['examples']} examples in {options.out / 'train'}")
    return 0
