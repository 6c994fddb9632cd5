"""`lime-train`: run the training stages."""

import argparse
from pathlib import Path
from typing import Any

from lime_keras import console
from lime_keras.version import __version__

_PRESETS = ("smoke", "live", "paper")
_PRECISIONS = ("float32", "bfloat16", "float16")
_EXAMPLE = """
examples:
  lime-train corpus --out runs/first --preset smoke
  lime-train corpus --out runs/paper --preset paper --precision bfloat16
  lime-train corpus --out runs/paper --resume
  lime-train meshes procedural --out runs/both --preset live
  lime-train corpus --out runs/64 --preset live --size 64 --stages segmentation specular mirror
  lime-train corpus --out runs/live --preset live --start-from runs/64
  lime-train corpus --out runs/no-mirror --preset paper --without mirror --reuse runs/paper
  tensorboard --logdir runs

Stages: the five subnetworks alone on truth (segmentation, specular, mirror, albedo, exponent), then
specular+mirror, specular+mirror+exponent and specular+mirror+exponent+albedo joined. An interrupted
command, run again, goes on from its last checkpoint, at most a minute back. The last tenth of
each train split's files is held out for validation.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = argparse.ArgumentParser(
        prog="lime-train",
        description="Train the subnetworks of LIME on corpora of `lime-render`.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument(
        "corpora",
        nargs="+",
        type=Path,
        metavar="CORPUS",
        help="folder that lime-render wrote; of several all are learnt from together",
    )
    out.add_argument("--out", type=Path, required=True, metavar="RUN", help="folder of the run")
    begun = out.add_mutually_exclusive_group(required=True)
    begun.add_argument(
        "--preset",
        choices=_PRESETS,
        help="smoke: small networks, minutes on two cores; live: for video, hours; paper: section "
        "5's sizes and schedule, days on a GPU",
    )
    begun.add_argument(
        "--resume",
        action="store_true",
        help="go on with the run that is there, as it was begun; an option that says otherwise is "
        "refused with the difference",
    )
    out.add_argument(
        "--scale-steps",
        type=_positive,
        metavar="FACTOR",
        help="train each stage for so many times the preset's batches (default: 1)",
    )
    out.add_argument(
        "--width",
        type=console.count,
        metavar="CHANNELS",
        help="of the U-Nets' first level (default: the preset's)",
    )
    out.add_argument(
        "--size",
        type=console.count,
        metavar="PIXELS",
        help="of the networks' images, a multiple of 32 (default: the preset's)",
    )
    out.add_argument(
        "--without",
        nargs="+",
        choices=("perceptual", "mirror"),
        metavar="PART",
        help="the paper's ablations: `perceptual`, no Eq. 5 in AlbedoNet's loss; `mirror`, no "
        "MirrorNet, the exponent from S alone",
    )
    out.add_argument(
        "--exponent",
        choices=("classification", "regression"),
        help="eight bins, or log10 s (default: classification)",
    )
    out.add_argument(
        "--baseline",
        choices=("reflectance-map",),
        help="in place of LIME: estimate a reflectance map and read the material from it; its "
        "stages are segmentation, reflectance_map, material and reflectance_map+material",
    )
    out.add_argument(
        "--stages",
        nargs="+",
        metavar="STAGE",
        help="train only these; of the others, finished ones give their weights (default: all)",
    )
    out.add_argument(
        "--reuse",
        type=Path,
        metavar="RUN",
        help="take over another run's finished stages where they are the same, as for ablations",
    )
    out.add_argument(
        "--start-from",
        type=Path,
        metavar="RUN",
        help="begin with the weights of another run, of those subnetworks that it has trained and "
        "that have the same layers: to train on, or to begin at a smaller --size, where U-Nets "
        "learn the coarse things in half the time",
    )
    out.add_argument(
        "--precision",
        choices=_PRECISIONS,
        help="of the networks' inner layers; bfloat16 is faster on processors and GPUs that know "
        "it, and slower on others (default: float32)",
    )
    out.add_argument(
        "--devices",
        type=int,
        default=1,
        metavar="N",
        help="split each batch between so many GPUs (default: 1)",
    )
    out.add_argument(
        "--camera",
        action=argparse.BooleanOptionalAction,
        help="photograph each image anew every time it is seen: exposure, defocus, noise, clipping "
        "and JPEG of consumer cameras (default: on)",
    )
    out.add_argument("--seed", type=int, help="of weights, order and photos (default: 0)")
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Train a run and return the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _train(options), "the same command goes on from the last checkpoint")


def _train(options: argparse.Namespace) -> int:
    console.require("lime-train", "keras")
    console.import_tensorflow()
    from . import initial_weights, summary, trainer

    config = _config(options)
    with _Bars(config.schedule.stages(config.architecture)) as bars:
        untrained = trainer.train(
            options.corpora,
            options.out,
            config,
            bars.tell,
            only=options.stages,
            reuse=options.reuse,
            start_from=options.start_from,
            devices=options.devices,
        )
    print(summary.table(options.out))
    if config.begun_from is not None:
        print(initial_weights.described(options.out))
    if untrained:
        print(
            f"no whole model yet: {', '.join(untrained)} not trained; run the other --stages, or "
            f"begin another run with --start-from {options.out}"
        )
    else:
        print(f"trained model in {options.out / 'model'}")
    return 0


def _config(options: argparse.Namespace) -> Any:
    """Return the config: from the options, else from the resumed run, else from the defaults."""
    import dataclasses

    from lime_keras.networks import PRESETS

    from . import initial_weights
    from .config import Config, corpus_sha256
    from .stages import SCHEDULES

    held = Config.read(options.out) if options.resume else None

    def chosen(asked: Any, of_held: Any, default: Any) -> Any:
        if asked is not None:
            return asked
        return default if held is None else of_held(held)

    preset = chosen(options.preset, lambda c: c.preset, None)
    sizes = PRESETS[preset]
    scale = chosen(options.scale_steps, lambda c: c.steps_scale, 1.0)
    without = options.without
    return Config(
        preset=preset,
        steps_scale=scale,
        architecture=dataclasses.replace(
            sizes,
            size=chosen(options.size, lambda c: c.architecture.size, sizes.size),
            unet_width=chosen(options.width, lambda c: c.architecture.unet_width, sizes.unet_width),
            system=chosen(options.baseline, lambda c: c.architecture.system, "lime"),
            mirror=chosen(
                None if without is None else "mirror" not in without,
                lambda c: c.architecture.mirror,
                True,
            ),
            exponent=chosen(options.exponent, lambda c: c.architecture.exponent, "classification"),
        ),
        schedule=SCHEDULES[preset].scaled(scale),
        seed=chosen(options.seed, lambda c: c.seed, 0),
        corpus_sha256=corpus_sha256(options.corpora),
        camera=chosen(options.camera, lambda c: c.camera, True),
        compositing=chosen(
            None if without is None else "perceptual" not in without,
            lambda c: c.compositing,
            True,
        ),
        precision=chosen(options.precision, lambda c: c.precision, "float32"),
        begun_from=chosen(
            None if options.start_from is None else initial_weights.sha256(options.start_from),
            lambda c: c.begun_from,
            None,
        ),
    )


class _Bars:
    """Progress bars, one for each stage: steps, rate, time left, mean losses and wait for data."""

    def __init__(self, stages: list[Any]):
        self._names = [stage.name for stage in stages]
        self._stage: Any = None
        self._bar: console.Bar | None = None

    def __enter__(self) -> "_Bars":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.__exit__()

    def tell(self, progress: Any) -> None:
        """Show the progress of a stage."""
        stage = progress.stage
        if self._bar is None or stage is not self._stage:
            self.__exit__()
            self._stage = stage
            number = self._names.index(stage.name) + 1
            self._bar = console.Bar(f"{number}/{len(self._names)} {stage.name}", "step")
        terms = {name: f"{value:.3g}" for name, value in progress.losses.items() if name != "loss"}
        waited = {"data": f"{progress.data_wait:.0%}"}
        self._bar.move(progress.step, stage.steps, terms | waited)


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value
