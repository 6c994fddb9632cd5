"""`lime-render OUT`: render one split of a corpus."""

import argparse
from pathlib import Path

from lime_keras import console
from lime_keras.data.corpus import LOBES, Split

from ..scene.quality import QUALITIES
from . import options as shared

INTERRUPTED = "the same command goes on with the shards that are missing"


def add_options(out: argparse.ArgumentParser) -> None:
    """Add the options for rendering."""
    out.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    contents = shared.add_contents(out, "examples")
    contents.add_argument(
        "--size", type=shared.size, default=256, help="height and width in pixels (default: 256)"
    )
    contents.add_argument(
        "--materials",
        choices=shared.MATERIALS,
        default=shared.MATERIALS[0],
        help="law of the materials: the paper's, or as common objects have them (default: uniform)",
    )
    contents.add_argument(
        "--lobe",
        dest="shading",
        choices=LOBES,
        default=LOBES[0],
        help="S normalised to the white furnace, or Eq. 3 as printed, which gives m_s in the "
        "paper's unit (default: furnace)",
    )
    contents.add_argument(
        "--light-law",
        choices=shared.LIGHT_LAWS,
        help="mixed: each light is made of maps, rooms, skies and lamps, and crops and backgrounds "
        "vary more; maps: each light is one map, as the paper has it (default: mixed for training, "
        "maps for test)",
    )
    contents.add_argument(
        "--endless",
        type=shared.share,
        metavar="SHARE",
        help="share of the bodies that are made for eight examples alone: random shapes, and those "
        "of --shapes deformed; 0 to 1 (default: 0.5 for training, 0 for test)",
    )
    contents.add_argument(
        "--quality",
        choices=tuple(QUALITIES),
        default="fast",
        help="reference converges, and takes many times as long (default: fast)",
    )
    contents.add_argument(
        "--lights",
        choices=("unseen", "known"),
        default="unseen",
        help="of a test split: lights of its own, or those of the train split, newly turned, as "
        "the paper tests (default: unseen)",
    )
    contents.add_argument(
        "--shape-count",
        type=console.count,
        metavar="N",
        help="of the built-in shapes (default: 400 for training, 100 for test)",
    )
    contents.add_argument(
        "--light-count",
        type=console.count,
        metavar="N",
        help="of the built-in rooms (default: 40 for training, 12 for test)",
    )
    shared.add_inputs(
        out,
        shapes="instead of the built-in shapes",
        environments="environment maps (HDR, EXR; equirectangular) instead of the built-in rooms; "
        "mixed lights have rooms and skies beside them",
    )
    speed = out.add_argument_group("speed")
    machines = speed.add_mutually_exclusive_group()
    shared.add_workers(machines)
    machines.add_argument(
        "--ray",
        metavar="ADDRESS",
        help="render on the Ray cluster at this address (HOST:PORT, or auto); its nodes must share "
        "OUT and the input folders",
    )
    shared.add_device(speed)
    shared.add_shard_size(speed, "examples", " (default: a twentieth of the count, at most 512)")


def run(options: argparse.Namespace) -> int:
    """Render the split and return the exit status."""
    _check(options)
    console.check_folder(options.out, "OUT")
    console.require("lime-render", *console.EXTRAS["render"], "tensorflow")
    from .. import cards
    from ..corpus.split import render_split
    from ..jobs.description import Description

    begun = Split(options.out, options.split).description_path
    choice = shared.chosen_variant(begun, options.device)
    light_law, endless = _laws(options)
    description = Description(
        quality=options.quality,
        shading=options.shading,
        variant=choice.variant,
        materials=options.materials,
        light_split="train" if options.lights == "known" else None,
        shape_count=options.shape_count,
        light_count=options.light_count,
        light_law=light_law,
        endless=endless,
        **shared.described(options, 512),
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
            ray=options.ray,
            skip_unusable=options.unusable == "skip",
            on_input=checked.move,
            on_room=rooms.move,
            on_example=rendered.move,
        )
    cards.write(options.out)
    shared.print_remarks(manifest, "example")
    print(f"{manifest['examples']} examples in {options.out / options.split}")
    return 0


def _check(options: argparse.Namespace) -> None:
    """Raise ValueError for options that contradict each other."""
    if options.lights == "known" and options.split != "test":
        raise ValueError("--lights known is of a test split: pass --split test, or leave it out")
    for count, folder in (("shape_count", "shapes"), ("light_count", "environments")):
        if getattr(options, count) is not None and getattr(options, folder) is not None:
            raise ValueError(
                f"--{count.replace('_', '-')} is of what is built in: leave it out beside "
                f"--{folder}, whose files are all used"
            )


def _laws(options: argparse.Namespace) -> tuple[str, float]:
    """Return the law of the lights and the share of endless bodies.

    Raises:
        ValueError: if a test split is asked for with anything but maps and shapes as they are.
    """
    is_test = options.split == "test"
    mixed, maps = shared.LIGHT_LAWS
    law = options.light_law or (maps if is_test else mixed)
    share = options.endless if options.endless is not None else (0.0 if is_test else 0.5)
    if is_test and (law != maps or share):
        raise ValueError(
            "--split test has single maps and shapes as they are, so that scores can be compared: "
            "leave out --light-law and --endless"
        )
    return law, share
