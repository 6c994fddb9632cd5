"""The command `lime-eval`: measure trained runs and write the report."""

import argparse
import shlex
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.model import folder as model_folder

_EPILOG = """\
examples:
  lime-eval corpus --weights runs/mine
  lime-eval corpus --table1 runs/full runs/no-mirror runs/no-perceptual
  lime-eval corpus --predictions answers/ --table1 live
  lime-eval corpus --tradeoff

DIR/report.html shows the results of all commands with the same --out; tables also go to standard
output. What was measured on a CORPUS is kept in DIR: a command that is repeated, or was
interrupted, measures only what is missing.

Exit status: 0 done, 1 something failed, 2 wrong usage, 130 interrupted.

More: docs/how-to/evaluate.md, docs/how-to/photographs.md, docs/reference/benchmark.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the argument parser of `lime-eval`."""
    command = console.parser(
        prog="lime-eval",
        usage="lime-eval [CORPUS] [what to measure] [--out DIR] [options]",
        description="Measure trained models: on the test split of a corpus (the paper's Table 1, "
        "speed against accuracy), and at numerical extremes. Write one report.",
        epilog=_EPILOG,
    )
    _add_input(command)
    _add_measurements(command)
    written = command.add_argument_group("output")
    written.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of the results (default: RUN/eval for one run of your own, results/NAME for "
        "one set that comes with the package and is named by --weights, else results)",
    )
    return command


def _add_input(command: argparse.ArgumentParser) -> None:
    """Add the corpus and how its images are shown."""
    given = command.add_argument_group("input")
    given.add_argument(
        "corpus",
        type=Path,
        metavar="CORPUS",
        nargs="?",
        help="corpus that lime-render wrote; --stability needs none",
    )
    given.add_argument(
        "--camera",
        action="store_true",
        help="show photos of the scenes instead of clean images: exposure, defocus, noise, "
        "clipping and JPEG of a consumer camera",
    )


def _add_measurements(command: argparse.ArgumentParser) -> None:
    """Add what can be measured, and of which models."""
    measured = command.add_argument_group(
        "what to measure",
        "RUN is a run of lime-train, a folder with its model, or the name of a set that comes with "
        f"the package: {', '.join(model_folder.shipped())}.",
    )
    measured.add_argument(
        "--weights",
        type=model_folder.find,
        metavar="RUN",
        help="the errors of one model (default, if nothing else is asked for: "
        f"{model_folder.DEFAULT.name})",
    )
    measured.add_argument(
        "--table1",
        type=model_folder.find,
        nargs="+",
        metavar="RUN",
        help="several models side by side: the full approach, its ablations, the baseline",
    )
    measured.add_argument(
        "--predictions",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="the answers of other systems, a folder each, in the same table as --table1 or "
        "--weights, or alone",
    )
    measured.add_argument(
        "--tradeoff",
        type=model_folder.find,
        nargs="*",
        metavar="RUN",
        help="time and memory of what users run, a photo and a camera's frame, against every "
        "error, and which model to choose (default: all sets that come with the package)",
    )
    measured.add_argument(
        "--stability",
        action="store_true",
        help="the networks of --weights at their extremes, in every precision and format; "
        "`make stability`, in a checkout, tries every function, too",
    )


def main(argv: list[str] | None = None) -> int:
    """Run `lime-eval` and return its exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    options = _checked(parser(), arguments)
    command = shlex.join(["lime-eval", *arguments])
    return console.run(lambda: _evaluate(options, command), "each file is whole or was not written")


def _checked(command: argparse.ArgumentParser, arguments: list[str]) -> argparse.Namespace:
    """Return the parsed options; exit with a usage error if they do not go together."""
    options = command.parse_args(arguments)
    if options.tradeoff == []:
        options.tradeoff = list(model_folder.shipped().values())
    on_corpus = options.weights or options.table1 or options.tradeoff or options.predictions
    if not on_corpus and not options.stability and options.corpus is None:
        command.error("nothing to do: pass a CORPUS or --stability")
    if options.corpus is None and (options.table1 or options.tradeoff or options.predictions):
        command.error("--table1, --tradeoff and --predictions need a CORPUS to measure on")
    if options.predictions and options.camera:
        command.error(
            "--predictions are of clean images, as lime-render images writes them: "
            "leave out --camera"
        )
    if options.corpus is None and options.weights and not options.stability:
        command.error("--weights needs a CORPUS to measure on; it comes before the options")
    if options.corpus is not None and not on_corpus and options.stability:
        command.error("a CORPUS takes --weights, --table1, --tradeoff or --predictions")
    options.out = options.out or _default_out(options.weights)
    return options


def _default_out(run: Path | None) -> Path:
    """Return the folder of the results where `--out` names none."""
    if run is None:
        return Path("results")
    shipped = run in model_folder.shipped().values()
    return Path("results", run.name) if shipped else run / "eval"


def _evaluate(options: argparse.Namespace, command: str) -> int:
    """Compute the requested results, write the report, print the tables, return the status."""
    run, out = options.weights, options.out
    console.check_folder(out, "--out")
    console.require("lime-eval", *console.EXTRAS["train"])
    console.import_tensorflow()
    from . import sections

    compared = options.table1 or options.predictions
    asked = run or compared or options.tradeoff
    model = run or (None if asked else model_folder.DEFAULT)
    corpus, how = options.corpus, {"command": command}
    shown = how | {"camera": options.camera}
    failed = False
    if model and corpus:
        print(sections.evaluation(out, model, corpus, **shown), end="")
    if compared:
        runs, answers = options.table1 or [run] * bool(run), options.predictions or []
        print(sections.compare(out, runs, answers, corpus, **shown), end="")
    if options.tradeoff:
        print(sections.trade(out, options.tradeoff, corpus, **shown), end="")
    if options.stability:
        from .stability import suite

        text, as_expected = sections.stability(out, suite.cases(run or model_folder.DEFAULT), **how)
        print(text, end="")
        failed = not as_expected
    print(f"wrote {sections.write_report(out)}", file=sys.stderr)
    return 1 if failed else 0
