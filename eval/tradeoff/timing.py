"""The speed and memory of one case, measured in a process of its own.

    python -m lime_keras.eval.tradeoff.timing < job.json

The process, which `measure` starts, loads only what a user's process loads. Its start, its memory
and its threads are therefore those of the user.
"""

import dataclasses
import itertools
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

from lime_keras import processors

from .cases import ASKED, KERAS, PAGE, PHOTO, SAVED_MODEL, STREAM, TimedUse

_QUIET = {
    "TF_CPP_MIN_LOG_LEVEL": "3",
    "CUDA_VISIBLE_DEVICES": "-1",
    "KERAS_BACKEND": "tensorflow",
    # As lime-live sets it: small products that wait by spinning take the networks' processor.
    "OPENBLAS_NUM_THREADS": "1",
}
_SIZE = 640, 480  # width and height of the picture in pixels: a camera's
_STEPS = (0, 3, 6, 9, 6, 3)
"""Pixels by which the frames of a stream are shifted in turn, so that none is like the last."""
EFFORT = {"warm_up": 3, "seconds": 1.0, "least": 5, "most": 200}
"""Calls of one process: some before the timed ones, which trace and allocate; then as many as fit
into the seconds, but at least and at most so many."""


def measure(
    case: TimedUse, path: Path, picture: Path, effort: Mapping[str, Any] = EFFORT
) -> dict[str, Any]:
    """Measure a case in a new process.

    Args:
        case: the case.
        path: what it runs (`models.Models.path`).
        picture: photo of an object.
        effort: number and duration of the calls, as in `EFFORT`.

    Returns:
        `seconds` of each timed call, and `cold_start_s`, from the start of the process to its first
        answer; but for a page also `networks_s` of each run of the networks alone, `busy`,
        processor seconds a second during the timed calls, and `peak_memory_mib` of the process.

    Raises:
        RuntimeError: if the process fails; the message holds the last line of its errors.
    """
    task = {
        "case": dataclasses.asdict(case),
        "path": str(path),
        "picture": str(picture),
        "effort": dict(effort),
        "began": time.monotonic(),
    }
    child = subprocess.run(
        [sys.executable, "-m", "lime_keras.eval.tradeoff.timing"],
        input=json.dumps(task),
        capture_output=True,
        text=True,
        env=os.environ | _QUIET,
    )
    if child.returncode:
        errors = child.stderr.strip().splitlines() or [f"exit status {child.returncode}"]
        raise RuntimeError(
            f"{case.name} cannot be timed: {errors[-1]}; a negative status is a signal, and -9 "
            "often too little memory"
        )
    return json.loads(child.stdout.splitlines()[-1])


