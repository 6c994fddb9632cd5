"""The figures of a benchmark in docs/results/NAME.json, from which `make readme` writes the pages.

A file holds the figures (value, 95 % interval, number of examples), and what they follow from: the
command, the commit, the machine, the versions of the packages, digests of the weights and of the
corpus, and the benchmark's own number, `CODE`, which is raised by hand where its meaning changes.
`make results` (benchmarks/results.py) measures again what no longer fits.
"""

import argparse
import functools
import hashlib
import json
import math
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lime_keras import machine
from lime_keras.data.corpus import Split
from lime_keras.io import atomic, untrusted
from lime_keras.model import folder as model_folder

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "results"


@dataclass(frozen=True)
class Figure:
    """A measured number.

    Attributes:
        value: the number; a share in [0, 1] where the pages show per cent.
        interval: ends of its 95 % interval, if it has one.
        count: number of examples that it is a mean of.
    """

    value: float
    interval: tuple[float, float] | None = None
    count: int | None = None

    def __format__(self, spec: str) -> str:
        """Return the number as Python formats it: `.1%` is `92.9 %`.

        A `±` at the end of the format adds half of the interval, and `[]` adds its ends.
        """
        plain = spec.removesuffix("±").removesuffix("[]")
        unit = " %" if plain.endswith("%") else ""
        low, high = self.interval or (math.nan, math.nan)
        numbers = (self.value, (high - low) / 2, low, high)
        value, half, low_end, high_end = (
            format(one, plain).rstrip("%").replace("-", "−") for one in numbers
        )
        if self.interval is None or plain == spec:
            return f"{value}{unit}"
        return (
            f"{value} ± {half}{unit}"
            if spec.endswith("±")
            else (f"{value}{unit} [{low_end}, {high_end}]")
        )


Columns = Mapping[str, Mapping[str, Figure]]
"""Figures by column of a table, a set of weights say, and row, a measure."""


def add_option(parser: argparse.ArgumentParser) -> None:
    """Let a benchmark's command take `--record NAME`."""
    parser.add_argument(
        "--record", metavar="NAME", help="keep the figures in docs/results/NAME.json"
    )


def write(
    name: str,
    columns: Columns,
    *,
    code: int,
    weights: Sequence[str] = (),
    corpus: Path | None = None,
) -> Path:
    """Write what this process has measured, and return the file's path.

    Args:
        name: name of the file, without its suffix.
        columns: the figures; NaN and infinities are left out.
        code: the benchmark's number, `CODE`.
        weights: names of the sets that were measured.
        corpus: folder of the corpus whose test split was measured, or of the photographs.
    """
    content = {
        "command": shlex.join(["python", *_below_root(sys.argv)]),
        "commit": _commit(),
        "machine": machine.describe(),
        "code": code,
        "weights": {one: model_folder.digest(model_folder.find(one)) for one in weights},
        "corpus": None if corpus is None else digest(corpus),
        "figures": {
            column: {row: asdict(one) for row, one in rows.items() if math.isfinite(one.value)}
            for column, rows in columns.items()
        },
    }
    path = FOLDER / f"{name}.json"
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return path


def read(path: Path) -> dict[str, Any]:
    """Return the content of a file, with a `Figure` for each number.

    Raises:
        ValueError: if it is no such file.
    """
    with untrusted.naming(path, "figures"):
        content = json.loads(path.read_text(encoding="utf-8"))
        content["figures"] = {
            column: {row: _figure(one) for row, one in rows.items()}
            for column, rows in content["figures"].items()
        }
    return content


def digest(corpus: Path) -> str:
    """Return the SHA-256 of a test split, by its manifest; of another folder, of all its files."""
    manifest = Split(corpus, "test").manifest_path
    if manifest.is_file():
        return untrusted.sha256(manifest)
    files = sorted(path for path in corpus.rglob("*") if path.is_file())
    named = (f"{path.relative_to(corpus)} {untrusted.sha256(path)}" for path in files)
    return hashlib.sha256("\n".join(named).encode()).hexdigest()


def _figure(one: Mapping[str, Any]) -> Figure:
    interval = one.get("interval")
    return Figure(one["value"], None if interval is None else tuple(interval), one.get("count"))


def _below_root(arguments: Sequence[str]) -> list[str]:
    script, *others = arguments
    return [Path(script).resolve().relative_to(ROOT).as_posix(), *others]


def _commit() -> str:
    """Return the commit of the checkout, with `-dirty` if a file beside the figures is changed."""
    git = functools.partial(subprocess.run, cwd=ROOT, capture_output=True, text=True)
    commit = git(["git", "describe", "--always"]).stdout.strip()
    beside = git(["git", "diff", "--quiet", "HEAD", "--", ".", ":!docs/results"])
    return f"{commit}-dirty" if beside.returncode else commit
