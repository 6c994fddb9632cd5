"""The training of a whole run: all its stages, one after another, each resumable.

A run's folder holds:

- `config.json`: the record of the run;
- `stages/N-name.npz`: weights, optimiser state and step of a stage;
- `curves/N-name.csv`: losses and measures of a stage;
- `evaluation.json`: measures of the whole system on the held-out examples;
- `tensorboard/`: the same, with gradient norms and pictures;
- `model/`: the trained model with a copy of the record, and in `alone/` the weights that encoders
  had before joined training;
- `begun-from/`: a copy of the trained model that the run began with, if it did.
"""

import contextlib
import dataclasses
import functools
import hashlib
import json
import shutil
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import keras
import numpy as np

from lime_keras.io import atomic, locking
from lime_keras.networks import SUBNETWORKS, Architecture, build, weights
from lime_keras.networks.precision import computing_in

from . import backbone, hosts, initial_weights
from .budget import SAVING, Budget, Plan
from .config import Config, check, claim, config_path
from .data import Data
from .devices import Devices
from .evaluation import SystemEvaluation, evaluation_path
from .optimizer import OPTIMIZERS, LossScale
from .pace import Clock, Count
from .stage_model import StageModel
from .stage_training import Files, Progress, StageTraining, Tell
from .stages import WARM_UP, Stage
from .state import Checkpoint, Mark
from .terms import TERMS

_SECONDS_BETWEEN_MODELS = 120


def _alone(function: Callable[..., list[str]]) -> Callable[..., list[str]]:
    """Let a function lead one run's folder at a time; of joined processes, the first locks it."""

    @functools.wraps(function)
    def locked(paths: Sequence[Path], run: Path, *arguments: Any, **options: Any) -> list[str]:
        leads = hosts.place()[0] == 0
        lock = locking.alone(run, "lime-train is training") if leads else contextlib.nullcontext()
        with lock:
            return function(paths, run, *arguments, **options)

    return locked


