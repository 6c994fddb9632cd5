"""The command `lime-eval`: measure trained runs and write the report."""

import argparse
import shlex
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.io import model_folder
from lime_keras.version import __version__

_EPILOG = """\
examples:
  lime-eval corpus --weights runs/full
  lime-eval corpus --table1 runs/full runs/no-mirror runs/no-perceptual --out results
  lime-eval corpus --weights nano --out results
  lime-eval corpus --tradeoff --out results
  lime-eval corpus --tradeoff runs/smoke live --out results
  lime-eval --stability --out results
  lime-eval --photos photos/ --weights runs/before runs/after --out results
  lime-eval corpus --predictions answers/ --table1 live --out results

All of one --out fill one report, which may be mailed: report.html. Besides it
  --weights    metrics.json    every number, with intervals; encoders on true layers, paper,
                               chance and floor
               table1.md       the paper's Table 1 with this run's column
               confusion.png   which exponent bin is taken for which
               images.csv      what was found of every test image, and how wrong it is
               examples/       the photos of the report's examples, to try lime-estimate on
  --table1, --predictions
               comparison.md, comparison.json, confusions.png
  --tradeoff   tradeoff.md, tradeoff.json, pareto.png
  --photos     photos.json     every number of the tables, and the answers for every photo
               photos.csv      the answers for every photo
               photos-1.jpg …  the photos with their answers, sorted by gloss

Photos have no true material, but show whether it is glossy, and of which hue. Their folder may hold
masks (cup_mask.png for cup.jpg; 1mask.png for 1input.png) and labels.csv, with the columns
  photo        path below the folder, with its suffix
  finish       glossy or matte, as one sees it; may be empty
  dielectric   1 if the object is of no metal, so that its specular albedo is known: 0.04
  pair         photos of the same name here are also compared with one another alone
  note         any text
Without labels there are the colours, the masks and the pictures.

A folder of --predictions holds another system's answers for what lime-render images writes, each
file named after its image. All of them may be missing; docs/reference/benchmark.md tells of units.
  00000.json                  diffuse_albedo, specular_albedo, exponent,
                              exponent_bin_probabilities
  00000-mask.png              white where the object is
  00000-specular_shading.exr, 00000-mirror.exr
                              linear radiance, one channel

What was measured on a CORPUS is kept in OUT, so a command that is run again, or was interrupted,
goes on where it stopped. Tables also go to standard output, progress to standard error.
Exit status: 0 done, 1 something failed, 2 wrong usage, 130 interrupted.
"""


def parser() -> argparse.ArgumentParser:
    """Return the argument parser of `lime-eval`."""
    command = argparse.ArgumentParser(
        prog="lime-eval",
        description="Measure trained runs on the test split of a corpus: the paper's Table 1, "
        "speed against accuracy, numerical stability; or on photos; and write a report of it all.",
        epilog=_EPILOG,
        formatter_class=console.Help,
    )
    command.add_argument(
        "corpus",
        type=Path,
        metavar="CORPUS",
        nargs="?",
        help="folder of lime-render; --stability and --photos need none",
    )
    command.add_argument(
        "--weights",
        type=model_folder.find,
        nargs="+",
        action="extend",
        metavar="RUN",
        help="run of lime-train, a folder with its model, or name of a set that comes with the "
        f"package ({', '.join(model_folder.shipped())}), to be measured; --photos takes several, "
        "side by side (default, for --photos and for a CORPUS with nothing else asked for: "
        f"{model_folder.DEFAULT})",
    )
    command.add_argument(
        "--table1",
        type=model_folder.find,
        nargs="+",
        metavar="RUN",
        help="put several runs side by side: the full approach, its ablations, the baseline",
    )
    command.add_argument(
        "--predictions",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="put the answers of other systems, a folder each, into that table, beside the runs of "
        "--table1 or the one of --weights, or alone",
    )
    command.add_argument(
        "--tradeoff",
        type=model_folder.find,
        nargs="*",
        metavar="RUN",
        help="measure latency, throughput, memory and size against every error, for each run, "
        "runtime, precision, batch, number of threads and sub-graph (without a RUN: for all sets "
        "that come with the package)",
    )
    command.add_argument(
        "--stability",
        action="store_true",
        help="drive every numeric part to its extremes, the networks of --weights among them",
    )
    command.add_argument(
        "--photos",
        type=Path,
        metavar="DIR",
        help="tell how well photos in a folder, at any depth, are answered whose materials nobody "
        "measured: order of gloss, specular albedo of dielectrics, colour, masks",
    )
    command.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: RUN/eval, of a RUN that did not come with the "
        "package)",
    )
    command.add_argument(
        "--camera",
        action="store_true",
        help="show the systems photos of the scenes, with a consumer camera's exposure, defocus, "
        "noise, clipping and JPEG, instead of clean images",
    )
    command.add_argument("--version", action="version", version=__version__)
    return command


