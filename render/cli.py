"""The command `lime-render`: render a corpus, verify it, preview it, export its examples."""

import argparse
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.data.corpus import SPLITS, Split
from lime_keras.version import __version__

from .scene.quality import QUALITIES

COMMANDS = ("verify", "preview", "layers", "images", "views", "bank", "scenes")
"""First arguments that name a command; any other first argument is the folder of a corpus."""
_MATERIALS = ("uniform", "natural")  # `material_law.LAWS`, without NumPy
_EXAMPLE = """
other commands, each with a --help of its own:
  lime-render bank OUT              render a bank of geometry and light, to train from
  lime-render scenes BANK OUT       make a corpus of a bank's scenes, to train on processors
  lime-render verify CORPUS|BANK    check files, checksums and every record or entry
  lime-render preview CORPUS|BANK   draw a contact sheet, and histograms of a corpus
  lime-render layers CORPUS INDEX   write one example as OpenEXR layers
  lime-render images CORPUS OUT     write the images of the test split, for other systems
  lime-render views HDRIS OUT       take pictures inside HDR maps, for --backgrounds
For a corpus with one of these names, write its path: ./verify.

examples:
  lime-render corpus --split train --count 512
  lime-render corpus --split test --count 128
  lime-render corpus --split train --count 10000 --shapes meshes/ --environments hdris/
  lime-render corpus --split train --count 4000 --size 128 --materials natural
  lime-render verify corpus

An interrupted command, run again, goes on where it stopped. The same seed gives the same bytes,
whatever the number of workers.

More: docs/how-to/corpus.md, docs/how-to/banks.md, docs/how-to/machines.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options for rendering."""
    out = argparse.ArgumentParser(
        prog="lime-render",
        usage="lime-render OUT --split {train,test} --count COUNT [options]\n"
        f"       lime-render {{{','.join(COMMANDS)}}} ...",
        description="Render images of single objects with their mask, diffuse and specular "
        "shading, mirror image, normals, environment and material, as TFRecords.",
        epilog=_EXAMPLE,
        formatter_class=console.Help,
    )
    out.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    contents = _add_contents(out, "examples")
    contents.add_argument(
        "--size", type=_size, default=256, help="height and width in pixels (default: 256)"
    )
    contents.add_argument(
        "--materials",
        choices=_MATERIALS,
        default=_MATERIALS[0],
        help="law of the materials: the paper's, or as common objects have them (default: uniform)",
    )
    contents.add_argument(
        "--quality",
        choices=tuple(QUALITIES),
        default="fast",
        help="reference converges, and takes many times as long (default: fast)",
    )
    contents.add_argument(
        "--shading",
        choices=("furnace", "literal"),
        default="furnace",
        help="normalise shading to the white furnace, or store Eqs. 2 and 3 as printed; a model "
        "gives specular albedos in the unit of its corpus (default: furnace)",
    )
    _add_inputs(
        out,
        shapes="meshes (OBJ, PLY, STL, GLB) instead of the built-in shapes: 400 for training, 100 "
        "for test",
        environments="environment maps (HDR, EXR; equirectangular) instead of the built-in rooms: "
        "40 for training, 12 for test",
    )
    speed = out.add_argument_group("speed")
    machines = speed.add_mutually_exclusive_group()
    machines.add_argument(
        "--workers",
        type=console.count,
        default=os.cpu_count(),
        help="processes (default: all cores)",
    )
    machines.add_argument(
        "--ray",
        metavar="ADDRESS",
        help="render on the Ray cluster at this address (HOST:PORT, or auto); its nodes must share "
        "OUT and the input folders",
    )
    speed.add_argument(
        "--shard-size",
        type=console.count,
        metavar="N",
        help="examples in a file (default: a twentieth of the count, at most 512)",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def commands() -> argparse.ArgumentParser:
    """Return the parser of `COMMANDS`.

    Each command sets two options: `run`, its function, and `interrupted`, its message after Ctrl-C.
    """
    out = argparse.ArgumentParser(prog="lime-render")
    subparsers = out.add_subparsers(required=True)

    def add(
        name: str,
        run: Callable[[argparse.Namespace], int],
        description: str,
        examples: str,
        interrupted: str = "nothing of the corpus was changed",
    ) -> argparse.ArgumentParser:
        command = subparsers.add_parser(
            name,
            description=description,
            epilog=f"examples:\n{examples}",
            formatter_class=console.Help,
        )
        command.set_defaults(run=run, interrupted=interrupted)
        return command

    verify = add(
        "verify",
        _verify,
        "Check files, counts, checksums and every record: that layers recompose to the image, that "
        "the stored light shades the stored normals, and more. Of a bank, check every entry: that "
        "normals face the viewer, that lights shine with a mean of 1, and more. Exit status 1 if "
        "anything is wrong.",
        "  lime-render verify corpus\n  lime-render verify corpus --split test\n"
        "  lime-render verify bank",
    )
    preview = add(
        "preview",
        _preview,
        "Draw CORPUS/SPLIT/preview.png, a contact sheet, and histograms.png, what was sampled "
        "beside what should have been. Of a bank, draw BANK/preview.png, 100 G-buffers with lights "
        "and textures, and preview-lights.png, lights drawn from it.",
        "  lime-render preview corpus\n  lime-render preview corpus --split test\n"
        "  lime-render preview bank --out sheet.png",
    )
    layers = add(
        "layers",
        _layers,
        "Write one example as OpenEXR layers, and its environment beside them.",
        "  lime-render layers corpus 12 --split test\n"
        "  lime-render layers corpus 12 --split test --out example.exr",
    )
    layers.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    for command in (verify, preview):
        command.add_argument(
            "corpus", type=Path, metavar="CORPUS|BANK", help="folder of the corpus or the bank"
        )
        command.add_argument("--split", choices=SPLITS, help="of a corpus (default: both)")
    preview.add_argument(
        "--out", type=Path, metavar="PNG", help="of a bank (default: BANK/preview.png)"
    )
    layers.add_argument("index", type=_index, metavar="INDEX", help="of the example in the split")
    layers.add_argument("--split", choices=SPLITS, required=True, help="which half of the corpus")
    layers.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="an .exr file (default: CORPUS/SPLIT/example-INDEX.exr)",
    )
    images = add(
        "images",
        _images,
        "Write the images of the test split, 00000.png and so on, without the truth, for another "
        "system to answer (lime-eval --predictions).",
        "  lime-render images corpus images/\n"
        "  lime-eval corpus --predictions answers/ --out results",
        "the same command goes on with the images that are missing",
    )
    images.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of the corpus")
    images.add_argument("out", type=Path, metavar="OUT", help="folder of the images")
    views = add(
        "views",
        _views,
        "Take pictures inside the HDR maps of the train split, for lime-render --backgrounds. The "
        "same maps give the same pictures.",
        "  lime-render views hdris/ views/",
        "run again, it writes all of the pictures anew",
    )
    views.add_argument(
        "maps", type=Path, metavar="HDRIS", help="folder of maps, as of lime-render --environments"
    )
    views.add_argument("out", type=Path, metavar="OUT", help="folder of the pictures")
    views.add_argument(
        "--count", type=console.count, default=16, help="pictures of each map (default: 16)"
    )
    _add_bank_options(
        add(
            "bank",
            _bank,
            "Render a bank: compressed G-buffers of objects in random pose, size and crop, each "
            "deformed anew; lights; and textures. Training makes new scenes from it as it runs.",
            "  lime-render bank bank --split train --count 4000\n"
            "  lime-render bank bank --split train --count 20000 --shapes meshes/ "
            "--environments hdris/\n"
            "  lime-render verify bank\n\n"
            "An interrupted command, run again, goes on where it stopped; the same seed gives the "
            "same\nbytes whatever the number of workers.",
            "the same command goes on with what is missing",
        )
    )
    scenes = add(
        "scenes",
        _scenes,
        "Make scenes of a bank, as training does, and store them as the train split of a corpus. "
        "On a processor, reading them is ten times as fast as making them.",
        "  lime-render scenes bank corpus --count 20000\n"
        "  lime-train corpus --out runs/live --preset live",
        "the same command goes on with what is missing",
    )
    scenes.add_argument("bank", type=Path, metavar="BANK", help="folder of the bank")
    scenes.add_argument("out", type=Path, metavar="OUT", help="folder of the corpus")
    scenes.add_argument(
        "--count", type=console.count, required=True, help="number of examples to make"
    )
    scenes.add_argument("--seed", type=_seed, default=0, help="of everything random (default: 0)")
    scenes.add_argument(
        "--materials",
        choices=_MATERIALS,
        default=_MATERIALS[0],
        help="law of the materials; training may draw others (default: uniform)",
    )
    scenes.add_argument(
        "--shard-size",
        type=console.count,
        metavar="N",
        help="examples in a file, an even number (default: a twentieth of the count, at most 512)",
    )
    return out


