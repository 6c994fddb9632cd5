"""`lime-train`: run the training stages."""

import argparse
import dataclasses
import os
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.model import folder as model_folder

_PRESETS = ("smoke", "nano", "live", "paper")
_PRECISIONS = ("float32", "bfloat16", "float16")
_OPTIMIZERS = ("adam", "muon")  # `optimizer.OPTIMIZERS`, without Keras
_MATERIALS = ("uniform", "natural")  # `material_law.LAWS`, without NumPy
_PARTS = {
    "perceptual": "compositing",
    "mirror": "architecture.mirror",
    "dichromatic": "architecture.dichromatic",
    "dichromatic-shading": "architecture.dichromatic_shading",
    "hue": "architecture.hue",
    "pretrained": "architecture.pretrained",
    "linear": "architecture.linear",
}
"""What `--with` and `--without` name, and the field of the config that says whether it is there."""
_OPTIONS = {
    "preset": "preset",
    "scale_steps": "steps_scale",
    "scale_rate": "rate_scale",
    "steps": "schedule.steps",
    "rate": "schedule.rate",
    "average": "schedule.average",
    "optimizer": "schedule.optimizer",
    "size": "architecture.size",
    "width": "architecture.unet_width",
    "encoder_width": "architecture.encoder_width",
    "baseline": "architecture.system",
    "exponent": "architecture.exponent",
    "batch_size": "schedule.batch_size",
    "seed": "seed",
    "camera": "schedule.camera",
    "photos": "photos",
    "precision": "precision",
    "materials": "materials",
    "fresh": "fresh",
    "freeze": "frozen",
}
"""The field of the config that takes an option's value."""
_OF_RECIPES = ("recipe", "data", "out", "seed", "scale_steps", "reuse")
"""The options that `--recipe` takes; a recipe says the others itself."""
_EXAMPLE = """
examples:
  lime-train corpus --out runs/first --preset smoke
  lime-train corpus --out runs/first --resume
  lime-train meshes procedural --out runs/both --preset live --precision bfloat16
  lime-train corpus --out runs/wide --preset live --width 32 --batch-size 64
  lime-train corpus --out runs/no-mirror --preset paper --without mirror --reuse runs/paper
  lime-train --recipe live --data data/ --out runs/live

The stages: segmentation, specular, mirror, albedo and exponent, each subnetwork alone; then
specular+mirror, specular+mirror+exponent and specular+mirror+exponent+albedo, joined.
An interrupted command, run again, goes on from its last checkpoint, at most a minute back.

The recipes make sets of weights: they render corpora, train, and evaluate on validation scenes.
live begins with nothing, the others with the live that comes with the package.
best, live, nano and uniform train by Muon (MirrorNet by Adam, as its deep levels die otherwise),
builtin too, without any data of yours; live_adam is live whose S and encoders learn by Adam, as the
paper's do. The presets smoke and paper train by Adam, nano and live by Muon.

`tensorboard --logdir runs` shows the curves; KERAS_BACKEND=jax trains under JAX.

More: docs/how-to/training.md, docs/how-to/recipes.md, docs/how-to/machines.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = console.parser(
        prog="lime-train",
        usage="lime-train PATH [PATH ...] --out RUN (--preset NAME | --resume) [options]\n"
        "       lime-train --recipe NAME [--data DATA] --out RUN [options]",
        description="Train the networks on corpora of lime-render.",
        epilog=_EXAMPLE,
    )
    _add_data(out)
    _add_run(out)
    _add_networks(out)
    _add_schedule(out)
    _add_speed(out)
    return out


def _add_data(out: argparse.ArgumentParser) -> None:
    """Add the options of the data, and how it is seen."""
    data = out.add_argument_group("input")
    data.add_argument(
        "paths",
        nargs="*",
        type=Path,
        metavar="PATH",
        help="corpus that lime-render wrote; several are learnt from together",
    )
    data.add_argument(
        "--data",
        type=Path,
        metavar="DATA",
        help="for --recipe: folder with meshes and environments, of which it makes its corpora; a "
        "part of their train folders is kept for validation (docs/reference/data.md)",
    )
    data.add_argument(
        "--camera",
        action=argparse.BooleanOptionalAction,
        help="photograph the scenes: exposure, defocus, noise, clipping and JPEG of consumer "
        "cameras (default: on, but with paper)",
    )
    data.add_argument(
        "--photos",
        type=console.count,
        metavar="N",
        help="photos that a stage learns from, or fewer if it does not see as many; they are made "
        "before it and kept in RUN/photos, some 140 kB each at 128 pixels (default: 100000)",
    )
    data.add_argument(
        "--materials",
        nargs="+",
        choices=_MATERIALS,
        metavar="LAW",
        help="laws of the albedos: `uniform`, the paper's; `natural`, as common objects have them; "
        "or both in turns (default: uniform; validation scenes then keep their own)",
    )
    data.add_argument(
        "--cutouts",
        nargs=2,
        type=Path,
        metavar=("THINGS", "PLACES"),
        help="let SegmentationNet see photographs in half of each batch: of THINGS, a folder "
        "of PNG or WebP files cut out by their alpha channel, before PLACES, such as of "
        "lime-render views",
    )


def _add_run(out: argparse.ArgumentParser) -> None:
    """Add the options of the run's folder, and how it begins."""
    written = out.add_argument_group("output")
    written.add_argument("--out", type=Path, required=True, metavar="RUN", help="folder of the run")
    begun = written.add_mutually_exclusive_group(required=True)
    begun.add_argument(
        "--preset",
        choices=_PRESETS,
        help="smoke: small networks, minutes on two cores; nano: 64 pixels, for fast video; live: "
        "128 pixels, for video, hours; paper: section 5's sizes and schedule, 80 days of a core",
    )
    begun.add_argument(
        "--recipe",
        metavar="NAME",
        help="make a set of weights, corpora included: best, live, live_adam, nano, uniform, "
        "builtin, or a file of your own such as my.py; --out, --data, --seed, --reuse and "
        "--scale-steps go with it",
    )
    begun.add_argument(
        "--resume",
        action="store_true",
        help="go on with the run in RUN. An option that differs from its own is refused",
    )


