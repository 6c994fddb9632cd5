"""The training of a whole run: all its stages, one after another, each resumable.

A run's folder holds:

- `config.json`: the record of the run;
- `stages/N-name.npz`: weights, optimiser state and step of a stage;
- `curves/N-name.csv`: losses and measures of a stage;
- `tensorboard/`: the same, with gradient norms and pictures;
- `model/`: the trained model with a copy of the record, and in `alone/` the weights that encoders
  had before joined training;
- `begun-from/`: a copy of the trained model that the run began with, if it did.
"""

import dataclasses
import hashlib
import json
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.io import atomic
from lime_keras.networks import SUBNETWORKS, build, weights
from lime_keras.networks.precision import computing_in

from . import initial_weights
from .config import Config, claim, config_path
from .data import Data
from .devices import Devices
from .optimizer import LossScale, WatchedAdam
from .stage_model import StageModel
from .stage_training import Files, Progress, StageTraining, Tell
from .stages import Stage
from .state import Checkpoint
from .terms import TERMS


def train(
    corpora: Sequence[Path],
    run: Path,
    config: Config,
    tell: Tell,
    *,
    only: Collection[str] | None = None,
    reuse: Path | None = None,
    start_from: Path | None = None,
    devices: int = 1,
) -> list[str]:
    """Run or resume the stages of a run, and write its trained subnetworks to `RUN/model/`.

    Args:
        corpora: folders with complete train splits; training mixes them.
        run: folder of the run; a run that was begun there with the same config is resumed.
        config: config of the run.
        tell: function called with the progress of training.
        only: names of the stages to train; by default all. Of the other stages, finished ones are
            loaded and unfinished ones skipped.
        reuse: folder of another run, whose finished stages are copied if they are the same stages.
        start_from: trained model whose hash is `config.begun_from`; not needed to resume a run.
        devices: number of devices that each batch is split between.

    Returns:
        Names of the subnetworks without trained weights: no finished stage has trained them, and
        the run did not begin with weights for them. Empty if the run's model is complete.

    Raises:
        FileNotFoundError: if a corpus is incomplete, or there is no run to reuse.
        ValueError: if the folder holds a run of another config; if a corpus is too small, damaged,
            in another unit than the first, or of an image size that does not fit; or if a stage's
            name is unknown.
        RuntimeError: if a loss or a gradient is not finite.
    """
    stages = config.schedule.stages(config.architecture)
    if unknown := sorted(set(only or ()) - {stage.name for stage in stages}):
        raise ValueError(
            f"no stage {', '.join(unknown)}: this run has {', '.join(s.name for s in stages)}"
        )
    if devices < 1 or config.schedule.batch_size % devices:
        raise ValueError(
            f"batches of {config.schedule.batch_size} cannot be split between {devices} devices"
        )
    if reuse is not None and not (reuse / "stages").is_dir():
        raise FileNotFoundError(f"{reuse} holds no stages of a run to take over: check --reuse")
    data = Data(corpora, config)
    _check_sizes(corpora, config.architecture.size)
    _check_units(corpora)
    claim(run, corpora, config)
    begun: list[str] = []
    alone: dict[str, list[np.ndarray]] = {}
    split = Devices(devices)
    with split.scope():
        subnetworks = _build(config)
        if start_from is not None:
            initial_weights.keep(start_from, run)
        if config.begun_from is not None:
            begun, alone = initial_weights.load(run, subnetworks)
    trained: dict[str, str] = {}
    for number, stage in enumerate(stages, 1):
        with split.scope():
            model = StageModel(
                {part: subnetworks[part] for part in stage.subnetworks},
                config.compositing,
                split.replicas,
            )
        signature = _signature(config, stage, model, trained)
        files = Files(run, f"{number}-{stage.name}")
        checkpoint = Checkpoint(files.checkpoint, signature)
        if reuse is not None:
            _take_over(reuse, stage, signature, files)
        if checkpoint.step() == stage.steps:
            checkpoint.restore(model)
            tell(Progress(stage, stage.steps, {}, 0.0))
        elif only is None or stage.name in only:
            with split.scope():
                _compile(model, stage, config.precision)
            StageTraining(stage, model, checkpoint, files, data, split, tell).run()
        else:
            continue
        trained |= dict.fromkeys(stage.subnetworks, signature)
        if stage.name in SUBNETWORKS and SUBNETWORKS[stage.name].encoder:
            alone[stage.name] = subnetworks[stage.name].get_weights()
    done = {name: network for name, network in subnetworks.items() if name in {*trained, *begun}}
    if trained:
        before_joining = _changed_since(alone, done)
        weights.save(run / "model", config.architecture, done, before_joining)
        atomic.write(run / "model" / "training.json", config_path(run).read_bytes())
    return [name for name in subnetworks if name not in done]


