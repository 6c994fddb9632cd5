"""What the trade times: which models, in which batches, on how many threads."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..store import DependsOn, Store, size
from . import machine
from .run_formats import EVERYTHING, PRECISIONS, Run
from .runtimes import ONNX
from .samples import LARGEST_BATCH
from .timing import Effort, Job
from .yardsticks import NETWORKS, Yardstick

SYSTEM, SUBNETWORK, YARDSTICK = "system", "subnetwork", "yardstick"
BATCHES = (1, 8, LARGEST_BATCH)


@dataclasses.dataclass(frozen=True)
class Case:
    """One thing to time.

    Attributes:
        model: name of the run, or of the yardstick.
        kind: `SYSTEM`, `SUBNETWORK` (one alone, fed with noise) or `YARDSTICK`.
        part: of a system, what is asked of it; of a subnetwork, which.
        image_size: height and width of the images.
        runtime: out of `runtimes`.
        precision: out of `run_formats.PRECISIONS`.
        batch: images at once.
        threads: of the runtime.
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
        """For a file."""
        words = (self.model, self.kind, self.part, self.image_size, self.runtime, self.precision)
        slug = "-".join(map(str, words)).replace(",", "").replace(" ", "-")
        return f"{slug}-batch{self.batch}-threads{self.threads}"


class Bench:
    """The models of all cases.

    Args:
        runs: trained ones by name.
        store: keeps the yardsticks.
    """

    def __init__(self, runs: Mapping[str, Run], store: Store):
        self._runs = runs
        sizes = sorted({run.image_size for run in runs.values()})
        self._yardsticks = {
            (name, side): Yardstick(name, side, store) for name in NETWORKS for side in sizes
        }

    def cases(self) -> list[Case]:
        """Each case once.

        Of every run each runtime in each precision, and one change at a time around ONNX Runtime:
        batch, threads (in each of its precisions), part and subnetwork; and the yardsticks.
        """
        yardsticks = [
            Case(name, YARDSTICK, EVERYTHING, side, ONNX, "float32", 1, machine.cores())
            for name, side in self._yardsticks
        ]
        of_runs = (case for run in self._runs.values() for case in _cases_of(run))
        return list(dict.fromkeys([*of_runs, *yardsticks]))

    def job(self, case: Case, effort: Effort) -> Job:
        """The case as a process is given it; writes the model's files where they are not there."""
        of, images = self._model(case), None
        if isinstance(of, Yardstick):
            path = of.path
        elif case.kind == SUBNETWORK:
            path = of.subnetwork(case.part)
        else:
            whole = case.part == EVERYTHING
            path = of.path(case.runtime, case.precision) if whole else of.part(case.part)
            images = str(of.samples.test(of.image_size))
        return Job(
            case.runtime, case.precision, str(path), images, case.batch, case.threads, effort
        )

    def depends_on(self, case: Case, effort: Effort) -> DependsOn:
        """What a case's times follow from."""
        about = machine.describe()
        hardware = {name: about[name] for name in ("processor", "cores", "instructions")}
        return {
            **self._model(case).depends_on,
            "case": dataclasses.asdict(case),
            "effort": dataclasses.asdict(effort),
            "machine": hardware,
        }

    def costs(self, case: Case, job: Job) -> dict[str, float]:
        """`model_mib` on disk, `parameters`, and `gflop` for one image."""
        of = self._model(case)
        files = size(Path(job.path))
        if isinstance(of, Yardstick):
            costs = of.costs
        else:
            costs = of.costs["subnetworks" if case.kind == SUBNETWORK else "parts"][case.part]
            if (case.kind, case.part) == (SYSTEM, EVERYTHING):
                files = of.file_size(case.runtime, case.precision)
        return {
            "model_mib": files / 2**20,
            "parameters": costs["parameters"],
            "gflop": costs["gflop"],
        }

    def _model(self, case: Case) -> Run | Yardstick:
        if case.kind == YARDSTICK:
            return self._yardsticks[case.model, case.image_size]
        return self._runs[case.model]


def is_whole(row: Mapping[str, Any]) -> bool:
    """Whether a row is of a whole system."""
    return (row["kind"], row["part"]) == (SYSTEM, EVERYTHING)


def is_crossed(row: Mapping[str, Any], cores: int) -> bool:
    """Whether a row is of the full cross: a whole system, one image, all threads."""
    return is_whole(row) and (row["batch"], row["threads"]) == (1, cores)


def _cases_of(run: Run) -> Iterator[Case]:
    cores = machine.cores()
    whole = Case(run.name, SYSTEM, EVERYTHING, run.image_size, ONNX, "float32", 1, cores)
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