def _add_networks(out: argparse.ArgumentParser) -> None:
    """Add the options of the sizes and parts of the networks."""
    networks = out.add_argument_group("networks")
    networks.add_argument(
        "--size",
        type=console.count,
        metavar="PIXELS",
        help="of the networks' images, a multiple of 32 (default: the preset's)",
    )
    networks.add_argument(
        "--width",
        type=console.count,
        metavar="CHANNELS",
        help="of the U-Nets' first level (default: the preset's)",
    )
    networks.add_argument(
        "--encoder-width",
        type=console.count,
        metavar="CHANNELS",
        help="of the encoders' first block; their dense layers change alike (default: the "
        "preset's)",
    )
    networks.add_argument(
        "--exponent",
        choices=("classification", "regression"),
        help="eight bins, or log10 s (default: classification)",
    )
    networks.add_argument(
        "--without",
        nargs="+",
        action="extend",
        choices=tuple(_PARTS),
        metavar="PART",
        help="leave out: perceptual, Eq. 5 in the loss; mirror, MirrorNet; dichromatic, the split "
        "of colours; dichromatic-shading, the same in SpecularNet alone; hue, m_d in the hue of "
        "the pixels; pretrained, the mask's encoder; linear, S and M as linear radiance, "
        "in place of log(1 + x)",
    )
    networks.add_argument(
        "--with",
        nargs="+",
        action="extend",
        choices=tuple(_PARTS),
        metavar="PART",
        help="put in, of the same",
    )
    networks.add_argument(
        "--baseline",
        choices=("reflectance-map",),
        help="in place of LIME, estimate a reflectance map and read the material from it. Stages: "
        "segmentation, reflectance_map, material, reflectance_map+material",
    )


