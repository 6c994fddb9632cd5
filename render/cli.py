"""The command `lime-render`: render a corpus, verify it, preview it, export from it."""

import argparse
import sys

from lime_keras import console

from .commands import corpus, others

COMMANDS = ("verify", "preview", "layers", "images", "views")
"""Commands, by their first argument; any other first argument is the folder of a corpus."""
_EXAMPLE = """
other commands, each with a --help of its own:
  lime-render verify CORPUS         check files, checksums and every record
  lime-render preview CORPUS        draw a contact sheet
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

More: docs/how-to/corpus.md, docs/how-to/machines.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options for rendering."""
    out = console.parser(
        prog="lime-render",
        usage="lime-render OUT --split {train,test} --count COUNT [options]\n"
        f"       lime-render {{{','.join(COMMANDS)}}} ...",
        description="Render images of single objects with their mask, diffuse and specular "
        "shading, mirror image, normals, environment and material, as TFRecords.",
        epilog=_EXAMPLE,
    )
    corpus.add_options(out)
    return out


def commands() -> argparse.ArgumentParser:
    """Return the parser of `COMMANDS`."""
    out = argparse.ArgumentParser(prog="lime-render")
    others.add(out.add_subparsers(required=True))
    return out


def main(argv: list[str] | None = None) -> int:
    """Render one split of a corpus, or run one of `COMMANDS`, and return the exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    if arguments and arguments[0] in COMMANDS:
        options = commands().parse_args(arguments)
        return console.run(lambda: options.run(options), options.interrupted)
    options = parser().parse_args(arguments)
    return console.run(lambda: corpus.run(options), corpus.INTERRUPTED)
