"""Killed commands: whether each, run again, ends with what an undisturbed run ends with.

    python benchmarks/kills.py
    python benchmarks/kills.py --kills 10 --stages render estimate

Each stage is a command on small data. It runs twice undisturbed: a file counts where both runs gave
it the same bytes, so not a log of times. Then it is killed, by SIGKILL, at moments drawn evenly
over the time of an undisturbed run, and run again in the same folder, where it may be killed again,
until it ends before its moment comes. The table has

- kills: how many runs were killed;
- identical: how many of these were in folders that ended with the same files of the same bytes;
- torn: files that were there right after a kill under their final name with other bytes. Not
  counted of training, which replaces its files as it goes on;
- left over: files that an undisturbed run does not leave;
- orphans: processes that lived on ten seconds after the kill of their command.

The exit status is 1 if a run is not identical, or anything is torn, left over or an orphan.
"""

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from lime_keras.io import photo

_TO_END = 10.0
"""Seconds that processes have to end after their command was killed."""
_PHOTOS = 12


@dataclass(frozen=True)
class Stage:
    """A command that is killed.

    Attributes:
        module: module of the command.
        arguments: its arguments; `OUT` stands for the folder that it writes to.
        replaces: whether it replaces its own files as it goes on.
    """

    module: str
    arguments: tuple[str, ...]
    replaces: bool = False


@dataclass
class Counts:
    """The columns of a stage's row."""

    kills: int = 0
    identical: int = 0
    torn: int = 0
    left_over: int = 0
    orphans: int = 0

    @property
    def is_sound(self) -> bool:
        """True if nothing was lost and nothing is left."""
        return self.identical == self.kills and not self.torn + self.left_over + self.orphans


def main() -> int:
    """Print the table and return the exit status."""
    names = tuple(_stages(Path()))
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100, help="of all stages (default: 100)")
    parser.add_argument("--stages", nargs="+", choices=names, default=names)
    parser.add_argument("--seed", type=int, default=0, help="of the moments (default: 0)")
    options = parser.parse_args()
    rows: dict[str, Counts] = {}
    with (
        tempfile.TemporaryDirectory(prefix="lime-kills-") as scratch,
        tqdm(total=options.kills, desc="kills", unit="kill") as bar,
    ):
        folder = Path(scratch)
        stages = _stages(folder)
        _write_inputs(folder)
        for number, name in enumerate(names):
            # What `render` writes, `train` reads.
            if name in options.stages or (name == "render" and "train" in options.stages):
                seconds = _undisturbed(stages[name], folder, name)
            if name in options.stages:
                place = options.stages.index(name)
                share = options.kills // len(options.stages)
                share += place < options.kills % len(options.stages)
                rng = random.Random(f"{options.seed} {number}")
                rows[name] = _killed(stages[name], folder, name, share, seconds, rng, bar)
    print("| stage | kills | identical | torn | left over | orphans |")
    print("|---|---:|---:|---:|---:|---:|")
    for name, row in rows.items():
        cells = (row.kills, row.identical, row.torn, row.left_over, row.orphans)
        print(f"| {name} | " + " | ".join(map(str, cells)) + " |")
    return int(not all(row.is_sound for row in rows.values()))


def _stages(folder: Path) -> dict[str, Stage]:
    """Return the stages; `train` reads what `render` writes."""
    given = ("--environments", str(folder / "lights"), "--workers", "2", "--size", "64")
    small = ("--preset", "smoke", "--size", "32", "--width", "2", "--batch-size", "2")
    few = ("--scale-steps", "0.02", "--stages", "segmentation", "exponent")
    return {
        "render": Stage(
            "render.cli",
            ("OUT", "--split", "train", "--count", "24", "--shard-size", "3", *given),
        ),
        "train": Stage(
            "train.cli",
            (str(folder / "render"), "--out", "OUT", *small, *few),
            replaces=True,
        ),
        "export": Stage("commands.export", ("OUT", "--format", "onnx", "--weights", "nano")),
        "estimate": Stage("commands.estimate", (str(folder / "photos"), "--out", "OUT")),
    }


