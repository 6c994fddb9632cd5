"""The record of a run in its folder: config, corpora, software versions and git commit."""

import dataclasses
import hashlib
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import keras

from lime_keras.data.corpus import Split
from lime_keras.io import atomic
from lime_keras.networks import Architecture
from lime_keras.version import __version__, installed

from .stages import Schedule

_PACKAGES = ("tensorflow", "keras", "numpy")


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
        camera: whether the camera model photographs the scenes (`lime_keras.data.camera`).
        compositing: whether AlbedoNet's loss contains Eq. 5.
        precision: precision in which the subnetworks compute, a key of `precision.POLICIES`.
        begun_from: hash of the trained model whose weights the run begins with
            (`initial_weights.sha256`); None for fresh weights.
    """

    preset: str
    steps_scale: float
    architecture: Architecture
    schedule: Schedule
    seed: int
    corpus_sha256: str
    camera: bool
    compositing: bool = True
    precision: str = "float32"
    begun_from: str | None = None

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
        try:
            held = json.loads(path.read_text(encoding="utf-8"))["config"]
            architecture = Architecture(**held.pop("architecture"))
            schedule = Schedule(**held.pop("schedule"))
            return cls(architecture=architecture, schedule=schedule, **held)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(
                f"{path} is not of this version ({error}): pass another --out"
            ) from error


def config_path(run: Path) -> Path:
    """Return the path of a run's record."""
    return run / "config.json"


def corpus_sha256(corpora: Sequence[Path]) -> str:
    """Return a hash that identifies the train splits: of their shards' checksums, in order."""
    digests = [digest for corpus in corpora for digest in Split(corpus, "train").sha256]
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def claim(run: Path, corpora: Sequence[Path], config: Config) -> None:
    """Record a run in `RUN/config.json`, unless the same config is recorded there already.

    Raises:
        ValueError: if the folder holds a run of another config; the message names the differences.
    """
    path = config_path(run)
    wanted = json.loads(json.dumps(dataclasses.asdict(config)))
    if path.is_file():
        held = json.loads(path.read_text(encoding="utf-8"))["config"]
        differing = [
            f"{name} {there} there, {asked} asked"
            for name, there, asked in _differences(held, wanted)
        ]
        if differing:
            raise ValueError(
                f"{run} holds another run: {'; '.join(differing)}. Pass another --out, the same "
                "options and corpus, or remove it"
            )
        return
    record = {
        "config": wanted,
        "corpora": [
            {
                "path": str(corpus),
                "description": Split(corpus, "train").manifest.get("description"),
            }
            for corpus in corpora
        ],
        "version": __version__,
        "backend": keras.backend.backend(),
        "packages": installed(_PACKAGES),
        "commit": _commit(),
    }
    atomic.write(path, json.dumps(record, indent=1) + "\n")


def _differences(
    held: Mapping[str, Any], wanted: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Yield (name, value held, value wanted) of each difference; dots join nested names."""
    for key in sorted(wanted.keys() | held.keys()):
        there, asked = held.get(key), wanted.get(key)
        if isinstance(there, dict) and isinstance(asked, dict):
            yield from _differences(there, asked, f"{prefix}{key}.")
        elif there != asked:
            yield f"{prefix}{key}", there, asked


def _commit() -> str | None:
    """Return the git commit of this code, with "-dirty" if changed; None outside a checkout."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        # An installed copy may lie inside somebody else's repository.
        git("ls-files", "--error-unmatch", Path(__file__).name)
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return None
