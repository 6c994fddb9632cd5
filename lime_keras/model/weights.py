"""The files of a trained model: `MODEL/architecture.json` and `MODEL/{subnetwork}.weights.h5`.

If the exported graphs lie beside them (`lime_keras.export`), the latter may be left out: the
weights are then read from the graphs.
"""

import dataclasses
import json
from pathlib import Path

import h5py
import keras
import numpy as np

from lime_keras import console
from lime_keras.io import atomic, untrusted
from lime_keras.model import folder as model_folder
from lime_keras.networks import Architecture, build, subnetwork_names
from lime_keras.networks.wiring import Networks

_LEAST_COMPRESSED = 256  # number of values from which on it is worth to compress an array
_OVERHEAD = 8192  # largest number of bytes for each array of a weights file beside its values


def save(
    model: Path, architecture: Architecture, subnetworks: Networks, *, half: bool = False
) -> None:
    """Write the architecture and each subnetwork's weights, each file atomically.

    Args:
        model: folder to write to; the files of an earlier model in it are replaced.
        architecture: architecture of the subnetworks.
        subnetworks: trained subnetworks by name. They may be only some of the architecture's;
            another run can start from such a model.
        half: whether to write float16 weights, in half the space; `load` reads them like others.
    """
    # The architecture comes last: only a folder that has one holds a model.
    for name, network in subnetworks.items():
        _write(model, name, network, half)
    text = json.dumps(dataclasses.asdict(architecture), indent=2)
    atomic.write(model / model_folder.ARCHITECTURE, text + "\n")


def load(model: Path, *, whole: bool = True) -> tuple[Architecture, dict[str, keras.Model]]:
    """Build a trained model's subnetworks and load their weights.

    Args:
        model: folder written by `save`, or folder of a run of `lime-train`, whose `model/` is read.
        whole: whether to raise an error if a subnetwork's weights are missing. If False, only the
            subnetworks that have weights are returned.

    Returns:
        The architecture, and the subnetworks by name.

    Raises:
        FileNotFoundError: if the folder holds no model, or no complete one.
        ValueError: if a file is broken, holds NaN or infinity, or belongs to another version of
            this package.
    """
    model = model_folder.folder(model)
    architecture = read_architecture(model)
    exported = model_folder.has_weights_in_graphs(model)
    graphs, read = model_folder.graphs(model), _read_graph if exported else _read
    paths = {
        name: graphs / f"{name}.onnx" if exported else model / f"{name}{model_folder.WEIGHTS}"
        for name in subnetwork_names(architecture)
    }
    if not whole:
        paths = {name: path for name, path in paths.items() if path.is_file()}
    model_folder.check_present(model, *paths.values())
    built = build(architecture)
    subnetworks = {name: built[name] for name in paths}
    for name, path in paths.items():
        read(path, subnetworks[name])
        _check_finite(path, subnetworks[name])
    return architecture, subnetworks


def read_architecture(model: Path) -> Architecture:
    """Return the architecture of a trained model.

    Args:
        model: folder that `save` wrote, or run of `lime-train`.

    Raises:
        FileNotFoundError: if the folder holds no model.
        ValueError: if its file cannot be read.
    """
    model = model_folder.folder(model)
    description = model / model_folder.ARCHITECTURE
    model_folder.check_present(model, description)
    with untrusted.naming(description, "an architecture of this version", "train again"):
        return Architecture(**untrusted.read_json(description))


def _write(target: Path, name: str, network: keras.Model, half: bool) -> None:
    path = target / f"{name}{model_folder.WEIGHTS}"
    with atomic.replacing(path) as partial:
        _reserve(partial, network, half)
        network.save_weights(partial)
        if half:
            whole = partial.rename(path.with_name(f"partial-whole-{path.name}"))
            try:
                with h5py.File(whole) as source, h5py.File(partial, "w") as narrow:
                    _copy_half(source, narrow)
            finally:
                whole.unlink()


def _reserve(path: Path, network: keras.Model, half: bool) -> None:
    """Raise OSError if a network's weights find no room at `path`: HDF5 would crash the process."""
    count = 4 * network.count_params() + _OVERHEAD * len(network.weights)
    with path.open("wb") as file:
        file.write(bytes(count * 3 // 2 if half else count))
    path.unlink()


def _copy_half(source: h5py.Group, target: h5py.Group) -> None:
    """Copy the tree of a weights file with compressed float16 arrays, which Keras reads as well."""
    target.attrs.update(source.attrs)
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            _copy_half(item, target.create_group(name))
        else:
            values = item[...].astype(np.float16)
            large = values.size >= _LEAST_COMPRESSED
            packing = {"compression": "gzip", "shuffle": True} if large else {}
            narrow = target.create_dataset(name, data=values, **packing)
            narrow.attrs.update(item.attrs)


def _read(path: Path, network: keras.Model) -> None:
    try:
        _check_self_contained(path)
        network.load_weights(path)
    except MemoryError:
        raise  # this machine's fault, not the file's
    except Exception as error:  # Keras and HDF5 raise whatever a damaged byte leads them to
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise ValueError(f"{path} cannot be read: {reason}; train again") from error


def _check_self_contained(path: Path) -> None:
    """Raise ValueError if a weights file leads to arrays in other files, which nobody has named."""

    # HDF5 ends a visit at the first answer that is not None; an error would be lost inside it.
    def of_link(name: str, link: object) -> str | None:
        is_elsewhere = isinstance(link, h5py.ExternalLink)
        return f"{name} is a link to another file" if is_elsewhere else None

    def of_item(name: str, item: h5py.Group | h5py.Dataset) -> str | None:
        is_elsewhere = isinstance(item, h5py.Dataset) and (item.external or item.is_virtual)
        return f"the values of {name} lie in another file" if is_elsewhere else None

    with h5py.File(path) as file:
        fault = file.visititems_links(of_link) or file.visititems(of_item)
    if fault:
        raise ValueError(fault)


def _check_finite(path: Path, network: keras.Model) -> None:
    """Raise ValueError if a network has weights that are not finite."""
    for weight in network.weights:
        if not np.isfinite(keras.ops.convert_to_numpy(weight)).all():
            raise ValueError(
                f"{path} cannot be read: {weight.path} holds NaN or infinity; train again"
            )


def _read_graph(path: Path, network: keras.Model) -> None:
    console.require("a model whose weights lie in graphs", "onnx")
    from lime_keras.model import weights_in_graphs

    folder, name = path.parent, path.stem
    description = model_folder.read_description(folder)
    if description is None or name not in description.graphs:
        raise ValueError(
            f"{folder / model_folder.DESCRIPTION} does not describe {path.name}: "
            f"{model_folder.repair_hint(folder)}"
        )
    stored = weights_in_graphs.read(
        model_folder.read_verified(folder, name, description.graphs[name]), path
    )
    try:
        network.set_weights([stored[weight.path] for weight in network.weights])
    except (LookupError, ValueError) as error:
        raise ValueError(
            f"{path} has other layers than {network.name}: {error}; train again"
        ) from error
