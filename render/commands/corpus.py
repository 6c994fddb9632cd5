"""`lime-render OUT`: render one split of a corpus."""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lime_keras import console, processors
from lime_keras.data.corpus import LOBES, SPLITS, Split

from ..scene.quality import QUALITIES

if TYPE_CHECKING:
    from ..mitsuba_setup.variants import Choice

INTERRUPTED = "the same command goes on with the shards that are missing"
_MATERIALS = ("uniform", "natural")  # `material_law.LAWS`, without NumPy
_LIGHT_LAWS = ("mixed", "maps")  # `sources.LIGHT_LAWS`, without NumPy
_MOST_IN_A_SHARD = 512


def add_options(out: argparse.ArgumentParser) -> None:
    """Add the options for rendering."""
    out.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    _add_contents(out.add_argument_group("contents"))
    _add_inputs(
        out.add_argument_group(
            "input",
            "A fifth of the files of --shapes and --environments is kept for the test split. "
            "Folders with subfolders train and test are split by these.",
        )
    )
    _add_speed(out.add_argument_group("speed"))


def _add_contents(out: Any) -> None:
    """Add the options of what is drawn, and how much of it."""
    out.add_argument("--split", choices=SPLITS, required=True, help="which half of the data")
    out.add_argument(
        "--count", type=console.count, required=True, help="number of examples to render"
    )
    out.add_argument(
        "--seed",
        type=console.whole(0, 2**63 - 1),
        default=0,
        help="of everything random (default: 0)",
    )
    out.add_argument(
        "--size",
        type=console.whole(32, multiple=32),
        default=256,
        help="height and width in pixels (default: 256)",
    )
    # Laws.
    out.add_argument(
        "--materials",
        choices=_MATERIALS,
        default=_MATERIALS[0],
        help="law of the materials: the paper's, or as common objects have them (default: uniform)",
    )
    out.add_argument(
        "--lobe",
        dest="shading",
        choices=LOBES,
        default=LOBES[0],
        help="S normalised to the white furnace, or Eq. 3 as printed, which gives m_s in the "
        "paper's unit (default: furnace)",
    )
    out.add_argument(
        "--light-law",
        choices=_LIGHT_LAWS,
        help="mixed: each light is made of maps, rooms, skies and lamps, and crops and backgrounds "
        "vary more; maps: each light is one map, as the paper has it (default: mixed for training, "
        "maps for test)",
    )
    out.add_argument(
        "--endless",
        type=_share,
        metavar="SHARE",
        help="share of the bodies that are random shapes, each made for eight examples alone; 0 to "
        "1 (default: 0.25 for training, 0 for test)",
    )
    out.add_argument(
        "--quality",
        choices=tuple(QUALITIES),
        default="fast",
        help="reference converges, and takes many times as long (default: fast)",
    )
    out.add_argument(
        "--lights",
        choices=("unseen", "known"),
        default="unseen",
        help="of a test split: lights of its own, or those of the train split, newly turned, as "
        "the paper tests, beside a train split of --light-law maps (default: unseen)",
    )
    # What is built in.
    out.add_argument(
        "--shape-count",
        type=console.count,
        metavar="N",
        help="of the built-in shapes (default: 400 for training, 100 for test)",
    )
    out.add_argument(
        "--light-count",
        type=console.count,
        metavar="N",
        help="of the built-in rooms (default: 40 for training, 12 for test)",
    )


def _add_inputs(out: Any) -> None:
    """Add the user's folders."""
    out.add_argument(
        "--shapes",
        type=Path,
        metavar="DIR",
        help="meshes (OBJ, PLY, STL, GLB) instead of the built-in shapes",  # `meshes.EXTENSIONS`
    )
    out.add_argument(
        "--environments",
        type=Path,
        metavar="DIR",
        help="environment maps (HDR, EXR; equirectangular) instead of the built-in rooms; mixed "
        "lights have rooms and skies beside them",
    )
    out.add_argument(
        "--backgrounds",
        type=Path,
        metavar="DIR",
        help="pictures to put behind the objects instead of random textures",
    )
    out.add_argument(
        "--unusable",
        choices=("refuse", "skip"),
        default="refuse",
        help="what to do about files of these folders that cannot be used; each is named with the "
        "reason (default: refuse to begin)",
    )


def _add_speed(out: Any) -> None:
    """Add the options of processes, machines and files."""
    out.add_argument(
        "--workers",
        type=console.count,
        default=processors.count(),
        help="processes (default: all cores that this process may use)",
    )
    out.add_argument(
        "--part",
        type=_part,
        default=(1, 1),
        metavar="K/N",
        help="render the Kth of N parts of the shards: machines that share OUT and the input "
        "folders may each render another part (default: all)",
    )
    out.add_argument(
        "--shard-size",
        type=console.count,
        metavar="N",
        help="examples in a file, which above 512 share bodies and lights with more than seven "
        "others (default: a twentieth of the count, at most 512)",
    )


