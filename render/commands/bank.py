"""`lime-render bank`: render a bank of geometry, lights and textures."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "bank",
        run,
        "Render a bank: compressed G-buffers of objects in random pose, size and crop, each "
        "deformed anew; lights; and textures. Training makes new scenes from it as it runs.",
        "  lime-render bank bank --split train --count 4000\n"
        "  lime-render bank bank --split train --count 20000 --shapes meshes/ "
        "--environments hdris/\n"
        "  lime-render verify bank\n\n"
        "An interrupted command, run again, goes on where it stopped; the same seed gives the "
        "same\nbytes whatever the number of workers.",
        shared.GOES_ON,
    )
    command.add_argument("out", type=Path, metavar="OUT", help="folder of the bank")
    shared.add_contents(command, "G-buffers").add_argument(
        "--size", type=_size, default=128, help="height and width in pixels (default: 128)"
    )
    shared.add_inputs(
        command,
        shapes="for half of the G-buffers; the others, and without a folder all, show procedural "
        "shapes, each a new one",
        environments="environment maps (HDR, EXR; equirectangular) beside the built-in rooms and "
        "skies: 88 for training, 24 for test",
    )
    speed = command.add_argument_group("speed")
    shared.add_workers(speed)
    shared.add_shard_size(speed, "G-buffers", " (default: a twentieth of the count, at most 256)")


def run(options: argparse.Namespace) -> int:
    """Render the bank and return the exit status."""
    console.check_folder(options.out, "OUT")
    from .. import cards
    from ..bank import rendering
    from ..bank.description import Description

    choice = shared.chosen_variant(options.out / "description.json")
    description = Description(variant=choice.variant, **shared.described(options, 256))
    with (
        console.Bar("files", "file") as checked,
        console.Bar("lights", "light") as lit,
        console.Bar("textures", "texture") as drawn,
        console.Bar("G-buffers", "entry") as rendered,
    ):
        manifest = rendering.render_bank(
            options.out,
            description,
            choice,
            workers=options.workers,
            skip_unusable=options.unusable == "skip",
            on_input=checked.move,
            on_light=lit.move,
            on_texture=drawn.move,
            on_entry=rendered.move,
        )
    cards.write(options.out)
    shared.tell(manifest, "entry")
    print(f"{manifest['count']} entries in {options.out}")
    return 0


def _size(text: str) -> int:
    from lime_keras.synthesis.bank import LARGEST_SIZE

    return console.whole(32, LARGEST_SIZE, 32)(text)