@_alone
def train(
    paths: Sequence[Path],
    run: Path,
    config: Config,
    tell: Tell,
    *,
    only: Collection[str] | None = None,
    reuse: Path | None = None,
    start_from: Path | None = None,
    devices: int = 1,
    began: float | None = None,
) -> list[str]:
    """Run or resume the stages of a run, and write its trained subnetworks to `RUN/model/`.

    If the config has `minutes`, the stages are first compiled and measured. Then each gets a share
    of the time left (`train.budget`), and the model trained so far is written every two minutes.

    Several processes that `train.hosts` has joined train one run; each calls this function.

    Args:
        paths: folders of corpora with complete train splits, and of banks; training mixes them
            (`train.data.Data`).
        run: folder of the run; a run that was begun there with the same config is resumed.
        config: config of the run.
        tell: function called with the progress of training.
        only: names of the stages to train; by default all. Of the other stages, finished ones are
            loaded and unfinished ones skipped.
        reuse: folder of another run, whose finished stages are copied if they are the same stages.
        start_from: trained model whose hash is `config.begun_from`; not needed to resume a run.
        devices: number of devices of each process that each batch is split between.
        began: `time.monotonic()` from which on the time of this command counts; by default now.

    Returns:
        Names of the subnetworks without trained weights: no finished stage has trained them, and
        the run did not begin with weights for them. Empty if the run's model is complete; then it
        is also evaluated (`train.evaluation`).

    Raises:
        FileNotFoundError: if a corpus or bank is incomplete, or there is no run to reuse.
        ValueError: if the folder holds a run of another config; if a corpus or bank is too small,
            damaged, in another unit than the first, or of an image size that does not fit; if a
            stage's name is unknown; if a subnetwork is to be frozen that the run does not begin
            with; if the minutes are too few for a batch of each stage; or if several processes are
            called differently, or with minutes.
        RuntimeError: if a loss or a gradient is not finite, or another process is training the run.
    """
    began = monotonic() if began is None else began
    stages = stages_of(config)
    if unknown := sorted(set(only or ()) - {stage.name for stage in stages}):
        raise ValueError(
            f"no stage {', '.join(unknown)}: this run has {', '.join(s.name for s in stages)}"
        )
    process, processes = hosts.place()
    if devices < 1 or config.schedule.batch_size % (devices * processes):
        raise ValueError(
            f"batches of {config.schedule.batch_size} cannot be split between "
            f"{devices * processes} devices"
        )
    if processes > 1 and config.minutes is not None:
        raise ValueError("--minutes is the time of one process: leave it out beside --hosts")
    if reuse is not None and config.minutes is not None:
        raise ValueError("--reuse takes over stages of a number of batches: leave out --minutes")
    if reuse is not None and not (reuse / "stages").is_dir():
        raise FileNotFoundError(f"{reuse} holds no stages of a run to take over: check --reuse")
    data = Data(paths, config, (process, processes))
    check(run, config)
    hosts.agree({"options or data": dataclasses.asdict(config), "--devices": devices})
    if config.minutes is None and process == 0:
        claim(run, paths, config)  # with minutes, when they are known to be enough
    begun: list[str] = []
    alone: dict[str, list[np.ndarray]] = {}
    split = Devices(devices)
    with split.scope():
        subnetworks = _build(config)
        if start_from is not None and split.leads:
            initial_weights.keep(start_from, run)
        hosts.agree({"--start-from": start_from is not None})
        if config.begun_from is not None:
            begun, alone = initial_weights.load(run, subnetworks, record=split.leads)
        if config.architecture.pretrained and "segmentation" not in begun:
            backbone.begin(subnetworks["segmentation"])
        _freeze(config, subnetworks, begun)
    parts = _parts(run, config, stages, subnetworks, split, only, reuse)
    hosts.agree({"checkpoints or --stages": [[part.stage.name, *part.mark] for part in parts]})
    left = [part for part in parts if not part.finished]
    known = {*begun, *(name for part in parts for name in part.stage.subnetworks)}
    untrained = [name for name in subnetworks if name not in known]
    evaluation = None if untrained else SystemEvaluation(subnetworks, data, split)

    def prepared(part: _Part) -> StageTraining:
        with split.scope():
            _compile(part.model, part.stage, config)
        return StageTraining(part.stage, part.model, part.checkpoint, part.files, data, split, tell)

    timetable = None
    if config.minutes is not None and left:
        spent = max(part.mark.spent for part in parts)
        budget = Budget(config.minutes, began, spent)
        timetable = _Timetable(budget, left, prepared, evaluation, tell)
        claim(run, paths, config)
    written = monotonic()

    def write() -> None:
        nonlocal written
        trained = {name: one for name, one in subnetworks.items() if name in so_far}
        with split.alone():
            _write_model(run, config, trained, alone)
        written = monotonic()

    def keep() -> None:
        if timetable is not None and monotonic() - written > _SECONDS_BETWEEN_MODELS:
            write()

    so_far = set(begun)
    if "segmentation" in so_far:
        data.cut_out_by(subnetworks["segmentation"])
    for part in parts:
        name = part.stage.name
        so_far |= set(part.stage.subnetworks)
        if part.finished:
            part.checkpoint.restore(part.model)
            seconds_left = None if part.mark.progress is None else 0.0
            tell(Progress(part.stage, part.mark.step, {}, 0.0, left=seconds_left))
        elif timetable is None:
            prepared(part).run(Count(part.stage.steps), keep)
        else:
            timetable.run(keep)
        if name == "segmentation":
            data.cut_out_by(subnetworks[name])
        if name in SUBNETWORKS and SUBNETWORKS[name].encoder:
            alone[name] = subnetworks[name].get_weights()
    if parts:
        if split.leads:
            write()
        if evaluation is not None and (left or not evaluation_path(run).is_file()):
            evaluation.write(run)
    return untrained


@dataclasses.dataclass(frozen=True)
class _Part:
    """A stage to load or to train, with the point at which its checkpoint stands."""

    stage: Stage
    model: StageModel
    checkpoint: Checkpoint
    files: Files
    mark: Mark

    @property
    def finished(self) -> bool:
        if self.mark.progress is None:
            return self.mark.step == self.stage.steps
        return self.mark.progress >= 1


