"""One model's speed and memory, measured in a process of its own.

    python -m lime_keras.eval.tradeoff.timing < job.json

The process loads what a user of that runtime loads and nothing else, so its start, its memory and
its threads are what they are said to be. `measure` starts it.
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
    """How much is measured in one process.

    Attributes:
        warm_up: calls before the clock counts: the first trace and allocate.
        seconds: measure for so long,
        least: but so many calls at least,
        most: and so many at most.
    """

    warm_up: int = 3
    seconds: float = 2.0
    least: int = 5
    most: int = 200


@dataclasses.dataclass(frozen=True)
class Job:
    """What one process measures.

    Attributes:
        runtime: a name out of `runtimes`.
        precision: of Keras' policies; the other runtimes' files hold theirs.
        path: the model.
        images: `.npy` of `(N, S, S, 3)` to answer; None for noise into every input of an ONNX
            model, whatever its inputs are.
        batch: images at once.
        threads: of the runtime.
        effort: how much is measured.
    """

    runtime: str
    precision: str
    path: str
    images: str | None
    batch: int
    threads: int
    effort: Effort = Effort()


def measure(job: Job) -> dict[str, Any]:
    """Run a job in a fresh process.

    Returns:
        `seconds` of each warm call; `cold_start_s`, from the start of the process to its first
        answer, with its parts `import_s`, `load_s` and `first_s`; `busy`, processor seconds a
        second while measuring; and `peak_memory_mib` of the whole process.

    Raises:
        RuntimeError: if the process fails; its last line says why.
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
    """Several `measure`s of one job as one row.

    Returns:
        `latency_ms` (median of all calls) and `p95_ms` of a batch, `samples`,
        `images_per_second`, `spread` of the rounds' medians (relative), median
        `cold_start_ms` with `import_ms`, `load_ms`, `first_ms`, median `busy`, and the largest
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
    """Read a job, measure, print the result."""
    task = json.load(sys.stdin)
    began = task.pop("began")
    job = Job(**task | {"effort": Effort(**task["effort"])})
    print(json.dumps(_measured(job, began)))


def _measured(job: Job, began: float) -> dict[str, Any]:
    """As `measure`; `began` is the parent's monotonic clock, which is the system's."""
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
    """Import and start the runtime alone, with its threads."""
    if job.runtime == runtimes.ONNX:
        import onnxruntime  # noqa: F401

        return
    runtimes.start_tensorflow(job.threads)
    if job.runtime == runtimes.KERAS:
        import keras  # noqa: F401


def _prepared(job: Job) -> Callable[[], Any]:
    """The model, loaded, as a call that answers one batch."""
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
    """Seconds of each call, and processor seconds a second over them all."""
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
    """Bytes that this process held at most.

    Not `ru_maxrss` where Linux can tell: it starts from the parent's, which holds TensorFlow.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        [line] = [x for x in status.read_text().splitlines() if x.startswith("VmHWM:")]
        return 1024 * int(line.split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    main()