def main(argv: list[str] | None = None) -> int:
    """Run `lime-eval` and return its exit status.

    Args:
        argv: arguments after the command's name (default: those of the process).
    """
    arguments = sys.argv[1:] if argv is None else argv
    options = _checked(parser(), arguments)
    command = shlex.join(["lime-eval", *arguments])
    return console.run(lambda: _evaluate(options, command), "each file is whole or was not written")


def _checked(command: argparse.ArgumentParser, arguments: list[str]) -> argparse.Namespace:
    """Return the parsed options; exit with a usage error if they do not go together."""
    options = command.parse_args(arguments)
    if options.tradeoff == []:
        options.tradeoff = list(model_folder.shipped().values())
    weights = options.weights or []
    on_corpus = weights or options.table1 or options.tradeoff or options.predictions
    alone = options.stability or options.photos
    if not on_corpus and not alone and options.corpus is None:
        command.error("nothing to do: pass a CORPUS, --stability, or --photos")
    if options.corpus is None and (options.table1 or options.tradeoff or options.predictions):
        command.error("--table1, --tradeoff and --predictions need a CORPUS to measure on")
    if options.predictions and options.camera:
        command.error(
            "--predictions are of clean images, as lime-render images writes them: "
            "leave out --camera"
        )
    if options.corpus is None and weights and not alone:
        command.error("--weights needs a CORPUS to measure on; it comes before the options")
    if options.corpus is not None and not on_corpus and alone:
        command.error("a CORPUS takes --weights, --table1, --tradeoff or --predictions")
    if len(weights) > 1 and (options.corpus is not None or not options.photos or options.stability):
        command.error("several --weights are for --photos alone; on a CORPUS pass them to --table1")
    if options.out is None and len(weights) != 1:
        command.error("pass --out: without one --weights there is no run's folder to write to")
    if options.out is None and weights[0] in model_folder.shipped().values():
        command.error(f"pass --out: {weights[0].name} came with the package, which is kept")
    return options


def _evaluate(options: argparse.Namespace, command: str) -> int:
    """Compute the requested results, write the report, print the tables, return the status."""
    weights = options.weights or []
    out = options.out or weights[0] / "eval"
    console.check_folder(out, "--out")
    if options.corpus or options.stability:
        console.require("lime-eval", *console.EXTRAS["train"])
        console.import_tensorflow()
    else:
        # Photos are estimated without TensorFlow; the report is made of these.
        console.require("lime-eval --photos", "jinja2", "markdown_it")
    from . import sections

    compared = options.table1 or options.predictions
    asked = weights or compared or options.tradeoff or options.stability
    model = weights[0] if weights else None if asked else model_folder.SHIPPED
    corpus, how = options.corpus, {"command": command}
    seen = how | {"camera": options.camera}
    failed = False
    if model and corpus:
        print(sections.evaluation(out, model, corpus, **seen), end="")
    if compared:
        runs, answers = options.table1 or weights, options.predictions or []
        print(sections.compare(out, runs, answers, corpus, **seen), end="")
    if options.tradeoff:
        print(sections.trade(out, options.tradeoff, corpus, **seen), end="")
    if options.photos:
        shown = weights or [model_folder.SHIPPED]
        print(sections.photographs(out, options.photos, shown, **how), end="")
    if options.stability:
        text, as_expected = sections.drive_to_extremes(out, model, **how)
        print(text, end="")
        failed = not as_expected
    print(f"wrote {sections.write_report(out)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
