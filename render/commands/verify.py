"""`lime-render verify`: check a corpus."""

import argparse
import sys
from collections import defaultdict
from typing import Any

from lime_keras import console
from lime_keras.data.corpus import Split

from . import options as shared

_LISTED = 10  # number of faults of a kind that are told in words


def add(subparsers: Any) -> None:
    """Add the command's parser."""
    command = shared.add_command(
        subparsers,
        "verify",
        run,
        "Check files, counts, checksums and every record: that layers recompose to the image, that "
        "the stored light shades the stored normals, and more. Exit status 1 if anything is wrong.",
        "  lime-render verify corpus\n  lime-render verify corpus --split test",
    )
    shared.add_folder(command)


def run(options: argparse.Namespace) -> int:
    """Check what the folder holds and return the exit status: 1 if anything is wrong."""
    console.import_tensorflow()
    return max([_verify(split) for split in shared.splits(options.corpus, options.split)])


def _verify(split: Split) -> int:
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
    told = f"{count} fault{'s' if count > 1 else ''}" if count else "sound"
    print(f"{examples} examples in {split.folder}: {told}")
    return int(count > 0)
