"""Bundles of training runs for machines without a network: `python -m lime_keras.train.bundle`.

A bundle is a folder with `run.sh`, the pieces of one archive, and `index.txt`, which lists the
pieces in order with checksums and sizes. The archive, assembled by `cat`, holds the banks, the
wheels that a machine with Python and JAX may lack, perhaps a trained model to begin with, and
`run.sh` again.
"""

import argparse
import gzip
import hashlib
import io
import os
import shlex
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import BinaryIO

from lime_keras import console
from lime_keras.io import atomic, model_folder

from . import cli

INDEX, SCRIPT, ARCHIVE = "index.txt", "run.sh", "bundle.tar.gz"
PACKAGES = (
    "absl-py",
    "h5py",
    "keras",
    "markdown-it-py",
    "mdurl",
    "namex",
    "optree",
    "packaging",
    "pygments",
    "rich",
    "tqdm",
    "typing-extensions",
)
"""What lime-train needs beside what JAX brings along: NumPy, SciPy, ml_dtypes and opt_einsum."""
_PLATFORMS = ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014", "manylinux1")
"""What wheels may be built for; Linux of 2019 or later runs them all."""
_BUILT_FROM = ("lime_keras", "render", "train", "eval")
_BUILT_BY = ("setup.py", "pyproject.toml", "README.md", "LICENSE")
_PRESETS = ("smoke", "nano", "live")
_NOT_PASSED_ON = (
    "paths",
    "out",
    "preset",
    "minutes",
    "scale_steps",
    "start_from",
    "reuse",
    "hosts",
)
"""Options of lime-train that are the bundle's own, or do not fit it."""
_SETTINGS = b"# SETTINGS\n"
"""Line of the script that the settings of a bundle replace."""
_ROOM_KB = 300_000
"""Disk that a run needs beside the bundle and what is unpacked: wheels, checkpoints and result."""
_EXAMPLE = """
examples:
  python -m lime_keras.train.bundle runs/bundle --bank bank
  python -m lime_keras.train.bundle runs/bundle --bank meshes shapes --minutes 50 \\
    --start-from runs/live -- --batch-size 128 --precision bfloat16
  make bundle BANK=bank

Copy all files of the bundle into one folder of the other machine, and there run

  sh run.sh [MINUTES]

It needs Python with pip and JAX, but no network. It checks and unpacks the pieces, trains all
stages within the minutes, and every two minutes puts the weights into result/, where they stay
however it ends. Without a GPU it says so and goes on. The same command, run again, goes on from the
last checkpoint.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the bundle's own options."""
    out = argparse.ArgumentParser(
        prog="python -m lime_keras.train.bundle",
        usage="%(prog)s OUT --bank BANK [BANK ...] [options] [-- options of lime-train]",
        description="Pack a training run for a machine with JAX and a GPU, but without a network.",
        epilog=_EXAMPLE,
        formatter_class=console.Help,
    )
    out.add_argument("out", type=Path, metavar="OUT", help="folder of the bundle")
    out.add_argument(
        "--bank",
        nargs="+",
        type=Path,
        required=True,
        metavar="BANK",
        help="bank that lime-render wrote; of several all are learnt from together",
    )
    out.add_argument(
        "--minutes",
        type=console.positive,
        default=22.0,
        metavar="M",
        help="time of the whole run.sh, unless it is called with another (default: 22)",
    )
    out.add_argument(
        "--preset",
        choices=_PRESETS,
        default="live",
        help="of lime-train (default: live); the weights of its `paper` are larger than the 60 MB "
        "of a result",
    )
    out.add_argument(
        "--start-from",
        type=model_folder.find,
        metavar="RUN",
        help="begin with the weights of another run, or of a set that comes with the package",
    )
    out.add_argument(
        "--piece-mb",
        type=console.count,
        default=60,
        metavar="MB",
        help="largest size of a piece in millions of bytes (default: 60)",
    )
    out.add_argument(
        "--python",
        default="3.12",
        metavar="VERSION",
        help="version of Python on the other machine (default: 3.12)",
    )
    return out


def main(argv: Sequence[str] | None = None) -> int:
    """Write a bundle and return the exit status."""
    given = list(sys.argv[1:] if argv is None else argv)
    end = given.index("--") if "--" in given else len(given)
    options = parser().parse_args(given[:end])
    return console.run(lambda: _bundle(options, given[end + 1 :]), "run the same command again")


