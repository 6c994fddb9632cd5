"""The command: try every numeric part at its extremes, and write the tables."""

import argparse
import shlex
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.model import folder as model_folder

_EXAMPLES = """\
examples:
  python -m tests.stability --out runs/stability
  python -m tests.stability --weights runs/mine --out runs/stability

DIR gets stability.md and stability.json, with a row for every check, and report.html with the same
tables. They also go to standard output; what is skipped, and why, to standard error.

exit status: 0 every check passed, 1 one failed, 2 wrong usage, 130 interrupted
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    out = argparse.ArgumentParser(
        prog="python -m tests.stability",
        description="Try every numeric part of the package at its extremes: shading, lights, "
        "colours, losses, cameras, the live page, and whole systems.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument(
        "--weights",
        type=model_folder.find,
        metavar="RUN",
        help="run of lime-train, or set that comes with the package, to be tried, too",
    )
    out.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the tables")
    return out


def main(argv: list[str] | None = None) -> int:
    """Run all checks, print their tables and return the exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    options = parser().parse_args(arguments)
    command = shlex.join(["python", "-m", "tests.stability", *arguments])
    return console.run(lambda: _try(options, command), "no table was written")


def _try(options: argparse.Namespace, command: str) -> int:
    console.import_tensorflow()
    from lime_keras.eval import sections
    from lime_keras.eval.stability import suite

    from . import page_modules
    from .cases import every_case, page

    cases, skipped = every_case(), ""
    if page_modules.node() is None:
        of_page = [case for case in cases if case.precision == page.JAVASCRIPT]
        cases = [case for case in cases if case not in of_page]
        skipped = f"skipped: {len(of_page)} checks of the live page: there is no Node.js"
    cases += suite.cases(options.weights) if options.weights else []
    text, passed = sections.stability(options.out, cases, command=command)
    print(text, end="")
    if skipped:
        print(skipped, file=sys.stderr)
    print(f"wrote {sections.write_report(options.out)}", file=sys.stderr)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