def _check_sizes(corpora: Sequence[Path], size: int) -> None:
    """Raise ValueError if a corpus' images cannot be averaged down to the networks' size."""
    for corpus in corpora:
        stored = Split(corpus, "train").size or size
        if stored % size:
            raise ValueError(
                f"{corpus} holds images of {stored} pixels, which cannot be averaged to the {size} "
                f"that the networks take: pass --size with a divisor of {stored}, or render with "
                f"--size {size} or a multiple of it"
            )


def _check_units(corpora: Sequence[Path]) -> None:
    """Raise ValueError if the corpora's specular albedos have different units."""
    first, *others = [Split(corpus, "train").shading for corpus in corpora]
    for corpus, shading in zip(corpora[1:], others, strict=True):
        if shading != first:
            raise ValueError(
                f"{corpus} was rendered with --shading {shading} and {corpora[0]} with {first}: "
                "their specular albedos have different units, so render one of them again"
            )


def _build(config: Config) -> dict[str, keras.Model]:
    """Build the run's subnetworks with fresh weights, in the config's precision."""
    with computing_in(config.precision):
        return build(config.architecture, config.seed)


def _changed_since(
    earlier: Mapping[str, list[np.ndarray]], subnetworks: Mapping[str, keras.Model]
) -> dict[str, keras.Model]:
    """Return copies, with the earlier weights, of the subnetworks whose weights have changed."""
    out = {}
    for name, values in earlier.items():
        now = subnetworks[name].get_weights()
        if not all(np.array_equal(one, other) for one, other in zip(values, now, strict=True)):
            out[name] = keras.models.clone_model(subnetworks[name])
            out[name].set_weights(values)
    return out


def _compile(model: StageModel, stage: Stage, precision: str) -> None:
    """Compile a stage's model with its optimiser, and create the optimiser's variables."""
    groups = [
        (name, len(network.trainable_variables)) for name, network in model.subnetworks.items()
    ]
    rate: Any = stage.learning_rate
    if stage.cosine:
        rate = keras.optimizers.schedules.CosineDecay(stage.learning_rate, stage.steps)
    optimizer: Any = WatchedAdam(rate, groups)
    if precision == "float16":
        optimizer = LossScale(optimizer)
    model.compile(optimizer=optimizer)
    optimizer.build(model.trainable_variables)


def _signature(config: Config, stage: Stage, model: StageModel, trained: Mapping[str, str]) -> str:
    """Return a hash of all that a stage's weights follow from: its settings and earlier stages."""
    follows_from = {
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
    if config.begun_from is not None:
        follows_from["begun_from"] = config.begun_from
    if config.schedule.flips:
        follows_from["flips"] = True
    if config.schedule.repaints:
        follows_from["repaints"] = True
    return hashlib.sha256(json.dumps(follows_from, sort_keys=True).encode()).hexdigest()


def _take_over(reuse: Path, stage: Stage, signature: str, files: Files) -> None:
    """Copy a finished stage from another run, if it is the same stage and not yet begun here.

    The stage may have another number in that run's file names.
    """
    if files.checkpoint.is_file():
        return
    for path in (reuse / "stages").glob(f"[0-9]-{stage.name}.npz"):
        if Checkpoint(path, signature).step(refuse=False) == stage.steps:
            other = Files(reuse, path.stem)
            for source, target in ((other.curve, files.curve), (path, files.checkpoint)):
                with atomic.replacing(target) as partial:
                    shutil.copyfile(source, partial)
