"""The speed and memory of one model, measured in a separate process.

    python -m lime_keras.eval.tradeoff.timing < job.json

The process, which `measure` starts, loads only what a user of the runtime loads. Its start, its
memory and its threads are therefore those of the runtime.
"""

import dataclasses
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import runtimes

_QUIET_PROCESSOR = {
    "TF_CPP_MIN_LOG_LEVEL": "3",
    "CUDA_VISIBLE_DEVICES": "-1",
    "KERAS_BACKEND": "tensorflow",
}


@dataclasses.dataclass(frozen=True)
class Effort:
    """The number and duration of the calls that one process times.

    Attributes:
        warm_up: number of calls before the timed ones; the first calls trace and allocate.
        seconds: duration after which the process stops timing calls.
        least: least number of timed calls, even if they take longer than `seconds`.
        most: greatest number of timed calls.
    """

    warm_up: int = 3
    seconds: float = 2.0
    least: int = 5
    most: int = 200


@dataclasses.dataclass(frozen=True)
class Job:
    """A model and the conditions under which one process measures it.

    Attributes:
        runtime: name of the runtime (see `runtimes`).
        precision: name of the precision for Keras; the files of the other runtimes hold theirs.
        path: file or folder of the model.
        images: `.npy` file of images `(N, S, S, 3)` as input; None to feed noise into all inputs of
            an ONNX model.
        batch: number of images in a batch.
        threads: number of the runtime's threads.
        effort: number and duration of the calls.
    """

    runtime: str
    precision: str
    path: str
    images: str | None
    batch: int
    threads: int
    effort: Effort = Effort()


def measure(job: Job) -> dict[str, Any]:
    """Measure a job in a new process.

    Returns:
        `seconds` of each timed call; `cold_start_s`, from the start of the process to its first
        outputs, and its parts `import_s`, `load_s` and `first_s`; `busy`, processor seconds per
        second during the timed calls; and `peak_memory_mib` of the whole process.

    Raises:
        RuntimeError: if the process fails; the message holds the last line of its errors.
    """
    task = dataclasses.asdict(job) | {"began": time.monotonic()}
    child = subprocess.run(
        [sys.executable, "-m", "lime_keras.eval.tradeoff.timing"],
        input=json.dumps(task),
        capture_output=True,
        text=True,
        env=os.environ | _QUIET_PROCESSOR,
    )
    if child.returncode:
        said = child.stderr.strip().splitlines() or [f"exit status {child.returncode}"]
        raise RuntimeError(
            f"{job.path} cannot be timed under {job.runtime} with batch {job.batch}: {said[-1]}; "
            "a negative status is a signal, and -9 often too little memory"
        )
    return json.loads(child.stdout.splitlines()[-1])


def pooled(rounds: Sequence[Mapping[str, Any]], batch: int) -> dict[str, float]:
    """Pool several results of `measure` for one job into one row.

    Args:
        rounds: results of `measure`.
        batch: number of images in a batch.

    Returns:
        `latency_ms` and `p95_ms` of a batch (median and 95th percentile of all calls), `samples`
        (number of calls), `images_per_second`, `spread` of the rounds' medians (relative), medians
        of `cold_start_ms`, `import_ms`, `load_ms`, `first_ms` and `busy`, and the largest
        `peak_memory_mib`.
    """
    seconds = np.concatenate([one["seconds"] for one in rounds])
    medians = [np.median(one["seconds"]) for one in rounds]
    starts = {
        f"{name}_ms": 1e3 * float(np.median([one[f"{name}_s"] for one in rounds]))
        for name in ("cold_start", "import", "load", "first")
    }
    return {
        "latency_ms": 1e3 * float(np.median(seconds)),
        "p95_ms": 1e3 * float(np.percentile(seconds, 95)),
        "samples": len(seconds),
        "images_per_second": float(batch * len(seconds) / np.sum(seconds)),
        "spread": float((max(medians) - min(medians)) / np.median(seconds)),
        **starts,
        "busy": float(np.median([one["busy"] for one in rounds])),
        "peak_memory_mib": float(max(one["peak_memory_mib"] for one in rounds)),
    }


def main() -> None:
    """Read a job from standard input, measure it, and print the result."""
    task = json.load(sys.stdin)
    began = task.pop("began")
    job = Job(**task | {"effort": Effort(**task["effort"])})
    print(json.dumps(_measured(job, began)))


def _measured(job: Job, began: float) -> dict[str, Any]:
    """Measure a job in this process; return what `measure` returns.

    Args:
        job: model and conditions.
        began: monotonic clock at the start of the process, read by its parent; all processes of the
            system share this clock.
    """
    ready = time.monotonic()
    _import(job)
    imported = time.monotonic()
    call = _prepared(job)
    loaded = time.monotonic()
    call()
    answered = time.monotonic()
    for _ in range(job.effort.warm_up - 1):
        call()
    seconds, busy = _repeated(call, job.effort)
    return {
        "cold_start_s": answered - began,
        "import_s": imported - ready,
        "load_s": loaded - imported,
        "first_s": answered - loaded,
        "seconds": seconds,
        "busy": busy,
        "peak_memory_mib": _peak_memory() / 2**20,
    }


def _import(job: Job) -> None:
    """Import the runtime and nothing else; start TensorFlow with the job's threads."""
    if job.runtime == runtimes.ONNX:
        import onnxruntime  # noqa: F401

        return
    runtimes.start_tensorflow(job.threads)
    if job.runtime == runtimes.KERAS:
        import keras  # noqa: F401


def _prepared(job: Job) -> Callable[[], Any]:
    """Load the model, and return a function that runs it on one batch."""
    path = Path(job.path)
    if job.images is not None:
        images = np.load(job.images, mmap_mode="r")
        batch = np.resize(images[: job.batch], (job.batch, *images.shape[1:]))
        answer = runtimes.open_answer(job.runtime, path, job.precision, job.threads)
        return lambda: answer(batch)
    session = runtimes.session(path, job.threads)
    rng = np.random.default_rng(0)
    shapes = {one.name: (job.batch, *one.shape[1:]) for one in session.get_inputs()}
    noise = {name: rng.uniform(size=shape).astype(np.float32) for name, shape in shapes.items()}
    return lambda: session.run(None, noise)


def _repeated(call: Callable[[], Any], effort: Effort) -> tuple[list[float], float]:
    """Time repeated calls; return the seconds of each, and processor seconds per second overall."""
    seconds: list[float] = []
    processor, began = time.process_time(), time.perf_counter()
    while len(seconds) < effort.most and (
        len(seconds) < effort.least or time.perf_counter() - began < effort.seconds
    ):
        before = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - before)
    return seconds, (time.process_time() - processor) / (time.perf_counter() - began)


def _peak_memory() -> int:
    """Return the peak memory of this process in bytes.

    On Linux it is read from `/proc`, because `ru_maxrss` starts from the parent's value, and the
    parent holds TensorFlow.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        [line] = [x for x in status.read_text().splitlines() if x.startswith("VmHWM:")]
        return 1024 * int(line.split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    main()
