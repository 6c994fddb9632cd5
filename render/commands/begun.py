"""What a folder holds that was begun: a bank, or which splits of a corpus."""

import argparse
from pathlib import Path

from lime_keras.data.corpus import SPLITS, Split


def add_options(command: argparse.ArgumentParser) -> None:
    """Add the folder of a corpus or a bank, and the split."""
    command.add_argument(
        "corpus", type=Path, metavar="CORPUS|BANK", help="folder of the corpus or the bank"
    )
    command.add_argument("--split", choices=SPLITS, help="of a corpus (default: both)")


def is_bank(options: argparse.Namespace) -> bool:
    """Return whether the folder holds a bank, or the beginning of one.

    Raises:
        ValueError: if a split of it is asked for.
    """
    from lime_keras.synthesis import bank

    from ..jobs import resuming

    folder = options.corpus
    begun = resuming.held(folder / "description.json") or {}
    found = bank.is_bank(folder) or begun.get("format") == bank.FORMAT
    if found and options.split:
        raise ValueError(f"{folder} is a bank, which has one split: leave out --split")
    return found


def splits(corpus: Path, name: str | None) -> list[Split]:
    """Return the split of that name, or without a name all splits whose rendering was begun.

    A split that is not complete is included: `verify` reports it.

    Raises:
        ValueError: if no split was begun.
    """
    if name is not None:
        return [Split(corpus, name)]
    every = [Split(corpus, name) for name in SPLITS]
    begun = [split for split in every if split.description_path.is_file()]
    if not begun:
        raise ValueError(f"{corpus} holds no corpus: render one with --split and --count")
    return begun