def pooled(rounds: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Pool several results of `measure` for one case into one row.

    Returns:
        `ms` and `p95_ms` of an answer (median and 95th percentile of all calls), `samples` (number
        of calls), `spread` of the rounds' medians (relative), and the median of `cold_start_s`; but
        for a page also `networks_ms`, the medians of `busy`, and the largest `peak_memory_mib`.
    """
    seconds = np.concatenate([one["seconds"] for one in rounds])
    medians = [np.median(one["seconds"]) for one in rounds]
    out = {
        "ms": 1e3 * float(np.median(seconds)),
        "p95_ms": 1e3 * float(np.percentile(seconds, 95)),
        "samples": len(seconds),
        "spread": float((max(medians) - min(medians)) / np.median(seconds)),
        "cold_start_s": float(np.median([one["cold_start_s"] for one in rounds])),
    }
    if "networks_s" in rounds[0]:
        networks = np.concatenate([one["networks_s"] for one in rounds])
        out |= {
            "networks_ms": 1e3 * float(np.median(networks)),
            "busy": float(np.median([one["busy"] for one in rounds])),
            "peak_memory_mib": float(max(one["peak_memory_mib"] for one in rounds)),
        }
    return out


def main() -> None:
    """Read a job from standard input, measure it, and print the result."""
    task = json.load(sys.stdin)
    case, effort = TimedUse(**task["case"]), task["effort"]
    if hasattr(os, "sched_setaffinity"):
        # ONNX Runtime takes a thread for each core that the process may use (`processors`).
        cores = {processors.core(one): one for one in sorted(os.sched_getaffinity(0), reverse=True)}
        os.sched_setaffinity(0, sorted(cores.values())[: case.threads])
    path, frame = Path(task["path"]), _frame(Path(task["picture"]))
    if case.kind == PAGE:
        from . import browser

        asked = ASKED[PAGE][case.asked]
        seconds: list[float] = []
        with browser.opened(path, _stream(frame), asked, case.threads) as answer:
            answered = time.monotonic()
            for _ in range(effort["warm_up"] - 1):
                answer()
            # The page's own seconds, without the way to it.
            _repeated(lambda: seconds.append(answer()), effort)
        result: dict[str, Any] = {"seconds": seconds}
    else:
        call, networks = _prepared(case, path, frame)
        call()
        answered = time.monotonic()
        for _ in range(effort["warm_up"] - 1):
            call()
        seconds, busy = _repeated(call, effort)
        result = {"seconds": seconds, "busy": busy, "peak_memory_mib": _peak_memory() / 2**20}
        for _ in range(effort["warm_up"]):
            networks()
        result["networks_s"] = _repeated(networks, effort)[0]
    print(json.dumps(result | {"cold_start_s": answered - task["began"]}))


def _frame(picture: Path) -> np.ndarray:
    """Return the picture as a camera gives it, `(480, 640, 3)` uint8 sRGB."""
    from PIL import Image

    return np.asarray(Image.open(picture).convert("RGB").resize(_SIZE))


def _stream(frame: np.ndarray) -> list[np.ndarray]:
    """Return the frames of a stream, of which none is like the one before."""
    return [np.roll(frame, step, axis=1) for step in _STEPS]


def _prepared(
    case: TimedUse, path: Path, frame: np.ndarray
) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Load the model; return functions for one answer, and for the networks of one answer."""
    if case.runtime in (KERAS, SAVED_MODEL):
        return _whole(case, path, frame)
    from lime_keras.estimate.estimator import Estimator
    from lime_keras.outputs import available
    from lime_keras.runtime import engine as runtime

    stream, asked = case.kind == STREAM, ASKED[case.kind][case.asked]
    engine = runtime.load(path, precision=case.precision, streaming=stream)
    estimator = Estimator(path, None if stream else asked, engine)
    call = _of_stream(estimator, asked, frame) if stream else _of_photo(estimator, case, frame)
    # The networks alone: the mask once, and what the answer reads.
    needed, names = available(engine.outputs), ASKED[PHOTO][case.asked]
    outputs = {output for name in names or needed for output in needed[name]} - {"mask"}
    view = estimator.view(frame)
    inputs = {"image": view.image[None], "mask": view.mask[None]}
    return call, lambda: (
        engine.run(["mask"], {"image": inputs["image"]}),
        engine.run(sorted(outputs), inputs),
    )


def _of_photo(estimator: Any, case: TimedUse, frame: np.ndarray) -> Callable[[], Any]:
    if case.asked != "with the light":
        return lambda: estimator.estimate(frame)
    from lime_keras.lighting import guessed_light

    image = frame / np.float32(255)
    return lambda: guessed_light.estimate(image, estimator.estimate(frame))


def _of_stream(estimator: Any, asked: Mapping[str, bool], frame: np.ndarray) -> Callable[[], Any]:
    from lime_keras.live.session import FrameRequest, Session

    session, request = Session(estimator), FrameRequest(**asked)
    frames = itertools.cycle(_stream(frame))
    return lambda: session.process(next(frames), None, request)


def _whole(
    case: TimedUse, path: Path, frame: np.ndarray
) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return the same function twice, of a runtime that answers the networks' square alone."""
    import tensorflow as tf

    tf.config.threading.set_intra_op_parallelism_threads(case.threads)
    tf.config.threading.set_inter_op_parallelism_threads(1)
    from lime_keras.estimate import framing
    from lime_keras.runtime.keras_engine import KerasEngine
    from lime_keras.runtime.saved_model import SavedModel

    engine: KerasEngine | SavedModel
    engine = KerasEngine(path) if case.runtime == KERAS else SavedModel(path)
    square = framing.whole(*frame.shape[:2])
    inputs = {"image": framing.cut(frame, square, engine.size)[None]}

    def call() -> Any:
        return engine.run(engine.outputs, inputs)

    return call, call


def _repeated(call: Callable[[], Any], effort: Mapping[str, Any]) -> tuple[list[float], float]:
    """Time repeated calls; return the seconds of each, and processor seconds a second overall."""
    seconds: list[float] = []
    processor, began = time.process_time(), time.perf_counter()
    while len(seconds) < effort["most"] and (
        len(seconds) < effort["least"] or time.perf_counter() - began < effort["seconds"]
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