def pack(
    out: Path,
    files: Mapping[str, Path],
    settings: Mapping[str, str],
    piece_bytes: int,
    tell: Callable[[int, int], None],
) -> list[Path]:
    """Write a bundle, in place of an earlier one; the same files always give the same bytes.

    Args:
        out: folder of the bundle.
        files: files to pack, by their names in the archive.
        settings: variables of `run.sh` by name.
        piece_bytes: largest size of a piece, in bytes.
        tell: function called with the number of bytes packed and of all bytes.

    Returns:
        The pieces, in order.

    Raises:
        ValueError: if the folder holds anything else than a bundle.
    """
    if out.is_file() or (out.is_dir() and any(out.iterdir()) and not (out / INDEX).is_file()):
        raise ValueError(f"{out} is there and is no bundle: pass another folder, or remove it")
    total, done = sum(path.stat().st_size for path in files.values()), 0
    script = _script({**settings, "NEEDED_KB": str(total // 1000 + _ROOM_KB)})
    with atomic.replacing(out) as partial:
        partial.mkdir()
        with (
            _Pieces(partial, piece_bytes) as pieces,
            gzip.GzipFile("", "wb", 6, pieces, mtime=0) as compressed,
            tarfile.open(fileobj=compressed, mode="w|", format=tarfile.PAX_FORMAT) as archive,
        ):
            _add(archive, SCRIPT, io.BytesIO(script), len(script))
            for name, path in sorted(files.items()):
                with path.open("rb") as file:
                    size = path.stat().st_size
                    _add(archive, name, file, size)
                done += size
                tell(done, total)
        (partial / SCRIPT).write_bytes(script)
        index = "".join(f"{digest} {size} {name}\n" for name, size, digest in pieces.written)
        (partial / INDEX).write_text(index, encoding="utf-8")
    return [out / name for name, _, _ in pieces.written]


def wheels(folder: Path, python: str) -> None:
    """Build the wheel of this package, and fetch those of the packages that it needs.

    Args:
        folder: folder to write the wheels to.
        python: version of Python that they are for, such as `3.12`.

    Raises:
        ValueError: if this package was not installed from a checkout.
        RuntimeError: if pip fails.
    """
    root = Path(__file__).resolve().parents[1]
    if not (root / _BUILT_BY[0]).is_file():
        raise ValueError(f"{root} is no checkout of lime-keras: bundles are packed from one")
    with tempfile.TemporaryDirectory() as built:
        # From a copy, so that no build folder is left in the checkout.
        for name in _BUILT_FROM:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(root / name, Path(built, name), ignore=ignored)
        for name in _BUILT_BY:
            shutil.copy(root / name, built)
        _pip("wheel", "--no-deps", "--wheel-dir", str(folder), built)
    named = [f"{name}=={metadata.version(name)}" for name in PACKAGES]
    platforms = [part for name in _PLATFORMS for part in ("--platform", f"{name}_x86_64")]
    _pip(
        *("download", "--no-deps", "--only-binary=:all:", "--implementation", "cp"),
        *("--python-version", python, *platforms, "--dest", str(folder), *named),
    )


def _bundle(options: argparse.Namespace, training: Sequence[str]) -> int:
    checked = _training_options(options, training)
    files = _files_of_banks(options.bank)
    console.import_tensorflow()

    from lime_keras.networks import weights

    from .banks import Banks

    config = cli.config_of(checked)
    # What lime-train would refuse there is refused here.
    Banks(options.bank, config, (0, 1)).training(config.seed, ("image",), 0)
    settings = {
        "PYTHON_VERSION": options.python,
        "MINUTES": f"{options.minutes:g}",
        "OPTIONS": shlex.join(["--preset", options.preset, *training]),
    }
    with tempfile.TemporaryDirectory() as scratch, console.Bar("packing", "byte") as bar:
        fetched, begun = Path(scratch, "wheels"), Path(scratch, "start-from")
        fetched.mkdir()
        if options.start_from is not None:
            weights.copy(options.start_from, begun)
            files |= {
                f"start-from/{p.relative_to(begun)}": p for p in begun.rglob("*") if p.is_file()
            }
        wheels(fetched, options.python)
        files |= {f"wheels/{path.name}": path for path in fetched.iterdir()}
        pieces = pack(options.out, files, settings, options.piece_mb * 1_000_000, bar.move)
    size = sum(piece.stat().st_size for piece in pieces)
    print(
        f"{options.out}: {len(pieces)} pieces, {size / 1e6:.1f} MB; copy all its files into one "
        f"folder of the other machine, and run `sh {SCRIPT}` there"
    )
    return 0


def _training_options(options: argparse.Namespace, training: Sequence[str]) -> argparse.Namespace:
    """Return what lime-train reads from its options.

    Raises:
        ValueError: if an option is the bundle's own.
    """
    parser = cli.parser()
    own = [*map(str, options.bank), "--out", "run", "--preset", options.preset]
    plain, asked = parser.parse_args(own), parser.parse_args([*own, *training])
    for name in _NOT_PASSED_ON:
        if getattr(asked, name) != getattr(plain, name):
            raise ValueError(
                f"--{name.replace('_', '-')} cannot be passed on to lime-train: the bundle decides "
                "it, so leave it out behind `--`"
            )
    asked.start_from = options.start_from
    return asked


def _files_of_banks(folders: Sequence[Path]) -> dict[str, Path]:
    """Return the files of banks by their names in the archive.

    Raises:
        FileNotFoundError: if a bank is incomplete.
        ValueError: if a file has changed since the bank was rendered.
    """
    from lime_keras.synthesis import bank  # imports NumPy, which --help does without

    out = {}
    for number, folder in enumerate(folders):
        out[f"banks/{number}/{bank.MANIFEST}"] = folder / bank.MANIFEST
        for name, digest in bank.manifest(folder)["files"].items():
            path = bank.file(folder, name)
            with path.open("rb") as file:
                if hashlib.file_digest(file, "sha256").hexdigest() != digest:
                    raise ValueError(
                        f"{path} is not as it was rendered: check the bank with `lime-render "
                        f"verify {folder}`"
                    )
            out[f"banks/{number}/{name}"] = path
    return out


def _script(settings: Mapping[str, str]) -> bytes:
    """Return `run.sh` with its settings."""
    text = (Path(__file__).parent / SCRIPT).read_bytes()
    lines = "".join(f"{name}={shlex.quote(value)}\n" for name, value in settings.items())
    return text.replace(_SETTINGS, lines.encode())


def _add(archive: tarfile.TarFile, name: str, file: BinaryIO, size: int) -> None:
    """Add a file to an archive, without whose it is and when it was written."""
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = size, 0o644
    archive.addfile(entry, file)


def _pip(*arguments: str) -> None:
    # Without the time at which it is built, a wheel is always the same.
    environment = os.environ | {"SOURCE_DATE_EPOCH": "315532800"}
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        told = (done.stderr.strip() or done.stdout.strip()).splitlines()
        raise RuntimeError(f"pip {arguments[0]} failed: {told[-1] if told else done.returncode}")


class _Pieces:
    """A file for writing that is cut into pieces of a size.

    Attributes:
        written: name, size in bytes and SHA-256 of each piece; complete when it is closed.

    Args:
        folder: folder of the pieces.
        most: largest size of a piece, in bytes.
    """

    def __init__(self, folder: Path, most: int):
        self._folder, self._most = folder, most
        self._file: BinaryIO | None = None
        self._size, self._digest = 0, hashlib.sha256()
        self.written: list[tuple[str, int, str]] = []

    def __enter__(self) -> "_Pieces":
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()

    def write(self, data: bytes) -> int:
        """Append bytes, and begin another piece wherever one is full."""
        left = memoryview(data)
        while left:
            if self._file is None or self._size == self._most:
                self._finish()
                self._file = (self._folder / self._name()).open("wb")
            part = left[: self._most - self._size]
            self._file.write(part)
            self._digest.update(part)
            self._size += len(part)
            left = left[len(part) :]
        return len(data)

    def flush(self) -> None:
        """Do nothing: a piece is written when it is full."""

    def _name(self) -> str:
        return f"{ARCHIVE}.{len(self.written):03d}"

    def _finish(self) -> None:
        if self._file is not None:
            self._file.close()
            self.written.append((self._name(), self._size, self._digest.hexdigest()))
            self._file, self._size, self._digest = None, 0, hashlib.sha256()


if __name__ == "__main__":
    sys.exit(main())
