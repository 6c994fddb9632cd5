"""Options, kinds of numbers and messages that the commands of `lime-render` share."""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lime_keras import console, processors
from lime_keras.data.corpus import SPLITS, Split

if TYPE_CHECKING:
    from ..mitsuba_setup.variants import Choice

MATERIALS = ("uniform", "natural")  # `material_law.LAWS`, without NumPy
LIGHT_LAWS = ("mixed", "maps")  # `sources.LIGHT_LAWS`, without NumPy
_MESHES = "meshes (OBJ, PLY, STL, GLB)"  # `meshes.EXTENSIONS`, without trimesh
index, seed, size = console.whole(0), console.whole(0, 2**63 - 1), console.whole(32, multiple=32)
"""Kinds of numbers: of an example; a seed; of pixels."""
GOES_ON = "the same command goes on with what is missing"
"""The message after Ctrl-C of a command that can be resumed."""


def share(text: str) -> float:
    """Parse an option that is a share, 0 to 1."""
    value = float(text)
    if not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"{text} is not in 0 … 1")
    return value


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


def add_contents(out: argparse.ArgumentParser, unit: str) -> "argparse._ArgumentGroup":
    """Add and return the group of options that say how much is drawn, from which seed."""
    contents = out.add_argument_group("contents")
    contents.add_argument("--split", choices=SPLITS, required=True, help="which half of the data")
    contents.add_argument(
        "--count", type=console.count, required=True, help=f"number of {unit} to render"
    )
    contents.add_argument("--seed", type=seed, default=0, help="of everything random (default: 0)")
    return contents


def add_inputs(out: argparse.ArgumentParser, *, shapes: str, environments: str) -> None:
    """Add the folders that a corpus is made from; the texts say what they replace."""
    given = out.add_argument_group(
        "input",
        "A fifth of the files of --shapes and --environments is kept for the test split. Folders "
        "with subfolders train and test are split by these.",
    )
    given.add_argument("--shapes", type=Path, metavar="DIR", help=f"{_MESHES} {shapes}")
    given.add_argument("--environments", type=Path, metavar="DIR", help=environments)
    given.add_argument(
        "--backgrounds",
        type=Path,
        metavar="DIR",
        help="pictures to put behind the objects instead of random textures",
    )
    given.add_argument(
        "--unusable",
        choices=("refuse", "skip"),
        default="refuse",
        help="what to do about files of these folders that cannot be used; each is named with the "
        "reason (default: refuse to begin)",
    )


def add_workers(out: Any) -> None:
    """Add the number of processes to a parser or a group."""
    out.add_argument(
        "--workers",
        type=console.count,
        default=processors.count(),
        help="processes (default: all cores that this process may use)",
    )


def add_shard_size(out: Any, unit: str, default: str) -> None:
    """Add the number of things in a file to a parser or a group."""
    out.add_argument(
        "--shard-size",
        type=console.count,
        metavar="N",
        help=f"{unit} in a file{default}",
    )


def add_device(out: Any) -> None:
    """Add the choice of the device to a parser or a group."""
    out.add_argument(
        "--device",
        choices=("cpu", "cuda"),  # `variants.DEVICES`
        help="what renders: the processor, or an NVIDIA GPU (default: a GPU that works, or the one "
        "that a corpus was begun with)",
    )


def chosen_variant(description: Path, device: str | None = None) -> "Choice":
    """Choose a variant of Mitsuba, and tell it; what was begun with another one goes on with that.

    Args:
        description: file of the description with which a folder was begun; it need not exist.
        device: one of `variants.DEVICES`; None for the one with which the folder was begun, or for
            whichever works.

    Raises:
        RuntimeError: if the device cannot render here.
    """
    from ..jobs import resuming
    from ..mitsuba_setup import variants

    begun = (resuming.read_description(description) or {}).get("variant")
    if begun is not None and device is None:
        device = variants.device_of(begun)
    choice = variants.choose(device)
    if begun == variants.SLOW and device == variants.CPU_DEVICE:
        # It was begun without a libLLVM: its other shards need the same variant.
        choice = variants.Choice(variants.SLOW, None)
    print(choice.explain(), file=sys.stderr)
    return choice


def described(options: argparse.Namespace, most: int) -> dict[str, Any]:
    """Return what the options say of a description: contents, shards and the user's folders.

    Args:
        options: parsed options.
        most: largest number of things in a shard where `--shard-size` does not say.
    """
    named = {name: getattr(options, name) for name in ("split", "count", "seed", "size")}
    return named | {"shard_size": shard_size(options, most)} | _folders(options)


def shard_size(options: argparse.Namespace, most: int) -> int:
    """Return the number of things in a shard; `most` as for `described`."""
    return options.shard_size or min(most, -(-options.count // 20))


def _folders(options: argparse.Namespace) -> dict[str, str | None]:
    """Return the user's folders by kind; None for a built-in kind."""
    return {
        name: str(folder.resolve()) if (folder := getattr(options, name)) else None
        for name in ("shapes", "environments", "backgrounds")
    }


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


def print_remarks(manifest: Mapping[str, Any], unit: str) -> None:
    """Print what was repaired, skipped and replaced."""
    for repair in manifest["repaired"]:
        print(f"repaired: {repair}", file=sys.stderr)
    for kind, skipped in manifest["skipped"].items():
        for name, reason in skipped.items():
            print(f"skipped: {kind}: {name}: {reason}", file=sys.stderr)
    for failure in manifest["failures"]:
        print(f"replaced: {unit} {failure['index']}: {failure['error']}", file=sys.stderr)
