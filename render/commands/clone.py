"""`lime-estimate` with the options that render a clone: its material on a mesh, in the photo."""

import argparse
import functools
from pathlib import Path
from typing import TYPE_CHECKING

from lime_keras import console, processors
from lime_keras.commands import estimate

if TYPE_CHECKING:
    from lime_keras.estimate.batch import Clone


def parser() -> argparse.ArgumentParser:
    """Return the parser of `lime-estimate`'s options, with those of a clone."""
    out = estimate.parser()
    group = out.add_argument_group("clone")
    group.add_argument(
        "--clone-onto",
        type=Path,
        metavar="MESH",
        help="mesh to render in the object's place: DIR/NAME-clone.png; without --normals they are "
        "guessed from the mask",
    )
    group.add_argument(
        "--up",
        choices=("y", "z"),
        help="axis that points up in the mesh of --clone-onto (default: y)",
    )
    group.add_argument(
        "--shadow",
        action="store_true",
        help="let the mesh of --clone-onto cast a shadow on the ground it stands on",
    )
    return out


def main(argv: list[str] | None = None) -> int:
    """Run `lime-estimate` and return the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _run(options), estimate.INTERRUPTED)


def _run(options: argparse.Namespace) -> int:
    mesh = options.clone_onto
    if mesh is None:
        if options.up or options.shadow:
            raise ValueError("--up and --shadow say how a mesh is shown: pass one to --clone-onto")
        return estimate.run(options)
    console.require("--clone-onto", "mitsuba", "trimesh", "scipy", "manifold3d")
    if not mesh.is_file():
        raise ValueError(f"{mesh} is no file: pass a mesh to --clone-onto")
    from lime_keras.estimate.results import digest

    from ..shapes import meshes

    meshes.check_kind(mesh)
    up = options.up if options.up != "y" else None  # as without the option
    changing = {"clone-onto": digest(mesh), "up": up, "shadow": options.shadow}
    return estimate.run(options, changing, functools.partial(_renderer, options))


def _renderer(options: argparse.Namespace) -> "Clone":
    """Return the function that renders a material on the mesh, and set Mitsuba up for it."""
    from ..mitsuba_setup import variants

    variants.activate(variants.choose(), processors.count())
    from .. import cloning

    return functools.partial(
        cloning.clone, mesh_path=options.clone_onto, up=options.up or "y", shadow=options.shadow
    )
