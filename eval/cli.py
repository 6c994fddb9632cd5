"""`lime-eval`: measure a trained run on a corpus' test split and write the report."""

import argparse
import json
import os
import shlex
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_EPILOG = """\
example:
  lime-eval corpora/small --weights runs/smoke

  reads corpora/small/test and runs/smoke/model, and writes to runs/smoke/eval:
    metrics.json   every number, with intervals, oracle, paper, chance and floor
    table1.md      the paper's Table 1 with this run's column
    confusion.png  which exponent bin is taken for which
    report.html    all of it with loss curves and examples, in one file to mail
    examples/      the photos of the report's examples, to try lime-estimate on

The table also goes to standard output, progress to standard error.
Exit status: 0 done, 1 something failed, 2 wrong usage, 130 interrupted.
"""


def parser() -> argparse.ArgumentParser:
    """The command line of `lime-eval`."""
    command = argparse.ArgumentParser(
        prog="lime-eval",
        description="Measure a trained run on the test split of a corpus: the paper's Table 1, "
        "a confusion matrix and a report with examples.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("corpus", type=Path, metavar="CORPUS", help="folder of lime-render")
    command.add_argument(
        "--weights",
        type=Path,
        metavar="RUN",
        required=True,
        help="run of lime-train, or a folder with its model",
    )
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: RUN/eval)"
    )
    command.add_argument(
        "--camera",
        action="store_true",
        help="show the system photos of the scenes, with a consumer camera's exposure, defocus, "
        "noise, clipping and JPEG, instead of clean images",
    )
    command.add_argument("--version", action="version", version=__version__)
    return command


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    options = parser().parse_args(arguments)
    command = shlex.join(["lime-eval", *arguments])
    return console.run(lambda: _evaluate(options, command), "each file is whole or was not written")


def _evaluate(options: argparse.Namespace, command: str) -> int:
    """Evaluate, write the files and the photos of the report's examples, print the table."""
    out = options.out or options.weights / "eval"
    _check_writable(out)
    console.import_tensorflow()
    from lime_keras import photo

    from . import examples, figures, measures, report, table
    from .evaluate import evaluate

    camera = options.camera
    evaluation = evaluate(options.weights, options.corpus, camera=camera)
    summary = measures.summarise(evaluation) | {"camera": camera}
    choices = examples.choose(evaluation.rows)
    chosen = examples.read(options.weights, options.corpus, choices, camera=camera)
    page = report.render(
        evaluation, summary, chosen, command=command, corpus=options.corpus, run=options.weights
    )
    text = table.markdown(summary, evaluation.architecture)
    out.mkdir(parents=True, exist_ok=True)
    _write(out / "metrics.json", (json.dumps(summary, indent=2, allow_nan=False) + "\n").encode())
    _write(out / "table1.md", text.encode())
    _write(out / "confusion.png", figures.confusion(evaluation.confusion))
    _write(out / "report.html", page.encode())
    (out / "examples").mkdir(exist_ok=True)
    for stale in (out / "examples").glob("[0-9]*.png"):
        stale.unlink()
    for example in chosen:
        photo.write(out / "examples" / f"{example.choice.position:05d}.png", example.photo_srgb)
    print(text, end="")
    print(f"wrote {out / 'report.html'}", file=sys.stderr)
    return 0


def _check_writable(out: Path) -> None:
    """Refuse a folder that cannot be written, before minutes are spent on its content."""
    nearest = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise OSError(f"{nearest} is no folder that can be written to: pass another --out")


def _write(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    partial = path.with_name(f"partial-{path.name}")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
