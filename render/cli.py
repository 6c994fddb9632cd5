"""`lime-render`: render a corpus, verify it, look at it."""

import argparse
import os
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.data.corpus import SPLITS
from lime_keras.version import __version__

from .scene.quality import QUALITIES

_EXAMPLE = """
examples:
  lime-render corpus --split train --count 512
  lime-render corpus --split test --count 128
  lime-render corpus --split train --count 10000 --shapes meshes/ --environments hdris/
  lime-render corpus --verify
  lime-render corpus --preview
  lime-render corpus --split test --layers 12

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
    out.add_argument(
        "--split",
        choices=SPLITS,
        help="which half of the corpus; --verify and --preview take all that there are",
    )
    out.add_argument("--count", type=_positive, help="number of examples to render")
    looks = out.add_argument_group("instead of rendering").add_mutually_exclusive_group()
    looks.add_argument(
        "--verify",
        action="store_true",
        help="check files, counts, checksums and every record: that layers recompose to the image, "
        "that the stored light shades the stored normals, and more",
    )
    looks.add_argument(
        "--preview",
        action="store_true",
        help="draw OUT/SPLIT/preview.png, a contact sheet, and histograms.png, what was sampled "
        "beside what should have been",
    )
    looks.add_argument(
        "--layers",
        type=_index,
        metavar="INDEX",
        help="write one example as OpenEXR layers: OUT/SPLIT/example-INDEX.exr and its environment",
    )
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
        "--unusable",
        choices=("refuse", "skip"),
        default="refuse",
        help="what to do about files of these folders that cannot be used; they are told by name, "
        "with the reason (default: refuse to begin)",
    )
    out.add_argument(
        "--quality",
        choices=tuple(QUALITIES),
        default="fast",
        help="reference converges, and takes many times as long (default: fast)",
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
    machines = out.add_mutually_exclusive_group()
    machines.add_argument(
        "--workers", type=_positive, default=os.cpu_count(), help="processes (default: all cores)"
    )
    machines.add_argument(
        "--ray",
        metavar="ADDRESS",
        help="render on the Ray cluster at this address (HOST:PORT, or auto) instead, whose nodes "
        "must share OUT and the folders above",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


_LOOKING = ("out", "split", "verify", "preview", "layers")


def main(argv: list[str] | None = None) -> int:
    """Render one split of a corpus, or look at what was rendered; returns the exit status."""
    parsing = parser()
    options = parsing.parse_args(argv)
    looking = options.verify or options.preview
    if not looking and options.split is None:
        parsing.error("--split is needed: train or test")
    if looking or options.layers is not None:
        for name, value in vars(options).items():
            if name not in _LOOKING and value != parsing.get_default(name):
                parsing.error(f"--{name.replace('_', '-')} is for rendering alone")
        return console.run(lambda: _look(options), "nothing of the corpus was changed")
    if options.count is None:
        parsing.error("--count is needed: how many examples to render")
    return console.run(
        lambda: _render(options), "the same command goes on with the shards that are missing"
    )


def _look(options: argparse.Namespace) -> int:
    """Verify, preview or export what was rendered."""
    if options.layers is not None:
        console.import_tensorflow()
        from .inspect import layers

        out = layers.default_path(options.out, options.split, options.layers)
        layers.export(options.out, options.split, options.layers, out)
        print(out)
        print(layers.environment_path(out))
        return 0
    console.import_tensorflow()
    # Claimed is enough: that a split was never completed is for --verify to tell.
    splits = [options.split] if options.split else _splits(options.out)
    return max(
        [
            _verify(options.out, split) if options.verify else _preview(options.out, split)
            for split in splits
        ]
    )


def _splits(out: Path) -> list[str]:
    found = [split for split in SPLITS if (out / split / "description.json").is_file()]
    if not found:
        raise ValueError(f"{out} holds no corpus: render one with --split and --count")
    return found


def _verify(out: Path, split: str) -> int:
    from .inspect import verification

    with _Bar(f"verify {split}", "example") as bar:
        faults = verification.verify(out, split, bar.move)
    for line in faults.lines():
        print(line, file=sys.stderr)
    summary = f"{faults.examples} examples in {out / split}"
    found = f"{faults.count} fault{'s' if faults.count > 1 else ''}"
    print(f"{summary}: {found if faults.count else 'sound'}")
    return 1 if faults.count else 0


def _preview(out: Path, split: str) -> int:
    from .inspect import preview

    with _Bar(f"preview {split}", "example") as bar:
        paths = preview.preview(out, split, bar.move)
    for path in paths:
        print(path)
    return 0


def _render(options: argparse.Namespace) -> int:
    from .corpus import shards
    from .mitsuba_setup import variants

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
        quality=options.quality,
        shading=options.shading,
        variant=choice.variant,
        **folders,
    )
    with (
        _Bar("files", "file") as checked,
        _Bar("rooms", "room") as rooms,
        _Bar(options.split, "example") as rendered,
    ):
        manifest = shards.render_split(
            options.out,
            description,
            choice,
            workers=options.workers,
            ray=options.ray,
            skip_unusable=options.unusable == "skip",
            on_input=checked.move,
            on_room=rooms.move,
            on_example=rendered.move,
        )
    for repair in manifest["repaired"]:
        print(f"repaired: {repair}", file=sys.stderr)
    for kind, skipped in manifest["skipped"].items():
        for name, reason in skipped.items():
            print(f"skipped: {kind}: {name}: {reason}", file=sys.stderr)
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


def _index(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is not at least 0")
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