def main(argv: list[str] | None = None) -> int:
    """Render one split of a corpus, or run one of `COMMANDS`, and return the exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    if arguments and arguments[0] in COMMANDS:
        options = commands().parse_args(arguments)
        return console.run(lambda: options.run(options), options.interrupted)
    rendering = parser()
    for name in COMMANDS:
        if any(argument.partition("=")[0] == f"--{name}" for argument in arguments):
            rendering.error(f"--{name} is no option but a command: lime-render {name} --help")
    options = rendering.parse_args(arguments)
    return console.run(
        lambda: _render(options), "the same command goes on with the shards that are missing"
    )


def _add_bank_options(bank: argparse.ArgumentParser) -> None:
    bank.add_argument("out", type=Path, metavar="OUT", help="folder of the bank")
    _add_contents(bank, "G-buffers").add_argument(
        "--size", type=_bank_size, default=128, help="height and width in pixels (default: 128)"
    )
    _add_inputs(
        bank,
        shapes="meshes (OBJ, PLY, STL, GLB) for half of the G-buffers; the others, and without a "
        "folder all, show procedural shapes, each a new one",
        environments="environment maps (HDR, EXR; equirectangular) beside the built-in rooms and "
        "skies: 88 for training, 24 for test",
    )
    speed = bank.add_argument_group("speed")
    speed.add_argument(
        "--workers",
        type=console.count,
        default=os.cpu_count(),
        help="processes (default: all cores)",
    )
    speed.add_argument(
        "--shard-size",
        type=console.count,
        metavar="N",
        help="G-buffers in a file (default: a twentieth of the count, at most 256)",
    )


def _add_contents(out: argparse.ArgumentParser, unit: str) -> "argparse._ArgumentGroup":
    """Add and return the group of options that say how much is drawn, from which seed."""
    contents = out.add_argument_group("contents")
    contents.add_argument("--split", choices=SPLITS, required=True, help="which half of the data")
    contents.add_argument(
        "--count", type=console.count, required=True, help=f"number of {unit} to render"
    )
    contents.add_argument("--seed", type=_seed, default=0, help="of everything random (default: 0)")
    return contents


def _add_inputs(out: argparse.ArgumentParser, *, shapes: str, environments: str) -> None:
    """Add the folders that a corpus and a bank are made from; the texts say what they replace."""
    given = out.add_argument_group(
        "input",
        "A fifth of the files of --shapes and --environments is kept for the test split. Folders "
        "with subfolders train and test are split by these.",
    )
    given.add_argument("--shapes", type=Path, metavar="DIR", help=shapes)
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


def _verify(options: argparse.Namespace) -> int:
    if _is_bank(options):
        return _verify_bank(options.corpus)
    console.import_tensorflow()
    from .inspect import verification

    status = 0
    for split in _splits(options.corpus, options.split):
        with console.Bar(f"verify {split.name}", "example") as bar:
            faults = verification.verify(options.corpus, split.name, bar.move)
        for line in faults.lines():
            print(line, file=sys.stderr)
        found = f"{faults.count} fault{'s' if faults.count > 1 else ''}"
        print(f"{faults.examples} examples in {split.folder}: {found if faults.count else 'sound'}")
        status = max(status, int(faults.count > 0))
    return status


def _preview(options: argparse.Namespace) -> int:
    if _is_bank(options):
        return _preview_bank(options.corpus, options.out or options.corpus / "preview.png")
    if options.out:
        raise ValueError(f"{options.corpus} is no bank: --out is for the preview of a bank")
    console.import_tensorflow()
    from .inspect import preview

    for split in _splits(options.corpus, options.split):
        with console.Bar(f"preview {split.name}", "example") as bar:
            paths = preview.preview(options.corpus, split.name, bar.move)
        for path in paths:
            print(path)
    return 0


def _is_bank(options: argparse.Namespace) -> bool:
    """Return whether the folder holds a bank, or the beginning of one.

    Raises:
        ValueError: if a split of it is asked for.
    """
    from lime_keras.synthesis import bank

    from .corpus import claim

    folder = options.corpus
    begun = claim.held(folder / "description.json") or {}
    found = bank.is_bank(folder) or begun.get("format") == bank.FORMAT
    if found and options.split:
        raise ValueError(f"{folder} is a bank, which has one split: leave out --split")
    return found


def _verify_bank(folder: Path) -> int:
    from .bank import verification

    with console.Bar("verify", "entry") as bar:
        faults = verification.verify(folder, bar.move)
    for line in faults.lines():
        print(line, file=sys.stderr)
    found = f"{faults.count} fault{'s' if faults.count > 1 else ''}"
    print(f"{faults.examples} entries in {folder}: {found if faults.count else 'sound'}")
    return int(faults.count > 0)


def _preview_bank(folder: Path, out: Path) -> int:
    from lime_keras.io import atomic
    from lime_keras.synthesis.lights import LightBank

    from .bank import light_histograms, preview

    preview.preview(folder, out)
    print(out)
    histograms = out.with_name(f"{out.stem}-lights.png")
    with console.Bar("lights", "light") as bar, atomic.replacing(histograms) as partial:
        figure = light_histograms.light_histograms(LightBank(folder), bar.move)
        figure.savefig(partial, format="png")
    print(histograms)
    return 0


def _splits(corpus: Path, name: str | None) -> list[Split]:
    """Return the split of that name, or without a name all splits whose rendering was begun.

    A split that is not complete is included: `verify` reports it.

    Raises:
        ValueError: if no split was begun.
    """
    if name is not None:
        return [Split(corpus, name)]
    splits = [Split(corpus, name) for name in SPLITS]
    begun = [split for split in splits if split.description_path.is_file()]
    if not begun:
        raise ValueError(f"{corpus} holds no corpus: render one with --split and --count")
    return begun


def _layers(options: argparse.Namespace) -> int:
    console.import_tensorflow()
    from .inspect import layers

    out = options.out or layers.default_path(options.corpus, options.split, options.index)
    layers.export(options.corpus, options.split, options.index, out)
    print(out)
    print(layers.environment_path(out))
    return 0


def _images(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    console.import_tensorflow()
    from .inspect import images

    with console.Bar("images", "image") as bar:
        count = images.write(options.corpus, options.out, bar.move)
    print(f"{count} images in {options.out}")
    return 0


def _views(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    console.require("lime-render views", *console.EXTRAS["render"])
    from . import room_views

    with console.Bar("views", "picture") as bar:
        room_views.write_views(options.maps, options.out, options.count, bar.move)
    return 0


def _bank(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    from .bank import rendering
    from .bank.description import Description
    from .corpus import claim
    from .mitsuba_setup import variants

    choice = variants.choose()
    if (claim.held(options.out / "description.json") or {}).get("variant") == variants.SLOW:
        # The bank was begun without a libLLVM: its other shards need the same variant.
        choice = variants.Choice(variants.SLOW, None)
    print(choice.explain(), file=sys.stderr)
    description = Description(
        split=options.split,
        count=options.count,
        seed=options.seed,
        size=options.size,
        shard_size=options.shard_size or min(256, -(-options.count // 20)),
        variant=choice.variant,
        **_folders(options),
    )
    with (
        console.Bar("files", "file") as checked,
        console.Bar("lights", "light") as lit,
        console.Bar("textures", "texture") as drawn,
        console.Bar("G-buffers", "entry") as rendered,
    ):
        manifest = rendering.render_bank(
            options.out,
            description,
            choice,
            workers=options.workers,
            skip_unusable=options.unusable == "skip",
            on_input=checked.move,
            on_light=lit.move,
            on_texture=drawn.move,
            on_entry=rendered.move,
        )
    _write_cards(options.out)
    _tell(manifest, "entry")
    print(f"{manifest['count']} entries in {options.out}")
    return 0


def _scenes(options: argparse.Namespace) -> int:
    console.require("lime-render scenes", "keras", "tensorflow")
    console.import_tensorflow()
    from .corpus import from_bank

    shard_size = options.shard_size or min(512, 2 * -(-options.count // 40))
    with console.Bar("scenes", "example") as bar:
        manifest = from_bank.make_split(
            options.bank,
            options.out,
            count=options.count,
            seed=options.seed,
            shard_size=shard_size,
            materials=options.materials,
            tell=bar.move,
        )
    _write_cards(options.out)
    print(f"{manifest['examples']} examples in {options.out / 'train'}")
    return 0


def _folders(options: argparse.Namespace) -> dict[str, str | None]:
    """Return the user's folders by kind; None for a built-in kind."""
    return {
        name: str(folder.resolve()) if (folder := getattr(options, name)) else None
        for name in ("shapes", "environments", "backgrounds")
    }


