"""`lime-render`: render a corpus."""

import argparse
import os
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_EXAMPLE = """
examples:
  lime-render corpus --split train --count 512
  lime-render corpus --split test --count 128
  lime-render corpus --split train --count 10000 --shapes meshes/ --environments hdris/

An interrupted command, run again, goes on where it stopped; the same seed gives the same bytes
whatever the number of workers.
"""


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    out = argparse.ArgumentParser(
        prog="lime-render",
        description="Render images of single objects with their mask, diffuse and specular "
        "shading, mirror image, normals, environment and material, as TFRecords.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    out.add_argument("--split", choices=("train", "test"), required=True)
    out.add_argument("--count", type=_positive, required=True, help="number of examples")
    out.add_argument("--seed", type=_seed, default=0, help="of everything random (default: 0)")
    out.add_argument(
        "--shapes",
        type=Path,
        metavar="DIR",
        help="folder of meshes (OBJ, PLY, STL, GLB) instead of the built-in shapes, of which there "
        "are 400 for training and 100 for test",
    )
    out.add_argument(
        "--environments",
        type=Path,
        metavar="DIR",
        help="folder of environment maps (HDR, EXR; equirectangular) instead of the built-in rooms "
        "(40 for training, 12 for test); "
        "of both folders a fifth of the files is kept for the test split, or the subfolders train "
        "and test are used if there are such",
    )
    out.add_argument(
        "--backgrounds",
        type=Path,
        metavar="DIR",
        help="folder of pictures to put behind the objects instead of random textures",
    )
    out.add_argument(
        "--shading",
        choices=("furnace", "literal"),
        default="furnace",
        help="normalise shading to the white furnace, or store Eqs. 2 and 3 as printed; a model "
        "gives specular albedos in the unit of its corpus (default: furnace)",
    )
    out.add_argument(
        "--size", type=_size, default=256, help="height and width in pixels (default: 256)"
    )
    out.add_argument(
        "--shard-size",
        type=_positive,
        metavar="N",
        help="examples in a file (default: a twentieth of the count, at most 512)",
    )
    out.add_argument(
        "--workers", type=_positive, default=os.cpu_count(), help="processes (default: all cores)"
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Render one split of a corpus; returns the exit status."""
    options = parser().parse_args(argv)
    return console.run(
        lambda: _render(options), "the same command goes on with the shards that are missing"
    )


def _render(options: argparse.Namespace) -> int:
    from . import shards, variants

    choice = variants.choose()
    if shards.held_variant(options.out, options.split) == variants.SLOW:
        # Begun without a libLLVM: its shards go on as they began.
        choice = variants.Choice(variants.SLOW, None)
    print(choice.explain(), file=sys.stderr)
    folders = {
        name: str(folder.resolve()) if (folder := getattr(options, name)) else None
        for name in ("shapes", "environments", "backgrounds")
    }
    description = shards.Description(
        split=options.split,
        count=options.count,
        seed=options.seed,
        size=options.size,
        shard_size=options.shard_size or min(512, -(-options.count // 20)),
        shading=options.shading,
        variant=choice.variant,
        **folders,
    )
    with _Bar("rooms", "room") as rooms, _Bar(options.split, "example") as rendered:
        manifest = shards.render_split(
            options.out,
            description,
            choice,
            workers=options.workers,
            on_room=rooms.move,
            on_example=rendered.move,
        )
    for failure in manifest["failures"]:
        print(f"replaced: example {failure['index']}: {failure['error']}", file=sys.stderr)
    print(f"{manifest['examples']} examples in {options.out / options.split}")
    return 0


class _Bar:
    """A progress bar that appears with the first news; what was done before does not count."""

    def __init__(self, title: str, unit: str):
        self._title, self._unit, self._bar = title, unit, None

    def __enter__(self) -> "_Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def move(self, done: int, total: int) -> None:
        """Show that `done` of `total` are there."""
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                desc=self._title, unit=self._unit, initial=done, total=total, dynamic_ncols=True
            )
        self._bar.update(done - self._bar.n)
        if done == total:
            self._bar.close()


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not at least 1")
    return value


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"{text} is not in 0 … 2^63 − 1")
    return value


def _size(text: str) -> int:
    value = int(text)
    if value < 32 or value % 32:
        raise argparse.ArgumentTypeError(f"{text} is not a multiple of 32")
    return value
