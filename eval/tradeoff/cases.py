"""The cases that the trade-off times: models, runtimes, precisions, batches and threads."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..source_code import code_of
from ..store import DependsOn, files_of, sha256, size
from . import machine, runtimes, timing
from .run_formats import EVERYTHING, PRECISIONS, Run
from .runtimes import KERAS, ONNX
from .samples import LARGEST_BATCH
from .timing import Effort, Job

SYSTEM, SUBNETWORK = "system", "subnetwork"
BATCHES = (1, 8, LARGEST_BATCH)


@dataclasses.dataclass(frozen=True)
class TimedCase:
    """A model in a configuration, to be timed.

    Attributes:
        model: name of the run.
        kind: `SYSTEM`, or `SUBNETWORK`: a single subnetwork with noise as its input.
        part: for a system, the requested outputs (a key of `Run.costs["parts"]`); for a subnetwork,
            its name.
        image_size: height and width of the images.
        runtime: name of the runtime (see `runtimes`).
        precision: name of the precision (see `run_formats.PRECISIONS`).
        batch: number of images in a batch.
        threads: number of the runtime's threads.
    """

    model: str
    kind: str
    part: str
    image_size: int
    runtime: str
    precision: str
    batch: int
    threads: int

    @property
    def name(self) -> str:
        """The name of the case, fit for a file name."""
        words = (self.model, self.kind, self.part, self.image_size, self.runtime, self.precision)
        slug = "-".join(map(str, words)).replace(",", "").replace(" ", "-")
        return f"{slug}-batch{self.batch}-threads{self.threads}"


class Bench:
    """The cases to time, with their models.

    Args:
        runs: trained runs by name.
    """

    def __init__(self, runs: Mapping[str, Run]):
        self._runs = runs

    def cases(self) -> list[TimedCase]:
        """Return all cases, each of them once.

        Every run is timed in each runtime and precision. Starting from ONNX Runtime in float32, one
        property at a time is then changed: batch, threads (in each precision), part and subnetwork.
        """
        return list(dict.fromkeys(case for run in self._runs.values() for case in _cases_of(run)))

    def job(self, case: TimedCase, effort: Effort) -> Job:
        """Return the job of a case for a process; write the model's files if they are missing."""
        run, images = self._runs[case.model], None
        if case.kind == SUBNETWORK:
            path = run.subnetwork(case.part)
        else:
            whole = case.part == EVERYTHING
            path = run.path(case.runtime, case.precision) if whole else run.part(case.part)
            images = str(run.samples.test(run.image_size))
        return Job(
            case.runtime, case.precision, str(path), images, case.batch, case.threads, effort
        )

    def depends_on(self, case: TimedCase, job: Job) -> DependsOn:
        """Return the inputs of a case's times, for the store: model, case, effort and machine.

        A model is what its files hold: one that was written again, the same, keeps its times.
        """
        about = machine.describe()
        hardware = {name: about[name] for name in ("processor", "cores", "instructions")}
        if case.runtime == KERAS:
            # The folder of the weights may hold more than these.
            model = self._runs[case.model].depends_on
        else:
            model = {"model": sha256(*files_of(Path(job.path)))}
        return {
            **model,
            "case": dataclasses.asdict(case),
            "effort": dataclasses.asdict(job.effort),
            "machine": hardware,
        }

    def code(self, case: TimedCase) -> str:
        """Return the hash of the code that times a case; with Keras, the networks' among it."""
        if case.runtime == KERAS:
            return code_of(timing.__name__)
        return code_of(timing.__name__, runtimes.__name__, alone=True)

    def costs(self, case: TimedCase, job: Job) -> dict[str, float]:
        """Return `model_mib` (size on disk), `parameters`, and `gflop` for one image."""
        run, files = self._runs[case.model], size(Path(job.path))
        costs = run.costs["subnetworks" if case.kind == SUBNETWORK else "parts"][case.part]
        if (case.kind, case.part) == (SYSTEM, EVERYTHING):
            files = run.file_size(case.runtime, case.precision)
        return {
            "model_mib": files / 2**20,
            "parameters": costs["parameters"],
            "gflop": costs["gflop"],
        }


def is_whole(row: Mapping[str, Any]) -> bool:
    """Return whether a row belongs to a whole system."""
    return (row["kind"], row["part"]) == (SYSTEM, EVERYTHING)


def compares_runtimes(row: Mapping[str, Any], cores: int) -> bool:
    """Return whether a row belongs to the full cross: a whole system, one image, all threads.

    The full cross is every run in every runtime and precision.
    """
    return is_whole(row) and (row["batch"], row["threads"]) == (1, cores)


def _cases_of(run: Run) -> Iterator[TimedCase]:
    cores = machine.cores()
    whole = TimedCase(run.name, SYSTEM, EVERYTHING, run.image_size, ONNX, "float32", 1, cores)
    for runtime, precisions in PRECISIONS.items():
        for precision in precisions:
            yield dataclasses.replace(whole, runtime=runtime, precision=precision)
    for batch in BATCHES:
        yield dataclasses.replace(whole, batch=batch)
    for precision in PRECISIONS[ONNX]:
        for threads in {1, min(2, cores)}:
            yield dataclasses.replace(whole, precision=precision, threads=threads)
    for part in run.costs["parts"]:
        yield dataclasses.replace(whole, part=part)
    for name in run.costs["subnetworks"]:
        yield dataclasses.replace(whole, kind=SUBNETWORK, part=name)