def _write_cards(out: Path) -> None:
    """Write the data cards of what is complete in a folder."""
    from . import cards

    cards.write(out)


def _tell(manifest: Mapping[str, Any], unit: str) -> None:
    """Print what was repaired, skipped and replaced."""
    for repair in manifest["repaired"]:
        print(f"repaired: {repair}", file=sys.stderr)
    for kind, skipped in manifest["skipped"].items():
        for name, reason in skipped.items():
            print(f"skipped: {kind}: {name}: {reason}", file=sys.stderr)
    for failure in manifest["failures"]:
        print(f"replaced: {unit} {failure['index']}: {failure['error']}", file=sys.stderr)


def _render(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    console.require("lime-render", *console.EXTRAS["render"], "tensorflow")
    from .corpus.description import Description
    from .corpus.split import held_variant, render_split
    from .mitsuba_setup import variants

    choice = variants.choose()
    if held_variant(Split(options.out, options.split)) == variants.SLOW:
        # The split was begun without a libLLVM: its other shards need the same variant.
        choice = variants.Choice(variants.SLOW, None)
    print(choice.explain(), file=sys.stderr)
    description = Description(
        split=options.split,
        count=options.count,
        seed=options.seed,
        size=options.size,
        shard_size=options.shard_size or min(512, -(-options.count // 20)),
        quality=options.quality,
        shading=options.shading,
        variant=choice.variant,
        materials=options.materials,
        **_folders(options),
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
    _write_cards(options.out)
    _tell(manifest, "example")
    print(f"{manifest['examples']} examples in {options.out / options.split}")
    return 0


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


def _bank_size(text: str) -> int:
    from lime_keras.synthesis.bank import LARGEST_SIZE

    value = _size(text)
    if value > LARGEST_SIZE:
        raise argparse.ArgumentTypeError(f"{text} is more than {LARGEST_SIZE}")
    return value
