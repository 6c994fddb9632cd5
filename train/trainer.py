"""The training of a whole run: all its stages, one after another, each resumable.

A run's folder holds:

- `config.json`: the record of the run;
- `stages/N-name.npz`: weights, optimiser state and step of a stage;
- `curves/N-name.csv`: losses and measures of a stage;
- `evaluation.json`: measures of the whole system on the validation set;
- `tensorboard/`: the same, with gradient norms;
- `photos/`: the photos that it learns from (`train.photos`);
- `model/`: the trained model with a copy of the record.
"""

import contextlib
import dataclasses
import hashlib
import json
import math
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import keras

from lime_keras import console
from lime_keras.io import atomic, locking
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file, weights
from lime_keras.networks import build
from lime_keras.networks.precision import computing_in
from lime_keras.networks.wiring import Networks

from . import backbone, hosts, initial_weights
from .config import Config, claim, config_path
from .data import Data
from .devices import Devices
from .optimizer import BY_ADAM, OPTIMIZERS, LossScale
from .photos import answers
from .photos.making import OnMaking
from .stage_model import StageModel
from .stage_training import Progress, StageRun, StageTraining, Tell, evaluate
from .stages import WARM_UP, Schedule, Stage
from .state import Checkpoint
from .terms import TERMS

_EVALUATION = "evaluation.json"


def train(
    paths: Sequence[Path],
    run: Path,
    config: Config,
    tell: Tell,
    *,
    only: Collection[str] | None = None,
    reuse: Path | None = None,
    start_from: Path | None = None,
    cutouts: tuple[Path, Path] | None = None,
    devices: int = 1,
    on_making: OnMaking = lambda what, done, total: None,
) -> list[str]:
    """Run or resume the stages of a run, and write its trained subnetworks to `RUN/model/`.

    Several processes that `train.hosts` has joined train one run; each calls this function.

    Args:
        paths: folders of corpora with complete train splits; training mixes them.
        run: folder of the run; a run that was begun there with the same config is resumed.
        config: config of the run.
        tell: function called with the progress of training.
        only: names of the stages to train; by default all. Of the other stages, finished ones are
            loaded and unfinished ones skipped.
        reuse: folder of another run, whose finished stages are copied if they are the same stages.
        start_from: trained model whose hash is `config.begun_from`.
        cutouts: folders of photographs whose hash is `config.cutouts`.
        devices: number of devices of each process that each batch is split between.
        on_making: function called with what is made before a stage, how much of it is there, and
            how much there will be.

    Returns:
        Names of the subnetworks without trained weights: no finished stage has trained them, and
        the run did not begin with weights for them. Empty if the run's model is complete; then it
        is also evaluated on the validation set, each subnetwork on the predictions of the others.

    Raises:
        FileNotFoundError: if a corpus is incomplete, there is no run to reuse, or the model that
            the run began with is not given.
        ValueError: if the folder holds a run of another config; if a corpus is too small,
            damaged, or of an image size that does not fit; if a stage's name is unknown; if a
            subnetwork is to be frozen that the run does not begin with; or if several processes are
            called differently.
        RuntimeError: if a loss or a gradient is not finite, or another process is training the run.
    """
    _refuse(config, only, reuse, devices)
    split = Devices(devices)
    lock = locking.lock_folder(run, "lime-train is training")
    # Of joined processes, the first locks the folder.
    with lock if split.leads else contextlib.nullcontext():
        # Open: what is there agrees with the config, and among the processes.
        data = Data(paths, config, run, split, on_making, cutouts)
        hosts.assert_same({"options or data": dataclasses.asdict(config), "--devices": devices})
        is_new = not config_path(run).exists()
        claim(run, paths, config, leads=split.leads)
        try:
            opened = _Run(run, config, data, split, tell, only, reuse, start_from)
            opened.learn()
        except (ValueError, FileNotFoundError, console.MissingExtra):
            # So that the same folder takes the options that are mended.
            if is_new and split.leads and not any((run / "stages").glob("*.npz")):
                config_path(run).unlink()
            raise
        opened.evaluate()
    return opened.untrained


def _refuse(config: Config, only: Collection[str] | None, reuse: Path | None, devices: int) -> None:
    """Raise an error for options that contradict each other, whatever the folders hold."""
    names = [stage.name for stage in stages_of(config)]
    if not names:
        raise ValueError("--freeze leaves no stage to train: freeze fewer")
    if unknown := sorted(set(only or ()) - set(names)):
        raise ValueError(f"no stage {', '.join(unknown)}: this run has {', '.join(names)}")
    processes = hosts.rank_and_size()[1]
    if devices < 1 or config.schedule.batch_size % (devices * processes):
        raise ValueError(
            f"batches of {config.schedule.batch_size} cannot be split between "
            f"{devices * processes} devices"
        )
    if reuse is not None and not (reuse / "stages").is_dir():
        raise FileNotFoundError(f"{reuse} holds no stages of a run to take over: check --reuse")
    if config.precision == "float16" and config.architecture.linear:
        raise ValueError("float16 holds no linear radiance: pass --precision bfloat16")


