"""The command `lime-eval`: measure trained runs and write the report."""

import argparse
import os
import shlex
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_EPILOG = """\
examples:
  lime-eval corpus --weights runs/full
  lime-eval corpus --table1 runs/full runs/no-mirror runs/no-perceptual --out results
  lime-eval corpus --tradeoff runs/smoke runs/live --out results
  lime-eval --stability --out results

All of one --out fill one report, which may be mailed: report.html. Besides it
  --weights    metrics.json    every number, with intervals; encoders on true layers, paper,
                               chance and floor
               table1.md       the paper's Table 1 with this run's column
               confusion.png   which exponent bin is taken for which
               images.csv      what was found of every test image, and how wrong it is
               examples/       the photos of the report's examples, to try lime-estimate on
  --table1     comparison.md, comparison.json, confusions.png
  --tradeoff   tradeoff.md, tradeoff.json, pareto.png
  --stability  stability.md, stability.json

What was measured is kept in OUT, so a command that is run again, or was interrupted, goes on where
it stopped. Tables also go to standard output, progress to standard error.
Exit status: 0 done, 1 something failed, 2 wrong usage, 130 interrupted.
"""


def parser() -> argparse.ArgumentParser:
    """Return the argument parser of `lime-eval`."""
    command = argparse.ArgumentParser(
        prog="lime-eval",
        description="Measure trained runs on the test split of a corpus: the paper's Table 1, "
        "speed against accuracy, numerical stability, and a report of it all.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument(
        "corpus",
        type=Path,
        metavar="CORPUS",
        nargs="?",
        help="folder of lime-render; --stability alone needs none",
    )
    command.add_argument(
        "--weights",
        type=Path,
        metavar="RUN",
        help="run of lime-train, or a folder with its model, to be measured (default, with a "
        "CORPUS and nothing else asked for: the model that comes with the package)",
    )
    command.add_argument(
        "--table1",
        type=Path,
        nargs="+",
        metavar="RUN",
        help="put several runs side by side: the full approach, its ablations, the baseline",
    )
    command.add_argument(
        "--tradeoff",
        type=Path,
        nargs="+",
        metavar="RUN",
        help="measure latency, throughput, memory and size against every error, for each run, "
        "runtime, precision, batch, number of threads and sub-graph",
    )
    command.add_argument(
        "--stability",
        action="store_true",
        help="drive every numeric part to its extremes, the networks of --weights among them",
    )
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: RUN/eval)"
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
    on_corpus = options.weights or options.table1 or options.tradeoff
    if not on_corpus and not options.stability and options.corpus is None:
        command.error("nothing to do: pass a CORPUS, or --stability")
    if options.corpus is None and (options.table1 or options.tradeoff):
        command.error("--table1 and --tradeoff need a CORPUS to measure on")
    if options.corpus is None and options.weights and not options.stability:
        command.error("--weights needs a CORPUS to measure on")
    if options.corpus is not None and not on_corpus and options.stability:
        command.error("a CORPUS takes --weights, --table1 or --tradeoff")
    if options.out is None and options.weights is None:
        command.error("pass --out: without --weights there is no run's folder to write to")
    return options


def _evaluate(options: argparse.Namespace, command: str) -> int:
    """Compute the requested results, write the report, print the tables, return the status."""
    out = options.out or options.weights / "eval"
    _check_writable(out)
    console.require("lime-eval", *console.EXTRAS["train"])
    console.import_tensorflow()
    from lime_keras.io.model_folder import SHIPPED

    from . import sections

    asked = options.weights or options.table1 or options.tradeoff or options.stability
    model = options.weights if asked else SHIPPED
    corpus, how = options.corpus, {"command": command}
    seen = how | {"camera": options.camera}
    failed = False
    if model and corpus:
        print(sections.evaluation(out, model, corpus, **seen), end="")
    if options.table1:
        print(sections.compare(out, options.table1, corpus, **seen), end="")
    if options.tradeoff:
        print(sections.trade(out, options.tradeoff, corpus, **seen), end="")
    if options.stability:
        text, as_expected = sections.drive_to_extremes(out, options.weights, **how)
        print(text, end="")
        failed = not as_expected
    print(f"wrote {sections.write_report(out)}", file=sys.stderr)
    return 1 if failed else 0


def _check_writable(out: Path) -> None:
    """Raise OSError if the folder cannot be written, before minutes are spent on measuring."""
    nearest = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise OSError(f"{nearest} is no folder that can be written to: pass another --out")


if __name__ == "__main__":
    sys.exit(main())
