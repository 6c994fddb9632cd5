"""A trained model's files: `MODEL/architecture.json` and `MODEL/{subnetwork}.weights.h5`."""

import dataclasses
import json
import os
from pathlib import Path

import keras

from lime_keras.networks import Architecture, build


def save(model: Path, architecture: Architecture, subnetworks: dict[str, keras.Model]) -> None:
    """Write the architecture and each subnetwork's weights, each file atomically."""
    model.mkdir(parents=True, exist_ok=True)
    for name, subnetwork in subnetworks.items():
        path = _weights_path(model, name)
        partial = path.with_name(f"partial-{path.name}")
        subnetwork.save_weights(partial)
        os.replace(partial, path)
    text = json.dumps(dataclasses.asdict(architecture), indent=2)
    partial = model / "partial-architecture.json"
    partial.write_text(text + "\n", encoding="utf-8")
    os.replace(partial, model / "architecture.json")


def load(model: Path) -> tuple[Architecture, dict[str, keras.Model]]:
    """Build the subnetworks and load what `save` wrote, or what a training run holds.

    Args:
        model: folder written by `save`, or a run of `lime-train`, whose `model/` is taken.

    Raises:
        FileNotFoundError: if the folder holds no complete model.
        ValueError: if a file is broken, or not of this version.
    """
    model = folder(model)
    description = model / "architecture.json"
    _check_present(model, description)
    try:
        architecture = Architecture(**json.loads(description.read_text(encoding="utf-8")))
        subnetworks = build(architecture)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{description} is not of this version: {error}; train again") from error
    _check_present(model, *(_weights_path(model, name) for name in subnetworks))
    for name, subnetwork in subnetworks.items():
        path = _weights_path(model, name)
        try:
            subnetwork.load_weights(path)
        except (OSError, ValueError) as error:
            reason = str(error).partition("\n")[0]
            raise ValueError(f"{path} cannot be read: {reason}; train again") from error
    return architecture, subnetworks


def folder(model: Path) -> Path:
    """The folder that `save` wrote: the given one, or the `model/` of a run of `lime-train`."""
    model = Path(model)
    return model / "model" if (model / "model").is_dir() else model


def _weights_path(model: Path, name: str) -> Path:
    return model / f"{name}.weights.h5"


def _check_present(model: Path, *paths: Path) -> None:
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(
            f"{missing[0]} is missing, so {model} holds no trained model: pass a folder that "
            "`lime-train` wrote to the end"
        )
