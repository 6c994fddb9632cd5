"""The meshes and maps that recipes read: which are validation's, and a check against the list.

    python -m lime_keras.train.recipes.data DATA

DATA has the folders `meshes` and `environments`, each with subfolders `train` and `test`, or with
its files in itself. `data.csv` names each file that the sets of this package have learnt from, or
are tested on, with its SHA-256, licence, source and authors (docs/reference/data.md).
"""

import argparse
import csv
import hashlib
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from lime_keras import console
from lime_keras.io import scanner, untrusted

LIST = Path(__file__).parent / "data.csv"
SUFFIXES = {"meshes": (".obj", ".ply", ".stl", ".glb"), "environments": (".hdr", ".exr")}
"""Suffixes of the files of each folder, as `lime-render` reads them."""


def training_files(data: Path, kind: str) -> list[Path]:
    """Return the files of DATA that training may see, those of validation among them, sorted.

    Raises:
        FileNotFoundError: if the folder is missing, or holds too few files to keep some out.
    """
    folder = data / kind / "train" if (data / kind / "train").is_dir() else data / kind
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is missing: --data takes a folder that has {kind}")
    files = scanner.list_folder(folder, SUFFIXES[kind])
    if len(files) < 2:
        raise FileNotFoundError(
            f"{folder} holds {len(files)} {', '.join(SUFFIXES[kind])} files; training and "
            "validation share none, so at least 2 are needed"
        )
    return files


def validation_names(names: Iterable[str], count: int) -> set[str]:
    """Return which files are validation's: those with the least SHA-256 of `validation NAME`.

    They are `count`, but at most a fifth of all, and at least one.
    """
    ranked = sorted(names, key=lambda name: hashlib.sha256(f"validation {name}".encode()).digest())
    return set(ranked[: max(1, min(count, len(ranked) // 5))])


def link_sides(data: Path, kind: str, count: int, out: Path) -> None:
    """Link the files of DATA into OUT/KIND/train, and those of validation into OUT/KIND/test.

    `lime-render --shapes OUT/meshes --environments OUT/environments` then renders the one side by
    `--split train`, the other by `--split test`.
    """
    files = training_files(data, kind)
    validation = validation_names([path.name for path in files], count)
    wanted = {
        out / kind / ("test" if path.name in validation else "train") / path.name: path.resolve()
        for path in files
    }
    for side in ("train", "test"):
        (out / kind / side).mkdir(parents=True, exist_ok=True)
        for link in (out / kind / side).iterdir():
            if not link.is_symlink() and link.suffix.lower() in SUFFIXES[kind]:
                raise ValueError(f"{link} is no link to the data: remove it")
            if link.is_symlink() and os.readlink(link) != str(wanted.get(link)):
                link.unlink()
    for link, path in wanted.items():
        if not link.is_symlink():
            os.symlink(path, link)


def refuse_twins(files: Mapping[str, str], count: int) -> None:
    """Raise ValueError if a file of validation has the bytes or the stem of one of training.

    Args:
        files: SHA-256 of each file of a kind, as `digests` returns them.
        count: number of files that are kept for validation.
    """
    validation = validation_names((Path(name).name for name in files), count)
    sides: dict[str, dict[bool, str]] = {}
    for name, digest in files.items():
        for key in (digest, Path(name).stem.casefold()):
            sides.setdefault(key, {})[Path(name).name in validation] = name
    for side in sides.values():
        if len(side) == 2:
            raise ValueError(
                f"{side[True]} and {side[False]} may be the same, and one of them is kept for "
                "validation: remove the other"
            )


def digests(data: Path, kind: str) -> dict[str, str]:
    """Return the SHA-256 of each of `training_files`, by its place in the folder."""
    files = training_files(data, kind)
    return {path.relative_to(data).as_posix(): untrusted.sha256(path) for path in files}


def total(files: Mapping[str, str]) -> str:
    """Return one SHA-256 of files' names and digests."""
    text = "".join(f"{name} {digest}\n" for name, digest in sorted(files.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def listed() -> dict[str, str]:
    """Return the SHA-256 of each file of the list, by its place in the folder."""
    with LIST.open(newline="", encoding="utf-8") as file:
        return {row["file"]: row["sha256"] for row in csv.DictReader(file)}


def faults(data: Path) -> list[str]:
    """Return a line for each file of the list that is missing or has other bytes, or is beside it.

    Raises:
        FileNotFoundError: if there is no such folder.
    """
    if not data.is_dir():
        raise FileNotFoundError(f"{data} is no folder: pass one with {' and '.join(SUFFIXES)}")
    known, out = listed(), []
    for name, digest in known.items():
        path = data / name
        if not path.is_file():
            out.append(f"{name} is missing")
        elif untrusted.sha256(path) != digest:
            out.append(f"{name} has other bytes")
    for kind, suffixes in SUFFIXES.items():
        there = scanner.walk(data / kind, suffixes) if (data / kind).is_dir() else ()
        names = (path.relative_to(data).as_posix() for path in there)
        out += [f"{name} is not in the list" for name in names if name not in known]
    return out


def main(argv: list[str] | None = None) -> int:
    """Check a folder and return the exit status."""
    command = argparse.ArgumentParser(
        prog="python -m lime_keras.train.recipes.data",
        description="Check a folder of meshes and maps against the list of those that the sets of "
        "this package have learnt from, and are tested on.",
        epilog=f"The list, with licences and sources: {LIST}",
        formatter_class=console.Help,
    )
    command.add_argument("data", type=Path, metavar="DATA", help="folder with meshes, environments")
    options = command.parse_args(argv)
    return console.run(lambda: _check(options.data), "nothing was changed")


def _check(data: Path) -> int:
    wrong = faults(data)
    for line in wrong:
        print(line)
    count = len(listed())
    print(
        f"{data} holds {'other files than' if wrong else 'all'} the {count} files of the list"
        + (", so recipes make other weights of it: see docs/reference/data.md" if wrong else "")
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