def stages_of(config: Config) -> list[Stage]:
    """Return the stages of a run that train a subnetwork that is not frozen."""
    frozen = set(config.frozen or ())
    stages = config.schedule.stages(config.architecture)
    return [stage for stage in stages if not frozen.issuperset(stage.subnetworks)]


def _freeze(config: Config, subnetworks: Mapping[str, keras.Model], begun: Collection[str]) -> None:
    """Make the frozen subnetworks keep their weights.

    Raises:
        ValueError: if there is no such subnetwork, or the run did not begin with weights for it.
    """
    for name in config.frozen or ():
        if name not in begun:
            why = "did not begin with its weights" if name in subnetworks else "has no such part"
            raise ValueError(
                f"--freeze {name}: this run {why}; pass --start-from with a model that has it"
            )
        subnetworks[name].trainable = False


def _parts(
    run: Path,
    config: Config,
    stages: Sequence[Stage],
    subnetworks: Mapping[str, keras.Model],
    split: Devices,
    only: Collection[str] | None,
    reuse: Path | None,
) -> list[_Part]:
    """Return the stages that are finished or to be trained, in order."""
    parts: list[_Part] = []
    trained: dict[str, str] = {}
    for number, stage in enumerate(stages, 1):
        with split.scope():
            model = StageModel(
                {part: subnetworks[part] for part in stage.subnetworks},
                config.compositing,
                config.schedule.structure,
                split.replicas,
            )
        signature = _signature(config, stage, model, trained)
        files = Files(run, f"{number}-{stage.name}")
        checkpoint = Checkpoint(files.checkpoint, signature)
        if reuse is not None:
            if split.leads:
                _take_over(reuse, stage, signature, files)
            hosts.agree({"--reuse": stage.name})
        part = _Part(stage, model, checkpoint, files, checkpoint.mark() or Mark(0))
        if part.finished or only is None or stage.name in only:
            parts.append(part)
            trained |= dict.fromkeys(stage.subnetworks, signature)
    return parts


class _Timetable:
    """The training of stages that share a budget: all are measured before the first is trained.

    Raises:
        ValueError: if the budget is too short for a batch of each stage.
    """

    def __init__(
        self,
        budget: Budget,
        parts: Sequence[_Part],
        prepared: Callable[[_Part], StageTraining],
        evaluation: SystemEvaluation | None,
        tell: Tell,
    ):
        self._budget = budget
        self._plans: list[Plan] = []
        self._trainings: list[StageTraining] = []

        def compiled(number: int) -> None:
            stage = parts[min(number, len(parts) - 1)].stage
            counted = (number, len(parts))
            tell(Progress(stage, 0, {}, 0.0, 0.0, budget.left, compiled=counted))

        compiled(0)
        # The model is written at the end, and the interpreter takes its time to stop.
        self._last = 2 * SAVING
        for number, part in enumerate(parts, 1):
            self._trainings.append(prepared(part))
            cost = self._trainings[-1].measure()
            self._plans.append(Plan(part.stage.steps, cost, part.mark.progress or 0.0))
            if evaluation is not None and number == 1:
                self._last += evaluation.measure()
            budget.check([plan.cost for plan in self._plans], len(parts), self._last)
            compiled(number)

    def run(self, keep: Callable[[], None]) -> None:
        """Train the next stage for its share of the time left."""
        seconds = self._budget.share(self._plans, self._last)
        plan, training = self._plans.pop(0), self._trainings.pop(0)
        training.run(Clock(self._budget, seconds, plan.cost.look, plan.done), keep)


def _write_model(
    run: Path,
    config: Config,
    subnetworks: Mapping[str, keras.Model],
    alone: Mapping[str, list[np.ndarray]],
) -> None:
    """Write the trained subnetworks with a copy of the run's record, in place of earlier ones."""
    with atomic.replacing(run / "model") as partial:
        before_joining = _changed_since(alone, subnetworks, config.architecture)
        weights.save(partial, config.architecture, subnetworks, before_joining)
        atomic.write(partial / "training.json", config_path(run).read_bytes())


def _build(config: Config) -> dict[str, keras.Model]:
    """Build the run's subnetworks with fresh weights, in the config's precision."""
    with computing_in(config.precision):
        return build(config.architecture, config.seed)


