"""What a run is, recorded beside it: config, corpus, versions, commit."""

import dataclasses
import hashlib
import importlib.metadata
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import keras

from lime_keras.data.corpus import Split
from lime_keras.io import atomic
from lime_keras.networks import Architecture
from lime_keras.version import __version__

from .stages import Schedule

_PACKAGES = ("tensorflow", "keras", "numpy")


@dataclasses.dataclass(frozen=True)
class Config:
    """Everything that a run's weights depend on, apart from the software.

    Attributes:
        preset: name of the sizes and the schedule that it began from.
        steps_scale: what the preset's numbers of batches were multiplied with.
        architecture: of the subnetworks.
        schedule: of the stages.
        seed: of initialisation and order; 0 is a seed.
        corpus_sha256: of the train splits' manifests (`corpus_sha256`).
        camera: whether the networks see the scenes photographed (`lime_keras.data.camera`).
        compositing: whether AlbedoNet is also held to Eq. 5.
        precision: one of `precision.POLICIES`, that the subnetworks compute in.
        begun_from: what identifies the trained model whose weights it begins with
            (`beginning.sha256`); None with fresh ones.
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
        """What `claim` recorded.

        Raises:
            FileNotFoundError: if the folder holds no run.
            ValueError: if it is one of another version.
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
    """Where a run's record lies."""
    return run / "config.json"


def corpus_sha256(corpora: Sequence[Path]) -> str:
    """What identifies the train splits of corpora: their shards' checksums in order, hashed."""
    digests = [digest for corpus in corpora for digest in Split(corpus, "train").sha256]
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def claim(run: Path, corpora: Sequence[Path], config: Config) -> None:
    """Record in `RUN/config.json` what the run is.

    Raises:
        ValueError: if the folder holds a run of another config, with the differences.
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
        "packages": {name: _installed(name) for name in _PACKAGES},
        "commit": _commit(),
    }
    atomic.write(path, json.dumps(record, indent=1) + "\n")


def _differences(
    held: Mapping[str, Any], wanted: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """(name, value held, value wanted) of all that differs, `schedule.batch_size` and the like."""
    for key in sorted(wanted.keys() | held.keys()):
        there, asked = held.get(key), wanted.get(key)
        if isinstance(there, dict) and isinstance(asked, dict):
            yield from _differences(there, asked, f"{prefix}{key}.")
        elif there != asked:
            yield f"{prefix}{key}", there, asked


def _installed(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _commit() -> str | None:
    """Git commit of the code that trains, "-dirty" if it was changed; None outside a checkout."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        # An installed copy may lie inside somebody else's repository.
        git("ls-files", "--error-unmatch", Path(__file__).name)
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return None
