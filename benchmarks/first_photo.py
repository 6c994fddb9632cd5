"""The first photo: time and memory of the whole command, in ONNX Runtime and in Keras.

    python benchmarks/first_photo.py
    python benchmarks/first_photo.py photo.jpg --rounds 10

Each round runs `lime-estimate` once with each engine, once for a file that does not exist, and once
with `--full-size` for the drawn ball at 4000 × 3000 pixels, each in a new process, from its start
to its last file written. The engines take turns, so that other programs disturb them alike. The
table has the quietest round of each: the clock's time, the processors' time, which other programs
change less, and the largest resident memory. The ratios are medians over the rounds, each of two
neighbouring runs.

By default the photo is a drawn ball of 640 × 480 pixels.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

_RUN = """
import sys
from lime_keras.commands.estimate import main
status = main(sys.argv[1:])
# Unlike what `wait4` tells, this does not count the memory of the process that started this one.
print([line for line in open("/proc/self/status") if line.startswith("VmHWM:")][0].split()[1])
sys.exit(status)
"""
_ENGINES = ("onnx", "keras")
_MISSING, _LARGE = "missing file", "12 million pixels, --full-size"


@dataclass(frozen=True)
class Cost:
    """The cost of one process: seconds on the clock, seconds of processors, peak memory in MB."""

    clock: float
    processors: float
    memory: float


def main() -> None:
    """Print a table of the costs, and the ratios of Keras to ONNX Runtime."""
    arguments = _arguments()
    costs: dict[str, list[Cost]] = {name: [] for name in (*_ENGINES, _MISSING, _LARGE)}
    with tempfile.TemporaryDirectory() as scratch:
        photo = arguments.photo or _drawn(Path(scratch) / "ball.png", 640, 480)
        large = _drawn(Path(scratch) / "large.png", 4000, 3000)
        out = ["--overwrite", "--out", str(Path(scratch) / "materials")]
        for _ in range(1 + arguments.rounds):
            for engine in _ENGINES:
                costs[engine].append(_cost([str(photo), "--engine", engine, *out], 0))
            costs[_MISSING].append(_cost([str(Path(scratch) / "none.png")], 1))
            costs[_LARGE].append(_cost([str(large), "--full-size", *out], 0))
    print("| | clock | processors | memory |\n|---|---:|---:|---:|")
    for name, found in costs.items():
        # The first round reads files that are not in memory yet.
        least = [min(values) for values in zip(*map(_values, found[1:]), strict=True)]
        print(f"| {name} | {least[0]:.2f} s | {least[1]:.2f} s | {least[2]:.0f} MB |")
    onnx, keras = (np.array(list(map(_values, costs[name][1:]))) for name in _ENGINES)
    ratio = np.median(keras / onnx, axis=0)
    print(
        f"\nKeras takes {ratio[0]:.1f} times the time on the clock, {ratio[1]:.1f} times that of "
        f"the processors and {ratio[2]:.1f} times the memory, in the median of {len(onnx)} rounds"
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photo", nargs="?", type=Path, help="photo (default: a drawn ball)")
    parser.add_argument("--rounds", type=int, default=5, help="(default: 5, after one more)")
    return parser.parse_args()


def _cost(arguments: list[str], status: int) -> Cost:
    """Run the command in a new process and return its cost."""
    begun = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-c", _RUN, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    told = process.stdout.read() if process.stdout else ""
    _, ended, used = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begun
    process.returncode = os.waitstatus_to_exitcode(ended)
    if process.returncode != status:
        raise SystemExit(f"lime-estimate {' '.join(arguments)} ended with {process.returncode}")
    return Cost(seconds, used.ru_utime + used.ru_stime, int(told.split()[-1]) * 1024 / 1e6)


def _values(cost: Cost) -> tuple[float, float, float]:
    return cost.clock, cost.processors, cost.memory


def _drawn(path: Path, width: int, height: int) -> Path:
    """Write a lit ball before stripes and return its path."""
    x, y = np.meshgrid(np.linspace(-1.6, 1.6, width), np.linspace(-1.2, 1.2, height))
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    light = np.maximum(0.4 * x - 0.5 * y + 0.77 * z, 0)[..., None]
    lobe = np.maximum(0.21 * x - 0.27 * y + 0.94 * z, 0)[..., None] ** 100
    ball = np.array([0.5, 0.3, 0.2]) * light + 0.5 * lobe
    stripes = 0.4 + 0.2 * np.sin(12 * x + 5 * y)[..., None] * np.array([1.0, 0.5, -1.0])
    image = np.clip(np.where(z[..., None] > 0, ball, stripes), 0, 1)
    Image.fromarray(np.round(255 * image).astype(np.uint8)).save(path)
    return path


if __name__ == "__main__":
    main()
