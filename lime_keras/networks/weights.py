"""A trained model's files: `MODEL/architecture.json` and `MODEL/{subnetwork}.weights.h5`.

Joined training teaches a subnetwork to read the others' estimates, and it then reads true layers
worse. As its own stage left it, it may lie beside the rest: `MODEL/alone/{subnetwork}.weights.h5`.
"""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

import h5py
import keras
import numpy as np

from lime_keras.io import atomic
from lime_keras.networks import Architecture, build

_ALONE = "alone"
SHIPPED = Path(__file__).parents[1] / "pretrained" / "live"
"""The model that comes with the package: what is used where no other is named."""


def save(
    model: Path,
    architecture: Architecture,
    subnetworks: Mapping[str, keras.Model],
    alone: Mapping[str, keras.Model] | None = None,
    *,
    half: bool = False,
) -> None:
    """Write the architecture and each subnetwork's weights, each file atomically.

    Args:
        model: folder; what it held is replaced.
        architecture: of the subnetworks.
        subnetworks: by name: all of them, or those that are trained yet, with which a further run
            can begin.
        alone: those of them that joined training changed, as they were before it.
        half: keep 16 bits of each weight, in half the space; they are loaded as any.
    """
    alone = {} if alone is None else alone
    for path in (model / _ALONE).glob("*.weights.h5"):
        if path.name.removesuffix(".weights.h5") not in alone:
            path.unlink()
    # The architecture comes last: only a folder that has one holds a model.
    for target, networks in ((model / _ALONE, alone), (model, subnetworks)):
        for name, network in networks.items():
            _write(target, name, network, half)
    text = json.dumps(dataclasses.asdict(architecture), indent=2)
    atomic.write(model / "architecture.json", text + "\n")


def load(model: Path, *, whole: bool = True) -> tuple[Architecture, dict[str, keras.Model]]:
    """Build the subnetworks and load what `save` wrote, or what a training run holds.

    Args:
        model: folder written by `save`, or a run of `lime-train`, whose `model/` is taken.
        whole: refuse a model of which not all subnetworks are there; else return those that are.

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
    if not whole:
        subnetworks = {n: s for n, s in subnetworks.items() if _weights_path(model, n).is_file()}
    _check_present(model, *(_weights_path(model, name) for name in subnetworks))
    for name, subnetwork in subnetworks.items():
        _read(_weights_path(model, name), subnetwork)
    return architecture, subnetworks


def load_alone(model: Path, subnetworks: Mapping[str, keras.Model]) -> dict[str, keras.Model]:
    """Load subnetworks as their own stages left them, before joined training changed them.

    Args:
        model: folder as of `load`.
        subnetworks: what `load` returned for it; they stay as they are.

    Returns:
        Those that the folder holds, by name. There are none if it was saved without any, or if no
        later stage changed them.

    Raises:
        ValueError: if a file is broken, or not of this model.
    """
    out = {}
    for name, subnetwork in subnetworks.items():
        path = _weights_path(folder(model) / _ALONE, name)
        if path.is_file():
            out[name] = keras.models.clone_model(subnetwork)
            _read(path, out[name])
    return out


def files(model: Path) -> list[Path]:
    """All files that `load` and `load_alone` would read, in a fixed order.

    Args:
        model: folder as of `load`.

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    model = folder(model)
    _check_present(model, model / "architecture.json")
    return [model / "architecture.json", *sorted(model.rglob("*.weights.h5"))]


def folder(model: Path) -> Path:
    """The folder itself, or, of a run of `lime-train`, its `model/`."""
    model = Path(model)
    return model / "model" if (model / "model").is_dir() else model


def _write(target: Path, name: str, network: keras.Model, half: bool) -> None:
    path = _weights_path(target, name)
    with atomic.replacing(path) as partial:
        network.save_weights(partial)
        if half:
            whole = partial.rename(path.with_name(f"partial-whole-{path.name}"))
            with h5py.File(whole) as source, h5py.File(partial, "w") as narrow:
                _copy_half(source, narrow)
            whole.unlink()


def _copy_half(source: h5py.Group, target: h5py.Group) -> None:
    """Copy a weights file's tree, its arrays as float16; Keras casts them back as it loads."""
    target.attrs.update(source.attrs)
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            _copy_half(item, target.create_group(name))
        else:
            copy = target.create_dataset(name, data=item[...].astype(np.float16))
            copy.attrs.update(item.attrs)


def _read(path: Path, network: keras.Model) -> None:
    try:
        network.load_weights(path)
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise ValueError(f"{path} cannot be read: {reason}; train again") from error


def _weights_path(model: Path, name: str) -> Path:
    return model / f"{name}.weights.h5"


def _check_present(model: Path, *paths: Path) -> None:
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(
            f"{missing[0]} is missing, so {model} holds no trained model: pass a folder that "
            "`lime-train` wrote to the end"
        )
