"""Options that the commands of `lime-render` share."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.data.corpus import SPLITS, Split


def add_command(
    subparsers: Any,
    name: str,
    run: Callable[[argparse.Namespace], int],
    description: str,
    examples: str,
    interrupted: str = "nothing of the corpus was changed",
) -> argparse.ArgumentParser:
    """Add a command and return its parser.

    Args:
        subparsers: what `ArgumentParser.add_subparsers` returns.
        name: first argument of the command.
        run: function that takes the options and returns the exit status.
        description: what the command does, in a few sentences.
        examples: indented lines of commands.
        interrupted: message after Ctrl-C.
    """
    command = subparsers.add_parser(
        name,
        description=description,
        epilog=f"examples:\n{examples}",
        formatter_class=console.Help,
    )
    command.set_defaults(run=run, interrupted=interrupted)
    return command


def add_folder(command: argparse.ArgumentParser) -> None:
    """Add the folder of a corpus, and the split."""
    command.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    command.add_argument("--split", choices=SPLITS, help="which half of it (default: both)")


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