def _add_schedule(out: argparse.ArgumentParser) -> None:
    """Add the options of the stages, their lengths and initial weights."""
    schedule = out.add_argument_group("schedule")
    # Lengths, rates and batches.
    lengths = schedule.add_mutually_exclusive_group()
    lengths.add_argument(
        "--scale-steps",
        type=console.positive,
        metavar="FACTOR",
        help="multiply the batches of each stage of the preset, and of a recipe also photos and "
        "scenes (default: 1)",
    )
    lengths.add_argument(
        "--steps",
        type=console.count,
        metavar="N",
        help="batches of every stage (default: the preset's, by stage)",
    )
    rates = schedule.add_mutually_exclusive_group()
    rates.add_argument(
        "--scale-rate",
        type=console.positive,
        metavar="FACTOR",
        help="multiply the preset's learning rates (default: 1); 0.25 suits --start-from with "
        "well-trained weights, which the full rate first makes worse",
    )
    rates.add_argument(
        "--rate",
        type=console.positive,
        metavar="RATE",
        help="largest learning rate of every stage (default: the preset's, by stage)",
    )
    schedule.add_argument(
        "--optimizer",
        choices=_OPTIMIZERS,
        help="muon for the inner convolutions, with Adam for the rest and for MirrorNet; or "
        "adam for all (default: the preset's)",
    )
    schedule.add_argument(
        "--average",
        type=_momentum,
        metavar="MOMENTUM",
        help="end each stage with the optimiser's moving average of the weights, of a momentum "
        "below 1, such as 0.999 for thousands of batches (default: with the last weights)",
    )
    schedule.add_argument(
        "--batch-size",
        type=console.count,
        metavar="EXAMPLES",
        help="in a batch; a large one fills a large GPU (default: the preset's)",
    )
    # Stages, and the weights that they begin with.
    schedule.add_argument(
        "--stages",
        nargs="+",
        metavar="STAGE",
        help="train only these; the finished ones of the others give their weights (default: all)",
    )
    schedule.add_argument(
        "--freeze",
        nargs="+",
        metavar="NAME",
        help="subnetworks that keep the weights of --start-from while joined stages train the "
        "others",
    )
    schedule.add_argument(
        "--start-from",
        type=model_folder.find,
        metavar="RUN",
        help="begin with the weights of another run, or of a set that comes with the package: of "
        "the trained subnetworks with the same layers",
    )
    schedule.add_argument(
        "--fresh", nargs="+", metavar="NAME", help="subnetworks that do not take these weights"
    )
    schedule.add_argument(
        "--reuse",
        type=Path,
        metavar="RUN",
        help="copy finished stages of another run where they are the same, as for ablations; of a "
        "recipe, all its steps",
    )
    schedule.add_argument("--seed", type=int, help="of weights, order and photos (default: 0)")


def _add_speed(out: argparse.ArgumentParser) -> None:
    """Add the options of precision, devices and processes."""
    speed = out.add_argument_group("speed")
    speed.add_argument(
        "--precision",
        choices=_PRECISIONS,
        help="of the inner layers; bfloat16 is faster on processors and GPUs that have it, and "
        "slower on others (default: float32)",
    )
    speed.add_argument(
        "--devices",
        type=int,
        default=1,
        metavar="N",
        help="GPUs of each process that share a batch (default: 1)",
    )
    speed.add_argument(
        "--hosts",
        type=console.count,
        metavar="N",
        help="processes that train together under JAX, such as one on each machine (default: 1)",
    )
    speed.add_argument("--host", type=int, metavar="K", help="number of this process, from 0")
    speed.add_argument(
        "--coordinator",
        metavar="HOST:PORT",
        help="address of process 0 with a free port there, the same for all processes",
    )