class _Run:
    """A run whose subnetworks are built and whose stages are known: to learn, then to evaluate.

    Attributes:
        untrained: names of the subnetworks for which there are no trained weights, also at the end.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        data: Data,
        split: Devices,
        tell: Tell,
        only: Collection[str] | None,
        reuse: Path | None,
        start_from: Path | None,
    ):
        self._folder, self._config, self._data = folder, config, data
        self._split, self._tell = split, tell
        # The subnetworks, fresh or begun with.
        begun: list[str] = []
        with split.scope():
            with computing_in(config.precision):
                self._subnetworks = build(config.architecture, config.seed)
            if config.begun_from is not None:
                begun = initial_weights.load(start_from, self._subnetworks, config.fresh or ())
                _check_lobe(config, start_from, begun)
            elif config.fresh:
                raise ValueError("--fresh is for --start-from: pass it, or leave --fresh out")
            if config.architecture.pretrained and "segmentation" not in begun:
                backbone.begin(self._subnetworks["segmentation"])
        if begun and split.leads:
            fresh = [name for name in self._subnetworks if name not in begun]
            print(f"continued: {', '.join(begun)}; fresh: {', '.join(fresh) or 'none'}")
        _freeze(config, self._subnetworks, begun)
        if "segmentation" in begun:
            data.set_masker(self._subnetworks["segmentation"])
        self._trained = set(begun)
        # The stages, as far as their checkpoints stand.
        self._parts = self._open_stages(only, reuse)
        if split.leads and not all(part.is_finished for part in self._parts):
            (folder / _EVALUATION).unlink(missing_ok=True)  # of the system before
        positions = [[part.stage.name, part.step] for part in self._parts]
        hosts.assert_same({"checkpoints or --stages": positions})
        known = {*begun, *(name for part in self._parts for name in part.stage.subnetworks)}
        self.untrained = [name for name in self._subnetworks if name not in known]

    def _open_stages(self, only: Collection[str] | None, reuse: Path | None) -> list[StageRun]:
        """Return the stages that are finished or to be trained, in order."""
        config, out = self._config, []
        signatures: dict[str, str] = {}
        for number, stage in enumerate(stages_of(config), 1):
            networks = {part: self._subnetworks[part] for part in stage.subnetworks}
            frozen = answers.independent(networks, config.frozen or ())
            learning = {name: one for name, one in networks.items() if name not in frozen}
            kept = answers.read_by(learning, frozen)
            model = self._model(learning, kept)
            signature = _signature(config, stage, model, signatures)
            checkpoint = Checkpoint(self._folder, f"{number}-{stage.name}", signature)
            if reuse is not None:
                if self._split.leads:
                    _take_over(reuse, stage, signature, checkpoint)
                hosts.assert_same({"--reuse": stage.name})
            part = StageRun(stage, model, kept, checkpoint, checkpoint.step() or 0)
            if part.is_finished or only is None or stage.name in only:
                out.append(part)
                signatures |= dict.fromkeys(stage.subnetworks, signature)
        return out

    def _model(self, subnetworks: Networks, kept: Networks) -> StageModel:
        config, split = self._config, self._split
        with split.scope():
            return StageModel(
                subnetworks,
                config.compositing,
                config.schedule.losses,
                config.lobe,
                kept,
                split.replicas,
            )

    def learn(self) -> None:
        """Load the finished stages, train the others in order, and write the model."""
        for part in self._parts:
            if part.is_finished:
                part.checkpoint.restore(part.model)
                self._tell(Progress(part.stage, part.step, {}, 0.0))
            else:
                with self._split.scope():
                    _compile(part.model, part.stage, self._config)
                StageTraining(part, self._data, self._split, self._tell).run()
            self._trained |= set(part.stage.subnetworks)
            if part.stage.name == "segmentation":
                self._data.set_masker(self._subnetworks["segmentation"])
        if self._parts and self._split.leads:
            self._write()

    def evaluate(self) -> None:
        """Evaluate the whole system, if all of it is trained and something of it is new."""
        path, split = self._folder / _EVALUATION, self._split
        if not self._parts or self.untrained or path.is_file():
            return
        model = self._model(self._subnetworks, {})
        with split.scope():
            model.compile()
        _, measures, examples = evaluate(model, self._data.validation(model.features), split)
        if split.leads:
            finite = {name: v if math.isfinite(v) else None for name, v in measures.items()}
            text = json.dumps({"examples": examples, "measures": finite}, indent=1)
            atomic.write(path, text + "\n")

    def _write(self) -> None:
        """Write what is trained so far with a copy of the run's record, in place of the earlier."""
        trained = {n: one for n, one in self._subnetworks.items() if n in self._trained}
        with (
            self._split.without_distribution(),
            gloss_file.kept(self._folder),
            atomic.replacing(self._folder / "model") as partial,
        ):
            weights.save(partial, self._config.architecture, trained)
            atomic.write(partial / "training.json", config_path(self._folder).read_bytes())


def stages_of(config: Config) -> list[Stage]:
    """Return the stages of a run that train a subnetwork that is not frozen."""
    frozen = set(config.frozen or ())
    stages = config.schedule.stages(config.architecture)
    return [stage for stage in stages if not frozen.issuperset(stage.subnetworks)]


