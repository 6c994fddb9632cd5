"""What a run is, recorded beside it: config, versions, commit."""

import dataclasses
import hashlib
import importlib.metadata
import json
import os
import subprocess
from pathlib import Path

import keras

from lime_keras import corpus as corpus_files
from lime_keras.networks import Architecture
from lime_keras.version import __version__

from .stages import Schedule

_PACKAGES = ("tensorflow", "keras", "numpy")


@dataclasses.dataclass(frozen=True)
class Config:
    """Everything that a run's weights depend on, apart from the software.

    Attributes:
        preset: name of the architecture and schedule.
        architecture: of the subnetworks.
        schedule: of the stages.
        seed: of initialisation and order; 0 is a seed.
        corpus_sha256: of the train split's manifest.
        camera: whether the networks see the scenes photographed (`lime_keras.camera`).
    """

    preset: str
    architecture: Architecture
    schedule: Schedule
    seed: int
    corpus_sha256: str
    camera: bool


def corpus_sha256(corpus: Path) -> str:
    """What identifies the train split of a corpus: its shards' checksums, hashed."""
    digests = corpus_files.read_manifest(corpus, "train")["sha256"]
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def claim(run: Path, config: Config) -> None:
    """Record in `RUN/config.json` what the run is.

    Raises:
        ValueError: if the folder holds a run of another config, with the differences.
    """
    path = run / "config.json"
    wanted = json.loads(json.dumps(dataclasses.asdict(config)))
    if path.is_file():
        held = json.loads(path.read_text(encoding="utf-8"))["config"]
        differing = [
            f"{key} {held.get(key)} there, {wanted.get(key)} asked"
            for key in sorted(wanted | held)
            if wanted.get(key) != held.get(key)
        ]
        if differing:
            raise ValueError(
                f"{run} holds another run: {'; '.join(differing)}. Pass another --out, the same "
                "options and corpus, or remove it"
            )
        return
    record = {
        "config": wanted,
        "version": __version__,
        "backend": keras.backend.backend(),
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "commit": _commit(),
    }
    run.mkdir(parents=True, exist_ok=True)
    partial = run / "partial-config.json"
    partial.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)


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