def main(argv: list[str] | None = None) -> int:
    """Train a run, or carry out a recipe, and return the exit status."""
    command = parser()
    options = command.parse_args(argv)
    if options.recipe is not None:
        if strange := _beside_a_recipe(command, options):
            command.error(
                f"{strange} does not go with --recipe, which says it itself or does without: write "
                "a recipe of your own (docs/how-to/recipes.md)"
            )
        return console.run(lambda: _carry_out(options), "the same command goes on from here")
    if not options.paths or options.data is not None:
        command.error("--data is for --recipe" if options.paths else "PATH is missing: a corpus")
    return console.run(lambda: _train(options), "the same command goes on from the last checkpoint")


def _beside_a_recipe(command: argparse.ArgumentParser, options: argparse.Namespace) -> str | None:
    """Return the first option or argument that a recipe does not take; None if there is none."""
    for action in command._actions:
        value = getattr(options, action.dest, action.default)
        if action.dest not in _OF_RECIPES and value not in (action.default, []):
            return action.option_strings[0] if action.option_strings else str(action.metavar)
    return None


def _carry_out(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "--out")
    console.require("lime-train --recipe", *console.EXTRAS["train"], *console.EXTRAS["render"])
    from .recipes import run

    # As Ctrl-C: the command that runs is ended, too.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    run.carry_out(
        options.recipe,
        options.out,
        data_folder=options.data,
        seed=options.seed,
        scale=options.scale_steps or 1.0,
        reuse=options.reuse,
    )
    return 0


def _momentum(text: str) -> float:
    """Parse the momentum of a moving average: above 0 and below 1."""
    value = float(text)
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not between 0 and 1")
    return value


def _train(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "--out")
    console.require("lime-train", "keras")
    if os.environ.get("KERAS_BACKEND", "tensorflow") == "tensorflow":
        console.import_tensorflow()
    if options.hosts is None and options.host is None and options.coordinator is None:
        return _train_here(options)
    _check_hosts(options)
    from . import hosts

    with hosts.joined(options.hosts, options.host, options.coordinator):
        return _train_here(options)


def _check_hosts(options: argparse.Namespace) -> None:
    """Raise ValueError if the options that join processes are incomplete or do not fit."""
    joining = (options.hosts, options.host, options.coordinator)
    if None in joining:
        raise ValueError("--hosts, --host and --coordinator belong together: pass all three")
    if not 0 <= options.host < options.hosts:
        raise ValueError(
            f"--host {options.host} is no number of one of {options.hosts} processes: pass "
            f"0 to {options.hosts - 1}"
        )
    name, _, port = options.coordinator.rpartition(":")
    if not (name and port.isdecimal() and 0 < int(port) < 65536):
        raise ValueError(
            f"--coordinator {options.coordinator} is no HOST:PORT: pass the address of process 0, "
            "such as 192.168.0.7:12345"
        )


def _train_here(options: argparse.Namespace) -> int:
    from . import graphs, hosts, summary, trainer

    config = config_of(options)
    leads = hosts.rank_and_size()[0] == 0
    with _Bars(trainer.stages_of(config)) as bars:
        untrained = trainer.train(
            options.paths,
            options.out,
            config,
            bars.tell if leads else lambda progress: None,
            only=options.stages,
            reuse=options.reuse,
            start_from=options.start_from,
            cutouts=options.cutouts and tuple(options.cutouts),  # of argparse, a list
            devices=options.devices,
            on_making=bars.making if leads else lambda what, done, total: None,
        )
    if not leads:
        return 0
    print(summary.table(options.out))
    if evaluated := summary.evaluation(options.out):
        print(f"\n{evaluated}\n")
    if untrained:
        print(
            f"no whole model yet: {', '.join(untrained)} not trained; run the other --stages, or "
            f"begin another run with --start-from {options.out}"
        )
    else:
        print(f"trained model in {options.out / 'model'}")
        print(graphs.write(options.out))
    return 0


