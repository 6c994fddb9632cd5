"""The graphs that the estimator runs, ONNX files of `standalone.parts` (`lime_keras.runtime`).

The same weights always give the same bytes. The converter, left alone, numbers its names through
the process and walks through sets, so that each file would be another.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
import onnx
from onnx import numpy_helper

from lime_keras.export import formats
from lime_keras.export.standalone import parts
from lime_keras.io import untrusted
from lime_keras.model import graphs as graph_folder
from lime_keras.model import weights_in_graphs
from lime_keras.model.graphs import Description, Graph
from lime_keras.networks.architecture import Architecture

_LEAST_NARROWED = 256
"""Number of values from which on it is worth to store a constant in half the space."""


def write(
    folder: Path, architecture: Architecture, subnetworks: Mapping[str, keras.Model], digest: str
) -> None:
    """Write a graph for each part of a model, and their description, into a new folder.

    Weights that float16 holds exactly, such as those that were stored in float16, are stored in
    float16 and computed with in float32. `model.weights_in_graphs` reads them back for Keras.

    Args:
        folder: path of the folder.
        architecture: architecture of the subnetworks.
        subnetworks: subnetworks by name.
        digest: digest of their weights (`model.folder.digest`).
    """
    folder.mkdir(parents=True)
    graphs = {}
    for name, alone in parts(subnetworks).items():
        path = folder / f"{name}.onnx"
        formats.write_onnx(alone, path)
        graph = onnx.load(path)
        _narrow(graph)
        _settle(graph)
        for tensor in graph.graph.output:  # of which the converter forgets some channels
            sizes = alone.output[tensor.name].shape[1:]
            for dimension, size in zip(tensor.type.tensor_type.shape.dim[1:], sizes, strict=True):
                dimension.dim_value = size
        held = subnetworks[name].weights if name in subnetworks else []
        values = {weight.path: keras.ops.convert_to_numpy(weight) for weight in held}
        weights_in_graphs.describe(graph, values)
        path.write_bytes(graph.SerializeToString(deterministic=True))
        graphs[name] = Graph(
            inputs=tuple(tensor.name for tensor in alone.inputs),
            outputs=tuple(alone.output),
            sha256=untrusted.sha256(path),
        )
    graph_folder.write(
        folder, Description(digest, architecture.size, architecture.description, graphs)
    )


def _narrow(model: onnx.ModelProto) -> None:
    """Store those constants of a graph in float16 that lose nothing by it."""
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


def _settle(model: onnx.ModelProto) -> None:
    """Order and name the nodes and constants of a graph by their use alone.

    A node comes after those that it reads, in the order in which the outputs ask for them; names
    count in this order. Of equal constants one is kept, and of what nothing reads none.
    """
    # Visit: what the outputs ask for, in order.
    graph = model.graph
    made_by = {output: node for node in graph.node for output in node.output}
    constants = {constant.name: constant for constant in graph.initializer}
    names = {"": ""} | {tensor.name: tensor.name for tensor in (*graph.input, *graph.output)}
    nodes: dict[str, onnx.NodeProto] = {}
    kept: dict[tuple[Any, ...], onnx.TensorProto] = {}

    def visit(name: str) -> None:
        node, constant = made_by.get(name), constants.get(name)
        if node is not None and node.output[0] not in nodes:
            for read in node.input:
                visit(read)
            nodes[node.output[0]] = node
            for index, output in enumerate(node.output):
                names.setdefault(output, f"{node.op_type}{len(nodes)}.{index}")
        elif constant is not None and name not in names:
            values = numpy_helper.to_array(constant)
            first = kept.setdefault((values.dtype.str, values.shape, values.tobytes()), constant)
            names[name] = f"constant{len(kept)}" if first is constant else names[first.name]

    for output in sorted(tensor.name for tensor in graph.output):
        visit(output)
    # Rebuild: kept nodes and constants by their new names.
    settled = onnx.GraphProto(
        name=graph.name, node=nodes.values(), input=graph.input, output=graph.output
    )
    for constant in kept.values():
        settled.initializer.add().CopyFrom(constant)
        settled.initializer[-1].name = names[constant.name]
    for tensor in (*settled.input, *settled.output):
        tensor.type.tensor_type.shape.dim[0].dim_param = "batch"
    for node in settled.node:
        node.input[:] = [names[name] for name in node.input]
        node.output[:] = [names[name] for name in node.output]
        node.name = node.output[0]
        node.attribute.sort(key=lambda attribute: attribute.name)
    graph.CopyFrom(settled)