def _check_lobe(config: Config, model: Path | None, begun: Collection[str]) -> None:
    """Raise ValueError if subnetworks begin with an S of another unit than the corpora have."""
    others = [name for name in begun if name != "segmentation"]
    if model is not None and others and (lobe := model_folder.lobe(model)) != config.lobe:
        raise ValueError(
            f"{model} learnt S with --lobe {lobe}, and the corpora have {config.lobe}: leave out "
            f"--start-from, or add --fresh {' '.join(others)}"
        )


def _freeze(config: Config, subnetworks: Networks, begun: Collection[str]) -> None:
    """Make the frozen subnetworks keep their weights, which the run must have begun with."""
    for name in config.frozen or ():
        if name not in begun:
            why = "did not begin with its weights" if name in subnetworks else "has no such part"
            why = "begins with a fresh one (--fresh)" if name in (config.fresh or ()) else why
            raise ValueError(
                f"--freeze {name}: this run {why}; pass --start-from with a model that has it"
            )
        subnetworks[name].trainable = False


def _compile(model: StageModel, stage: Stage, config: Config) -> None:
    """Compile a stage's model with its optimiser, and create the optimiser's variables."""
    groups = [
        (name, len(network.trainable_variables)) for name, network in model.subnetworks.items()
    ]
    schedule = config.schedule
    options: dict[str, Any] = {"epsilon": schedule.epsilon}
    if schedule.average is not None:
        options |= {"use_ema": True, "ema_momentum": schedule.average}
    rates = _learning_rates(stage, schedule)
    optimizer: Any = OPTIMIZERS[stage.optimizer](rates, groups, **options)
    if config.precision == "float16":
        optimizer = LossScale(optimizer)
    model.compile(optimizer=optimizer)
    optimizer.build(model.trainable_variables)


def _learning_rates(stage: Stage, schedule: Schedule) -> Any:
    """Return the learning rates of a stage: a number, or a schedule of Keras."""
    rising = round(WARM_UP * stage.steps) if stage.optimizer == "muon" else 0
    if not schedule.cosine:
        if not schedule.decay:
            return stage.learning_rate
        return keras.optimizers.schedules.InverseTimeDecay(stage.learning_rate, 1, schedule.decay)
    if not rising:
        return keras.optimizers.schedules.CosineDecay(stage.learning_rate, stage.steps)
    return keras.optimizers.schedules.CosineDecay(
        0.0, stage.steps - rising, warmup_target=stage.learning_rate, warmup_steps=rising
    )


def _signature(config: Config, stage: Stage, model: StageModel, trained: Mapping[str, str]) -> str:
    """Return a hash of all that a stage's weights follow from: its settings and earlier stages."""
    schedule = config.schedule
    alone = stage.subnetworks == ("segmentation",)
    mixed = stage.optimizer == "muon" and not set(BY_ADAM).isdisjoint(model.subnetworks)
    shared = {name: getattr(schedule, name) for name in ("cosine", "epsilon", "decay", "average")}
    follows_from = {
        # Without what it does not have, so that stages begun before there was an average go on.
        "stage": {k: v for k, v in (vars(stage) | shared).items() if v is not None},
        **({"by_adam": BY_ADAM} if mixed else {}),
        "layers": {
            name: [
                (layer.name, [tuple(weight.shape) for weight in layer.weights])
                for layer in network.layers
            ]
            for name, network in model.subnetworks.items()
        },
        "size": config.architecture.size,
        "terms": {term: TERMS[term].weight for term in model.terms},
        "batch_size": schedule.batch_size,
        "losses": schedule.losses,
        "images": [schedule.camera, schedule.flips, schedule.repaints, schedule.paints],
        "found_masks": schedule.found_masks,
        "cutouts": config.cutouts if alone else None,
        "seed": config.seed,
        "corpus": config.corpus_sha256,
        "lobe": config.lobe,
        "photos": config.photos,
        "materials": config.materials,
        "precision": config.precision,
        "begun_from": [config.begun_from, config.fresh] if config.fresh else config.begun_from,
        "frozen": config.frozen,
        "earlier": {
            name: trained.get(name)
            for name in (*stage.subnetworks, *(["segmentation"] if schedule.found_masks else []))
        },
    }
    return hashlib.sha256(json.dumps(follows_from, sort_keys=True).encode()).hexdigest()


def _take_over(reuse: Path, stage: Stage, signature: str, here: Checkpoint) -> None:
    """Copy a finished stage from another run, if it is the same stage and not yet begun here.

    The stage may have another number in that run's file names.
    """
    if here.path.is_file():
        return
    for path in (reuse / "stages").glob(f"[0-9]-{stage.name}.npz"):
        other = Checkpoint(reuse, path.stem, signature)
        if other.step(refuse=False) == stage.steps:
            (here.path.parents[1] / _EVALUATION).unlink(missing_ok=True)
            for source, target in ((other.curve_path, here.curve_path), (path, here.path)):
                with atomic.replacing(target) as partial:
                    shutil.copyfile(source, partial)