def config_of(options: argparse.Namespace) -> Any:
    """Return the config: from the options, else from the resumed run, else from the preset."""
    from lime_keras.data.corpus import Split
    from lime_keras.networks import PRESETS

    from .config import Config, corpus_sha256, lobe_of
    from .stages import SCHEDULES

    asked, lobe = _overrides(options), lobe_of(options.paths)
    resumed = Config.read(options.out) if options.resume else None
    preset = options.preset if resumed is None else resumed.preset
    schedule = SCHEDULES[preset]
    if options.materials is not None and not schedule.repaints:
        raise ValueError(
            f"--materials: the preset {preset} shows the materials that "
            f"{', '.join(map(str, options.paths))} holds; render a corpus by `lime-render "
            "--materials`, or pass --preset live"
        )
    if options.materials and "natural" in options.materials and lobe == "printed":
        raise ValueError(
            "--materials natural has m_s in the unit of the furnace: render a corpus of that --lobe"
        )
    if "architecture.encoder_width" in asked:
        usual = PRESETS[preset]
        share = asked["architecture.encoder_width"] / usual.encoder_width
        asked["architecture.dense_width"] = max(1, round(usual.dense_width * share))
    data: dict[str, Any] = {
        "corpus_sha256": corpus_sha256(options.paths),
        "lobe": lobe,
        "plain_scenes": all(Split(path, "train").is_plain for path in options.paths),
    }
    if resumed is not None:
        return _with(dataclasses.replace(resumed, **data), asked)
    schedule = schedule.scaled(asked.get("steps_scale", 1.0), asked.get("rate_scale", 1.0))
    return _with(Config(preset, 1.0, PRESETS[preset], schedule, 0, **data), asked)


def _overrides(options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of the config that the options set, by their dotted names."""
    fields = {field: getattr(options, option) for option, field in _OPTIONS.items()}
    put_in, left_out = set(getattr(options, "with") or ()), set(options.without or ())
    if both := sorted(put_in & left_out):
        raise ValueError(f"--with and --without {' '.join(both)}: take one of them")
    lacking = ("dichromatic", "hue") if options.baseline is not None else ()
    if asked := [part for part in lacking if part in put_in]:
        raise ValueError(f"--with {' '.join(asked)}: the reflectance-map baseline has no such part")
    fields |= {_PARTS[part]: True for part in put_in} | {_PARTS[part]: False for part in left_out}
    fields |= {_PARTS[part]: False for part in lacking}
    if options.start_from is not None:
        fields["begun_from"] = model_folder.digest(options.start_from)
    if options.cutouts is not None:
        from .photos import cutouts

        fields["cutouts"] = cutouts.sha256(*options.cutouts)
    return {
        field: tuple(value) if isinstance(value, list) else value
        for field, value in fields.items()
        if value is not None
    }


def _with(config: Any, values: Mapping[str, Any]) -> Any:
    """Return a config with other values of some fields, given by their dotted names."""
    fields: dict[str, dict[str, Any]] = {"": {}}
    for path, value in values.items():
        part, _, name = path.rpartition(".")
        fields.setdefault(part, {})[name] = value
    own = fields.pop("")
    parts = {
        part: dataclasses.replace(getattr(config, part), **new) for part, new in fields.items()
    }
    return dataclasses.replace(config, **parts, **own)


class _Bars:
    """Progress bars, one for each stage: steps, rate, time left, mean losses and wait for data."""

    def __init__(self, stages: list[Any]):
        self._names = [stage.name for stage in stages]
        self._title, self._bar = "", console.Bar("", "")

    def __enter__(self) -> "_Bars":
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.__exit__()

    def tell(self, progress: Any) -> None:
        """Show the progress of a stage."""
        stage = progress.stage
        bar = self._named(f"{self._names.index(stage.name) + 1}/{len(self._names)} {stage.name}")
        shown = {name: f"{value:.3g}" for name, value in progress.losses.items() if name != "loss"}
        shown["data"] = f"{progress.data_wait:.0%}"
        bar.move(progress.step, stage.steps, shown)

    def making(self, what: str, done: int, total: int) -> None:
        """Show how much is there of what is made before a stage."""
        self._named(what, "photo").move(done, total)

    def _named(self, title: str, unit: str = "step") -> console.Bar:
        if title != self._title:
            self.__exit__()
            self._title, self._bar = title, console.Bar(title, unit)
        return self._bar