def _write_inputs(folder: Path) -> None:
    """Write two maps with a lamp, and photos of balls."""
    rng = np.random.default_rng(0)
    for split in ("train", "test"):
        (folder / "lights" / split).mkdir(parents=True)
        for number in range(2):
            light = np.full((32, 64, 3), 0.2, np.float32)
            light[8, 10 + 20 * number] = 40
            photo.write(folder / "lights" / split / f"{number}.exr", light)
    (folder / "photos").mkdir()
    y, x = np.mgrid[:160, :200] - np.array([80, 100])[:, None, None]
    for number in range(_PHOTOS):
        inside = np.hypot(x, y) < 50
        shaded = 60 + np.clip(100 - np.hypot(x + 20, y + 20), 0, 150)
        ball = np.where(inside, shaded, 200)[..., None] + rng.normal(0, 3, (160, 200, 3))
        image = Image.fromarray(np.clip(ball, 0, 255).astype(np.uint8))
        image.save(folder / "photos" / f"ball-{number}.png")
        mask = Image.fromarray(np.where(inside, 255, 0).astype(np.uint8))
        mask.save(folder / "photos" / f"ball-{number}_mask.png")


def _undisturbed(stage: Stage, folder: Path, name: str) -> float:
    """Run a stage twice, into `NAME` and `NAME-again`; return the seconds of the second run."""
    for target in (folder / name, folder / f"{name}-again"):
        begun = time.monotonic()
        process, log = _started(stage, target)
        if process.wait():
            raise RuntimeError(f"{name} fails undisturbed: {_end(log)}")
    return time.monotonic() - begun


def _killed(
    stage: Stage,
    folder: Path,
    name: str,
    kills: int,
    seconds: float,
    rng: random.Random,
    bar: tqdm,
) -> Counts:
    """Kill a stage so many times and count what came of it."""
    one, other = _digests(folder / name), _digests(folder / f"{name}-again")
    expected = {path: digest for path, digest in one.items() if other.get(path) == digest}
    known, out = one.keys() | other.keys(), Counts()
    while out.kills < kills:
        target, status, in_folder = folder / f"{name}-killed", None, 0
        while status is None:
            rest = None if out.kills == kills else rng.uniform(0, seconds)
            process, log = _started(stage, target)
            try:
                status = process.wait(rest)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                out.kills, in_folder = out.kills + 1, in_folder + 1
                bar.update()
            out.orphans += _orphans(process.pid)
            if not stage.replaces:
                there = _digests(target)
                out.torn += sum(there.get(path, held) != held for path, held in expected.items())
        found = _digests(target)
        if status == 0 and expected.items() <= found.items():
            out.identical += in_folder
        else:
            differing = [path for path, held in expected.items() if found.get(path) != held]
            tqdm.write(f"{name}: {differing[:5]} differ, status {status}: {_end(log)}")
        # A log of TensorBoard is named after the time at which it was begun.
        extra = [path for path in found.keys() - known if ".tfevents." not in path]
        if extra:
            tqdm.write(f"{name}: left over: {sorted(extra)[:5]}")
        out.left_over += len(extra)
        shutil.rmtree(target)
    return out


def _started(stage: Stage, target: Path) -> tuple[subprocess.Popen[bytes], Path]:
    """Start a stage in a process group of its own; return it, and the file of what it prints."""
    arguments = [str(target) if argument == "OUT" else argument for argument in stage.arguments]
    code = f"import sys; from lime_keras.{stage.module} import main; sys.exit(main(sys.argv[1:]))"
    log = target.with_name(f"{target.name}.txt")
    with log.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", code, *arguments],
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    return process, log


def _end(log: Path) -> str:
    return log.read_text(encoding="utf-8", errors="replace")[-1000:]


def _orphans(group: int) -> int:
    """Return how many processes of a group do not end by themselves, and end them."""
    end = time.monotonic() + _TO_END
    while (count := len(_living(group))) and time.monotonic() < end:
        time.sleep(0.1)
    if count:
        os.killpg(group, signal.SIGKILL)
    return count


def _living(group: int) -> list[int]:
    """Return the processes of a group; those that have ended and wait for their parent are none."""
    out = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, own = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:  # it has just ended
            continue
        if int(own) == group and state != "Z":
            out.append(int(path.parent.name))
    return out


def _digests(folder: Path) -> dict[str, str]:
    """Return the checksums of all files below a folder, by relative path."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


if __name__ == "__main__":
    sys.exit(main())