def _changed_since(
    earlier: Mapping[str, list[np.ndarray]],
    subnetworks: Mapping[str, keras.Model],
    architecture: Architecture,
) -> dict[str, keras.Model]:
    """Return copies, with the earlier weights, of the subnetworks whose weights have changed."""
    out = {}
    for name, values in earlier.items():
        now = subnetworks[name].get_weights()
        if not all(np.array_equal(one, other) for one, other in zip(values, now, strict=True)):
            # Keras' own function for copies imports TensorFlow under any backend.
            out[name] = SUBNETWORKS[name].build(architecture)
            out[name].set_weights(values)
    return out


def _compile(model: StageModel, stage: Stage, config: Config) -> None:
    """Compile a stage's model with its optimiser, and create the optimiser's variables."""
    groups = [
        (name, len(network.trainable_variables)) for name, network in model.subnetworks.items()
    ]
    rate: Any = stage.learning_rate
    if config.minutes is None:
        rate = _learning_rates(stage)
    optimizer: Any = OPTIMIZERS[stage.optimizer](rate, groups)
    if config.precision == "float16":
        optimizer = LossScale(optimizer)
    model.compile(optimizer=optimizer)
    optimizer.build(model.trainable_variables)


def _learning_rates(stage: Stage) -> Any:
    """Return the learning rates of a stage: a number, or a schedule of Keras."""
    rising = round(WARM_UP * stage.steps) if stage.optimizer == "muon" else 0
    if not stage.cosine:
        return stage.learning_rate
    if not rising:
        return keras.optimizers.schedules.CosineDecay(stage.learning_rate, stage.steps)
    return keras.optimizers.schedules.CosineDecay(
        0.0, stage.steps - rising, warmup_target=stage.learning_rate, warmup_steps=rising
    )


def _signature(config: Config, stage: Stage, model: StageModel, trained: Mapping[str, str]) -> str:
    """Return a hash of all that a stage's weights follow from: its settings and earlier stages."""
    follows_from: dict[str, Any] = {
        "stage": dataclasses.asdict(stage),
        "layers": {
            name: [
                (layer.name, [tuple(weight.shape) for weight in layer.weights])
                for layer in network.layers
            ]
            for name, network in model.subnetworks.items()
        },
        "size": config.architecture.size,
        "terms": {term: TERMS[term].weight for term in model.terms},
        "batch_size": config.schedule.batch_size,
        "seed": config.seed,
        "corpus": config.corpus_sha256,
        "camera": config.camera,
        "precision": config.precision,
        "earlier": {name: trained.get(name) for name in stage.subnetworks},
    }
    if config.minutes is not None:
        follows_from["minutes"] = config.minutes
    if config.begun_from is not None:
        follows_from["begun_from"] = config.begun_from
    if stage.optimizer == "adam":  # as runs recorded it that knew no other
        follows_from["stage"].pop("optimizer")
    if config.schedule.flips:
        follows_from["flips"] = True
    if config.schedule.repaints:
        follows_from["repaints"] = True
    if config.schedule.clutter and stage.subnetworks == ("segmentation",):
        follows_from["clutter"] = True
    if config.materials is not None:
        follows_from["materials"] = config.materials
    if config.frozen is not None:
        follows_from["frozen"] = config.frozen
    return hashlib.sha256(json.dumps(follows_from, sort_keys=True).encode()).hexdigest()


def _take_over(reuse: Path, stage: Stage, signature: str, files: Files) -> None:
    """Copy a finished stage from another run, if it is the same stage and not yet begun here.

    The stage may have another number in that run's file names.
    """
    if files.checkpoint.is_file():
        return
    for path in (reuse / "stages").glob(f"[0-9]-{stage.name}.npz"):
        mark = Checkpoint(path, signature).mark(refuse=False)
        if mark is not None and mark.step == stage.steps:
            other = Files(reuse, path.stem)
            for source, target in ((other.curve, files.curve), (path, files.checkpoint)):
                with atomic.replacing(target) as partial:
                    shutil.copyfile(source, partial)
