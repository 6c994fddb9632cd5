"""The record of a run in its folder: config, data, software versions and git commit."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import keras

from lime_keras.data.corpus import Split
from lime_keras.io import atomic, untrusted
from lime_keras.networks import Architecture
from lime_keras.version import __version__, installed

from .provenance import commit, differences
from .stages import Schedule

_PACKAGES = ("tensorflow", "jax", "keras", "numpy")


@dataclasses.dataclass(frozen=True)
class Config:
    """The settings and data that a run's weights depend on, apart from the software.

    Attributes:
        preset: name of the preset from which sizes and schedule were taken.
        steps_scale: factor by which the preset's numbers of batches were multiplied.
        architecture: architecture of the subnetworks.
        schedule: schedule of the stages.
        seed: seed of the initial weights, of the order of examples and of the photos; 0 is a seed.
        corpus_sha256: hash of the train splits (function `corpus_sha256`).
        photos: largest number of photos that a stage learns from (`train.photos`).
        compositing: whether the loss of the albedos contains Eq. 5.
        precision: precision in which the subnetworks compute, a key of `precision.POLICIES`.
        begun_from: digest of the trained model whose weights the run begins with
            (`model.folder.digest`); None for fresh weights.
        materials: laws of the materials (`optics.material_law`), any of which each scene's follows;
            None for those that a corpus was rendered by, and `uniform` wherever they are drawn.
        fresh: subnetworks that begin with fresh weights all the same; None for no such.
        frozen: subnetworks that keep the weights that the run begins with; None if all are trained.
        rate_scale: factor by which the preset's learning rates were multiplied.
        lobe: lobe of S in the data, one of `corpus.LOBES`, which decides the unit of m_s.
        plain_scenes: whether all corpora are drawn as test splits are (`Split.is_plain`).
        cutouts: hash of the photographs that a part of SegmentationNet's batches is composed of
            (`train.photos.cutouts.sha256`); None for none.
    """

    preset: str
    steps_scale: float
    architecture: Architecture
    schedule: Schedule
    seed: int
    corpus_sha256: str
    photos: int = 100_000
    compositing: bool = True
    precision: str = "float32"
    begun_from: str | None = None
    materials: tuple[str, ...] | None = None
    fresh: tuple[str, ...] | None = None
    frozen: tuple[str, ...] | None = None
    rate_scale: float = 1.0
    lobe: str = "furnace"
    plain_scenes: bool = True
    cutouts: str | None = None

    @classmethod
    def read(cls, run: Path) -> "Config":
        """Read the config that `claim` recorded in the folder of a run.

        Raises:
            FileNotFoundError: if the folder holds no run.
            ValueError: if another version of this package began the run.
        """
        path = config_path(run)
        if not path.is_file():
            raise FileNotFoundError(
                f"{path} is missing, so {run} holds no run to go on with: leave out --resume to "
                "begin one"
            )
        with untrusted.naming(path, "a run of this version", "pass another --out"):
            recorded = untrusted.read_json(path)["config"]
            architecture = Architecture(**recorded.pop("architecture"))
            schedule = Schedule(**recorded.pop("schedule"))
            for name in ("materials", "fresh", "frozen"):
                if recorded.get(name) is not None:
                    recorded[name] = tuple(recorded[name])
            return cls(architecture=architecture, schedule=schedule, **recorded)


def config_path(run: Path) -> Path:
    """Return the path of a run's record."""
    return run / "config.json"


def corpus_sha256(paths: Sequence[Path]) -> str:
    """Return a hash that identifies the data of a run.

    It is made of the checksums of the train shards, in order.

    Raises:
        FileNotFoundError: if a split is incomplete.
        ValueError: if a manifest is broken.
    """
    digests = [digest for path in paths for digest in Split(path, "train").sha256]
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def lobe_of(paths: Sequence[Path]) -> str:
    """Return the lobe of S in the data of a run, one of `corpus.LOBES`.

    Raises:
        ValueError: if corpora have different lobes.
    """
    lobes = [Split(path, "train").lobe for path in paths]
    for path, lobe in zip(paths, lobes, strict=True):
        if lobe != lobes[0]:
            raise ValueError(
                f"{paths[0]} has --lobe {lobes[0]} and {path} --lobe {lobe}: their m_s have "
                "different units; train on one of them, or render the other again"
            )
    return lobes[0]


def claim(run: Path, paths: Sequence[Path], config: Config, *, leads: bool = True) -> None:
    """Record a run in `RUN/config.json`, or check that the run recorded there has this config.

    Of several processes with the same config one leads, and records; the others check alone.

    Raises:
        ValueError: if the folder holds a run of another config; the message names the differences.
    """
    if (run / "recipe.json").is_file():
        raise ValueError(f"{run} holds a run of a recipe: pass another --out")
    path, plain = config_path(run), json.loads(json.dumps(dataclasses.asdict(config)))
    if path.is_file():
        with untrusted.naming(path, "the record of a run", f"pass another --out, or remove {run}"):
            recorded = {**untrusted.read_json(path)["config"]}
        differing = [
            f"{name} {there} there, {asked} asked"
            for name, there, asked in differences(recorded, plain)
        ]
        if differing:
            raise ValueError(
                f"{run} holds another run: {'; '.join(differing)}. Pass another --out, the same "
                "options and corpus, or remove it"
            )
    elif leads:
        record = {
            "config": plain,
            "corpora": [
                {"path": str(path), "description": Split(path, "train").manifest.get("description")}
                for path in paths
            ],
            "version": __version__,
            "backend": keras.backend.backend(),
            "packages": installed(_PACKAGES),
            "commit": commit(),
        }
        atomic.write(path, json.dumps(record, indent=1) + "\n")
