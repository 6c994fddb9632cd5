"""The commands of `lime-render` beside rendering: what looks at a corpus, and `views`."""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.data.corpus import SPLITS, Split

_LISTED = 10  # number of faults of a kind that are told in words


def add(subparsers: Any) -> None:
    """Add the parsers of all commands to what `ArgumentParser.add_subparsers` returns.

    Each command sets two options: `run`, its function, and `interrupted`, its message after Ctrl-C.
    """

    def command(
        name: str,
        run: Callable[[argparse.Namespace], int],
        description: str,
        examples: str,
        interrupted: str = "nothing of the corpus was changed",
    ) -> argparse.ArgumentParser:
        parser = subparsers.add_parser(
            name,
            description=description,
            epilog=f"examples:\n{examples}",
            formatter_class=console.Help,
        )
        parser.set_defaults(run=run, interrupted=interrupted)
        return parser

    verify = command(
        "verify",
        _verify,
        "Check files, counts, checksums and every record: that layers recompose to the image, that "
        "the stored light shades the stored normals (not M), and more. Exit status 1 if anything "
        "is wrong.",
        "  lime-render verify corpus\n  lime-render verify corpus --split test",
    )
    preview = command(
        "preview",
        _preview,
        "Draw CORPUS/SPLIT/preview.png, a contact sheet.",
        "  lime-render preview corpus\n  lime-render preview corpus --split test",
    )
    layers = command(
        "layers",
        _layers,
        "Write one example as OpenEXR layers, and its environment beside them.",
        "  lime-render layers corpus 12 --split test\n"
        "  lime-render layers corpus 12 --split test --out example.exr",
    )
    images = command(
        "images",
        _images,
        "Write the images of the test split, 00000.png and so on, without the truth, for another "
        "system to answer (lime-eval --predictions).",
        "  lime-render images corpus images/\n"
        "  lime-eval corpus --predictions answers/ --out results",
        "the same command goes on with the images that are missing",
    )
    views = command(
        "views",
        _views,
        "Take pictures inside the HDR maps of the train split, for lime-render --backgrounds. The "
        "same maps give the same pictures.",
        "  lime-render views hdris/ views/",
        "run again, it writes all of the pictures anew",
    )
    for one in (verify, preview, layers, images):
        one.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    for one in (verify, preview):
        one.add_argument("--split", choices=SPLITS, help="which half of it (default: both)")
    layers.add_argument(
        "index", type=console.whole(0), metavar="INDEX", help="of the example in the split"
    )
    layers.add_argument("--split", choices=SPLITS, required=True, help="which half of the corpus")
    layers.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="an .exr file (default: CORPUS/SPLIT/example-INDEX.exr)",
    )
    images.add_argument("out", type=Path, metavar="OUT", help="folder of the images")
    views.add_argument(
        "maps", type=Path, metavar="HDRIS", help="folder of maps, as of lime-render --environments"
    )
    views.add_argument("out", type=Path, metavar="OUT", help="folder of the pictures")
    views.add_argument(
        "--count", type=console.count, default=16, help="pictures of each map (default: 16)"
    )


def _splits(options: argparse.Namespace) -> list[Split]:
    """Return the split that is asked for, or all whose rendering was begun, complete or not."""
    if options.split is not None:
        return [Split(options.corpus, options.split)]
    every = [Split(options.corpus, name) for name in SPLITS]
    begun = [split for split in every if split.description_path.is_file()]
    if not begun:
        raise ValueError(f"{options.corpus} holds no corpus: render one with --split and --count")
    return begun


def _verify(options: argparse.Namespace) -> int:
    """Check what the folder holds and return the exit status: 1 if anything is wrong."""
    console.require("lime-render verify", *console.EXTRAS["render"], "tensorflow")
    console.import_tensorflow()
    return max([_verify_split(split) for split in _splits(options)])


def _verify_split(split: Split) -> int:
    """Check a split, print its faults by kind and their number, and return the exit status."""
    from ..inspect import verification

    found, examples = defaultdict[str, list[str]](list), 0
    with console.Bar(f"verify {split.name}", "example") as bar:

        def on_example(done: int, total: int) -> None:
            nonlocal examples
            examples = done
            bar.move(done, total)

        for kind, text in verification.verify(split.corpus, split.name, on_example):
            found[kind].append(text)
    for kind, texts in found.items():
        for text in texts[:_LISTED]:
            print(f"{kind}: {text}", file=sys.stderr)
        if len(texts) > _LISTED:
            print(f"{kind}: … and {len(texts) - _LISTED} more", file=sys.stderr)
    count = sum(map(len, found.values()))
    verdict = f"{count} fault{'s' if count > 1 else ''}" if count else "sound"
    print(f"{examples} examples in {split.folder}: {verdict}")
    return int(count > 0)


def _preview(options: argparse.Namespace) -> int:
    """Draw the contact sheets and return the exit status."""
    console.import_tensorflow()
    from ..inspect import contact_sheet

    splits = _splits(options)
    complete = [split for split in splits if split.manifest_path.is_file()]
    for split in complete or splits:
        with console.Bar(f"preview {split.name}", "example") as bar:
            path = contact_sheet.write(split.corpus, split.name, bar.move)
        print(path)
    return 0


def _layers(options: argparse.Namespace) -> int:
    """Write the layers and return the exit status."""
    console.import_tensorflow()
    from ..inspect import exr_layers

    folder = Split(options.corpus, options.split).folder
    out = options.out or folder / f"example-{options.index:06d}.exr"
    exr_layers.export(options.corpus, options.split, options.index, out)
    print(out)
    print(exr_layers.environment_path(out))
    return 0


def _images(options: argparse.Namespace) -> int:
    """Write the images and return the exit status."""
    console.check_folder(options.out, "OUT")
    console.import_tensorflow()
    from ..inspect import images

    with console.Bar("images", "image") as bar:
        count = images.write(options.corpus, options.out, bar.move)
    print(f"{count} images in {options.out}")
    return 0


def _views(options: argparse.Namespace) -> int:
    """Write the pictures and return the exit status."""
    console.check_folder(options.out, "OUT")
    console.require("lime-render views", *console.EXTRAS["render"])
    from ..scene import map_views

    with console.Bar("views", "picture") as bar:
        map_views.write_views(options.maps, options.out, options.count, bar.move)
    return 0
