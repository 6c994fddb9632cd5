"""`lime-render views`: take pictures inside HDR maps, for backgrounds."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console

from . import options as shared


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "views",
        run,
        "Take pictures inside the HDR maps of the train split, for lime-render --backgrounds. The "
        "same maps give the same pictures.",
        "  lime-render views hdris/ views/",
        "run again, it writes all of the pictures anew",
    )
    command.add_argument(
        "maps", type=Path, metavar="HDRIS", help="folder of maps, as of lime-render --environments"
    )
    command.add_argument("out", type=Path, metavar="OUT", help="folder of the pictures")
    command.add_argument(
        "--count", type=console.count, default=16, help="pictures of each map (default: 16)"
    )


def run(options: argparse.Namespace) -> int:
    """Write the pictures and return the exit status."""
    console.check_folder(options.out, "OUT")
    console.require("lime-render views", *console.EXTRAS["render"])
    from ..scene import map_views

    with console.Bar("views", "picture") as bar:
        map_views.write_views(options.maps, options.out, options.count, bar.move)
    return 0