def _share(text: str) -> float:
    """Parse an option that is a share, 0 to 1."""
    value = float(text)
    if not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"{text} is not in 0 … 1")
    return value


def _part(text: str) -> tuple[int, int]:
    """Parse an option that is a part, K/N: K of 1 … N."""
    number, _, parts = text.partition("/")
    if not (number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text} is no part K/N, with K of 1 … N, such as 2/4")
    return int(number), int(parts)


def run(options: argparse.Namespace) -> int:
    """Render the split and return the exit status."""
    _check(options)
    console.check_folder(options.out, "OUT")
    console.require("lime-render", *console.EXTRAS["render"], "tensorflow")
    from .. import cards
    from ..corpus.split import render_split
    from ..jobs.description import Description, Job

    begun = Split(options.out, options.split).description_path
    choice = choose_variant(begun)
    light_law, endless = _laws(options)
    folders = {
        name: str(folder.resolve()) if (folder := getattr(options, name)) else None
        for name in ("shapes", "environments", "backgrounds")
    }
    description = Description(
        split=options.split,
        count=options.count,
        seed=options.seed,
        size=options.size,
        shard_size=options.shard_size or min(_MOST_IN_A_SHARD, -(-options.count // 20)),
        quality=options.quality,
        shading=options.shading,
        variant=choice.variant,
        materials=options.materials,
        light_split="train" if options.lights == "known" else None,
        shape_count=options.shape_count,
        light_count=options.light_count,
        light_law=light_law,
        endless=endless,
        **folders,
    )
    with (
        console.Bar("files", "file") as checked,
        console.Bar("rooms", "room") as rooms,
        console.Bar(options.split, "example") as rendered,
    ):
        manifest = render_split(
            options.out,
            description,
            choice,
            workers=options.workers,
            part=options.part,
            skip_unusable=options.unusable == "skip",
            on_input=checked.move,
            on_room=rooms.move,
            on_example=rendered.move,
        )
    if manifest is None:
        left = Job(options.out, description, choice).missing(range(description.shards))
        print(
            f"{description.shards - len(left)} of {description.shards} shards are there; the last "
            "part to end writes the manifest"
        )
        return 0
    cards.write(options.out)
    _print_remarks(manifest)
    print(f"{manifest['examples']} examples in {options.out / options.split}")
    return 0


def _check(options: argparse.Namespace) -> None:
    """Raise ValueError for options that contradict each other."""
    if options.lights == "known" and options.split != "test":
        raise ValueError("--lights known is of a test split: pass --split test, or leave it out")
    if options.materials == "natural" and options.shading == "printed":
        raise ValueError(
            "natural materials have m_s in the unit of furnace: leave out --lobe printed"
        )
    # Of mixed lights, rooms are a part beside files.
    shapes, maps = options.shapes, options.environments and _laws(options)[0] != _LIGHT_LAWS[0]
    for option, beside, does, is_void in (
        ("--shape-count", "--shapes", "changes nothing", shapes and options.shape_count),
        ("--endless 1", "--shapes", "shows no file", shapes and options.endless == 1),
        ("--light-count", "--environments", "changes nothing", maps and options.light_count),
    ):
        if is_void:
            raise ValueError(f"{option} {does} beside {beside}: pass one of the two")


def _laws(options: argparse.Namespace) -> tuple[str, float]:
    """Return the law of the lights and the share of endless bodies, of which test has neither."""
    is_test = options.split == "test"
    mixed, maps = _LIGHT_LAWS
    law = options.light_law or (maps if is_test else mixed)
    share = options.endless if options.endless is not None else (0.0 if is_test else 0.25)
    if is_test and (law != maps or share):
        raise ValueError(
            "--split test has single maps and shapes as they are, so that scores can be compared: "
            "leave out --light-law and --endless"
        )
    return law, share


def choose_variant(description: Path) -> "Choice":
    """Choose a variant of Mitsuba, and tell it; what was begun with the slow one goes on with that.

    Args:
        description: file of the description with which a folder was begun; it need not exist.
    """
    from ..jobs import resuming
    from ..mitsuba_setup import variants

    choice = variants.choose()
    if (resuming.read_description(description) or {}).get("variant") == variants.SLOW:
        # It was begun without a libLLVM: its other shards need the same variant.
        choice = variants.Choice(variants.SLOW, None)
        told = f"going on with {variants.SLOW}, with which {description.parent} was begun"
    else:
        told = choice.explain()
    print(told, file=sys.stderr)
    return choice


def _print_remarks(manifest: Mapping[str, Any]) -> None:
    """Print what was repaired, skipped and replaced."""
    for repair in manifest["repaired"]:
        print(f"repaired: {repair}", file=sys.stderr)
    for kind, skipped in manifest["skipped"].items():
        for name, reason in skipped.items():
            print(f"skipped: {kind}: {name}: {reason}", file=sys.stderr)
    for failure in manifest["failures"]:
        print(f"replaced: example {failure['index']}: {failure['error']}", file=sys.stderr)
