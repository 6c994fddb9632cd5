"""`lime-train`: run the training stages."""

import argparse
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_EXAMPLE = """
examples:
  lime-train corpus --out runs/first --preset smoke
  lime-train corpus --out runs/paper --preset paper

Stages: the five subnetworks alone on truth, then SpecularNet + MirrorNet, + ExponentNet,
+ AlbedoNet joined. An interrupted command, run again, goes on from its last checkpoint, at most a
minute back. The last tenth of the train split's files is held out for validation.
"""


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    out = argparse.ArgumentParser(
        prog="lime-train",
        description="Train the five subnetworks of LIME on a corpus of `lime-render`.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("corpus", type=Path, metavar="CORPUS", help="folder that lime-render wrote")
    out.add_argument("--out", type=Path, required=True, metavar="RUN", help="folder of the run")
    out.add_argument(
        "--preset",
        choices=("smoke", "paper"),
        required=True,
        help="smoke: small networks, minutes on two cores; paper: section 5's sizes and schedule, "
        "days on a GPU",
    )
    out.add_argument(
        "--camera",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="photograph each image anew every time it is seen: exposure, defocus, noise, clipping "
        "and JPEG of consumer cameras (default: on)",
    )
    out.add_argument(
        "--seed", type=int, default=0, help="of weights, order and photos (default: 0)"
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Train a run; returns the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _train(options), "the same command goes on from the last checkpoint")


def _train(options: argparse.Namespace) -> int:
    console.import_tensorflow()
    from lime_keras.networks import PRESETS

    from . import trainer
    from .config import Config, corpus_sha256
    from .stages import SCHEDULES

    config = Config(
        preset=options.preset,
        architecture=PRESETS[options.preset],
        schedule=SCHEDULES[options.preset],
        seed=options.seed,
        corpus_sha256=corpus_sha256(options.corpus),
        camera=options.camera,
    )
    with _Progress() as progress:
        trainer.train(options.corpus, options.out, config, progress.tell)
    print(f"trained model in {options.out / 'model'}")
    return 0


class _Progress:
    """A bar for each stage: steps, rate, time left and the running losses."""

    def __init__(self):
        self._bar = None
        self._stage = None

    def __enter__(self) -> "_Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def tell(self, stage, step: int, losses: dict[str, float]) -> None:
        """Show that `step` batches of a stage are done."""
        from tqdm import tqdm

        if stage is not self._stage:
            self.__exit__()
            self._stage = stage
            self._bar = tqdm(
                desc=stage.name,
                total=stage.steps,
                initial=step,
                unit="step",
                dynamic_ncols=True,
                file=sys.stderr,
            )
        self._bar.update(step - self._bar.n)
        terms = {name: f"{value:.3g}" for name, value in losses.items() if name != "loss"}
        self._bar.set_postfix(terms, refresh=False)
