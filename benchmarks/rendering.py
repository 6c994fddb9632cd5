"""The rate of rendering: examples a second on one core, by case and size; beside another checkout.

    python benchmarks/rendering.py [--shapes DIR --environments DIR] [--against PYTHON]

Cases: `maps` is a split of single maps and shapes as they are, `mixed` one of mixed lights of which
a quarter of the bodies are endless, as for training; both of the folders, or else built in. As in a
shard of 512 examples, every light and every body serves eight. Times are processor time of one
thread.
`--against` is the Python of another checkout's environment. Both then render the same scenes in
turns, and how many records have the same bytes stands beside the ratio. A round takes a minute.
"""

import argparse
import hashlib
import itertools
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

CASES = ("maps", "mixed")
_A_LIGHT = 8  # number of examples for each light and each body


def main() -> None:
    """Print a row for each case and size."""
    arguments = _arguments()
    if arguments.work:
        return _work(json.loads(arguments.work))
    with tempfile.TemporaryDirectory() as rooms:
        asked = {name: getattr(arguments, name) for name in ("shapes", "environments", "count")}
        task = json.dumps(asked | {"rooms": rooms}, default=lambda path: str(path.resolve()))
        pythons = [sys.executable, *([arguments.against] if arguments.against else [])]
        workers = [_Worker(python, task) for python in pythons]
        other = " there | ratio | same bytes |" if arguments.against else ""
        print(f"| case | size | examples/s |{other}\n|---|---:|---:|{'---:|' * other.count('|')}")
        for case, size in itertools.product(arguments.cases, arguments.sizes):
            _row(case, size, arguments.rounds, workers)


def _arguments() -> argparse.Namespace:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--shapes", type=Path)
    options.add_argument("--environments", type=Path)
    options.add_argument("--cases", nargs="+", choices=CASES, default=CASES)
    options.add_argument("--sizes", nargs="+", type=int, default=(128, 256))
    options.add_argument("--count", type=int, default=64, help="examples a round (default: 64)")
    options.add_argument("--rounds", type=int, default=3, help="(default: 3)")
    options.add_argument("--against", help="Python of another checkout's environment")
    options.add_argument("--work", help=argparse.SUPPRESS)
    return options.parse_args()


def _row(case: str, size: int, rounds: int, workers: "list[_Worker]") -> None:
    """Let the workers render in turns, and print their rates."""
    seconds: list[list[float]] = [[] for _ in workers]
    same = total = 0
    for number in range(rounds + 1):  # the first round compiles
        answers = [worker.render(case, size, number) for worker in workers]
        if number == 0:
            continue
        for times, answer in zip(seconds, answers, strict=True):
            times.append(answer["seconds"])
        pairs = list(zip(*(answer["records"] for answer in answers), strict=True))
        same, total = same + sum(len(set(pair)) == 1 for pair in pairs), total + len(pairs)
    rates = [total / sum(times) for times in seconds]
    line = f"| {case} | {size} | {rates[0]:.1f} |"
    if len(workers) > 1:
        ratios = [there / here for here, there in zip(*seconds, strict=True)]
        line += f" {rates[1]:.1f} | {np.median(ratios):.2f} ({min(ratios):.2f} … {max(ratios):.2f})"
        line += f" | {same} of {total} |"
    print(line, flush=True)


class _Worker:
    """A process that renders what it is asked for."""

    def __init__(self, python: str, task: str):
        self._python = python
        command = [python, __file__, "--work", task]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def render(self, case: str, size: int, number: int) -> dict[str, Any]:
        """Render the examples of a round, and return their seconds and the digests of records."""
        assert self._process.stdin and self._process.stdout  # noqa: S101
        print(json.dumps([case, size, number]), file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"{self._python} ended: see above")
        return json.loads(answer)


# ---- in the worker ---------------------------------------------------------------------------


def _work(task: dict[str, Any]) -> None:
    """Render rounds until the input ends."""
    from lime_keras.render.mitsuba_setup import variants

    variants.activate(variants.choose(), threads=1)
    from lime_keras import console

    console.import_tensorflow()
    from lime_keras.render.corpus.random_example import render_example

    for line in sys.stdin:
        case, size, number = json.loads(line)
        sources = _sources(task, case, number)
        count = task["count"]
        began, digests = time.process_time(), []
        for index in range(number * count, (number + 1) * count):
            example = render_example(0, index, sources, size=size, shard_size=count)
            digests.append(hashlib.sha256(example.record).hexdigest())
        seconds = time.process_time() - began
        print(json.dumps({"seconds": seconds, "records": digests}), flush=True)


def _sources(task: dict[str, Any], case: str, number: int) -> Any:
    """Return the sources of a round, with an eighth as many shapes and lights as examples."""
    from lime_keras.render.corpus.random_example import Sources
    from lime_keras.render.scene import environments, sources
    from lime_keras.render.shapes import meshes

    shapes, hdris = (Path(task[k]) if task[k] else None for k in _FOLDERS)
    bodies = sources.files(shapes, "train", meshes.EXTENSIONS)
    maps = sources.files(hdris, "train", environments.EXTENSIONS)
    lights: dict[str, Any] = {} if case == "maps" else {"law": "mixed"}
    found = Sources(
        sources.ShapeSource(bodies, "train", 0),
        sources.LightSource(maps, "train", 0, Path(task["rooms"]), **lights),
        sources.BackgroundSource(()),
        **({} if case == "maps" else {"endless": 0.25}),
    )
    most = max(task["count"] // _A_LIGHT, 1)
    rng = np.random.default_rng(number)
    found.shape_names = sources.random_subset(rng, found.shape_names, most)
    found.light_names = sources.random_subset(rng, found.light_names, most)
    # What a corpus has once, before its shards, is not timed: its rooms, and the maps to mix.
    for name in found.light_names:
        if case == "mixed":
            found._map(name)
        elif not environments and not (Path(task["rooms"]) / name).is_file():
            found._lights.render_room(name)
    return found


_FOLDERS = ("shapes", "environments")


if __name__ == "__main__":
    main()
