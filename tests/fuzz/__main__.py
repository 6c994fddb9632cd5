"""The command: try damaged inputs until so many are tried, or so many minutes have passed."""

import argparse
import itertools
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from lime_keras import console

from .doors import DOORS, Door
from .inputs import Block

_A_SHARE = 5  # inputs of a door of share 1 in a block, which one process reads in one go
_EXAMPLES = """\
examples:
  python -m tests.fuzz --minutes 10
  python -m tests.fuzz --inputs 100000 --seed 1
  python -m tests.fuzz --inputs 2000 --door photo mask --out kept

An input follows from the seed, its door and its number: the same seed tries the same inputs,
however many processes share them. Each of them is either read, or refused in one sentence that
names its file, as a command refuses it. Whatever else happens falls through: another error, a
crash, no end within 10 seconds, more than 2 GB of memory, a refusal that names no file. What falls
through is kept in DIR/DOOR-seed-S-index-I/: the input, and reason.txt.

exit status: 0 nothing fell through, 1 something did, 2 wrong usage, 130 interrupted
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    out = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description="Try damaged inputs of every kind on what the commands read them with.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("--inputs", type=console.count, metavar="N", help="end after so many inputs")
    out.add_argument(
        "--minutes",
        type=console.positive,
        metavar="M",
        help="end after so many minutes (default: 10, unless --inputs is given)",
    )
    out.add_argument("--seed", type=int, default=0, metavar="S", help="seed (default: 0)")
    out.add_argument(
        "--workers", type=console.count, default=2, metavar="W", help="processes (default: 2)"
    )
    out.add_argument(
        "--door",
        nargs="+",
        choices=DOORS,
        default=list(DOORS),
        metavar="NAME",
        help=f"doors to try, out of {', '.join(DOORS)} (default: all)",
    )
    out.add_argument(
        "--out",
        type=Path,
        default=Path("runs/fuzz"),
        metavar="DIR",
        help="folder for what falls through (default: runs/fuzz)",
    )
    return out


def main(argv: list[str] | None = None) -> int:
    """Try the inputs, print the table and return the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _try(options), "nothing was tried yet")


def _try(options: argparse.Namespace) -> int:
    from . import workers
    from .report import Report

    doors = {name: DOORS[name] for name in DOORS if name in options.door}
    minutes = options.minutes or (None if options.inputs else 10.0)
    report, interrupted = Report(doors, options.seed, options.out), False
    with tempfile.TemporaryDirectory(prefix="lime-fuzz-") as scratch:
        outcomes = workers.tried(
            doors,
            blocks(doors, options.inputs),
            seed=options.seed,
            count=options.workers,
            scratch=Path(scratch),
        )
        begun = time.monotonic()
        try:
            with console.Bar("fuzz", "input") as bar:
                for outcome in outcomes:
                    report.add(outcome)
                    share = (time.monotonic() - begun) / (60 * minutes) if minutes else 0
                    if share >= 1:
                        break
                    expected = options.inputs or max(round(report.tried / share), report.tried + 1)
                    bar.move(report.tried, expected, {"fell through": str(report.fell)})
        except KeyboardInterrupt:
            interrupted = True
        finally:
            outcomes.close()
    print(report.table())
    if report.fell:
        print(f"{report.fell} fell through: see {options.out}", file=sys.stderr)
    return 130 if interrupted else int(report.fell > 0)


def blocks(doors: Mapping[str, Door], count: int | None) -> Iterator[Block]:
    """Yield blocks of all doors in turn, each as long as its share: `count` inputs, or no end."""
    left = count
    for turn in itertools.count():
        for name, door in doors.items():
            size = _A_SHARE * door.share
            if left is not None:
                size, left = min(size, left), left - min(size, left)
            if size == 0:
                return
            first = turn * _A_SHARE * door.share
            yield Block(name, first, first + size)


if __name__ == "__main__":
    sys.exit(main())
