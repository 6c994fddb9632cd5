"""The graphs that the estimator runs: an ONNX file for each subnetwork (`lime_keras.runtime`)."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import keras
import numpy as np
import onnx
from onnx import numpy_helper

from lime_keras.export import formats
from lime_keras.networks.architecture import Architecture
from lime_keras.networks.parts import part
from lime_keras.runtime import graph_folder
from lime_keras.runtime.graph_folder import Description, Graph

_LEAST_NARROWED = 256
"""Number of values from which on it is worth to store a constant in half the space."""


def write(
    folder: Path, architecture: Architecture, subnetworks: Mapping[str, keras.Model], digest: str
) -> None:
    """Write a graph for each subnetwork, and their description, into a new folder.

    Weights that float16 holds exactly, such as those that were stored in float16, are stored in
    float16 and computed with in float32.

    Args:
        folder: path of the folder.
        architecture: architecture of the subnetworks.
        subnetworks: subnetworks by name.
        digest: digest of their weights (`io.model_folder.digest`).
    """
    folder.mkdir(parents=True)
    graphs = {}
    for name, network in subnetworks.items():
        alone, path = part(name, network), graph_folder.path(folder, name)
        formats.write_onnx(alone, path)
        _narrow(path)
        graphs[name] = Graph(
            inputs=tuple(tensor.name for tensor in alone.inputs),
            outputs=tuple(alone.output),
            sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        )
    graph_folder.write(
        folder, Description(digest, architecture.size, architecture.description, graphs)
    )


def _narrow(path: Path) -> None:
    """Store those constants of an ONNX file in float16 that lose nothing by it."""
    model = onnx.load(path)
    casts = []
    for constant in model.graph.initializer:
        values = numpy_helper.to_array(constant)
        if constant.data_type != onnx.TensorProto.FLOAT or values.size < _LEAST_NARROWED:
            continue
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        if np.array_equal(half.astype(np.float32), values):
            name = constant.name
            constant.CopyFrom(numpy_helper.from_array(half, f"{name}_half"))
            cast = onnx.helper.make_node("Cast", [constant.name], [name], to=onnx.TensorProto.FLOAT)
            casts.append(cast)
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    onnx.save(model, path)
