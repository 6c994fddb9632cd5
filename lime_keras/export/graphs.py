"""The graphs that the estimator runs, ONNX files of `standalone.parts` (`lime_keras.runtime`).

The same weights always give the same bytes. The converter, left alone, numbers its names through
the process and walks through sets, so that each file would be another.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

import keras
import numpy as np
import onnx
from onnx import numpy_helper

from lime_keras.export import formats, quantisation
from lime_keras.export.standalone import parts
from lime_keras.io import untrusted
from lime_keras.model import folder as model_folder
from lime_keras.model import weights_in_graphs
from lime_keras.model.folder import SPLIT, Description, Graph
from lime_keras.networks.architecture import Architecture
from lime_keras.runtime.onnx_graphs import OnnxGraphs

_LEAST_NARROWED = 256  # number of values from which a constant is stored in half the space


def write(
    folder: Path,
    architecture: Architecture,
    subnetworks: Mapping[str, keras.Model],
    digest: str,
    precision: str = "float32",
    plain: OnnxGraphs | None = None,
    pictures: Iterable[np.ndarray] = (),
) -> None:
    """Write a graph for each part of a model, and their description, into a new folder.

    In float32, weights that float16 holds exactly, such as those that were stored in float16, are
    stored in float16 and computed with in float32. `model.weights_in_graphs` reads them back for
    Keras. In fewer bits, the split of colours, which takes small differences and has no weights,
    stays float32.

    Args:
        folder: path of the folder.
        architecture: architecture of the subnetworks.
        subnetworks: subnetworks by name.
        digest: digest of their weights (`model.folder.digest`).
        precision: `float32`, `float16` or `int8`.
        plain: in fewer bits, the engine of the graphs in float32, which answers what others read.
        pictures: for int8, calibration images `(S, S, 3)`, sRGB in [0, 1]; else none.
    """
    folder.mkdir(parents=True)
    graphs = {}
    for name, alone in parts(subnetworks).items():
        path, inputs = folder / f"{name}.onnx", tuple(tensor.name for tensor in alone.inputs)
        formats.write_onnx(alone, path)
        if plain is not None:
            fed = (plain.run(inputs, {"image": one[None]}) for one in pictures)
            quantisation.narrow(path, "float32" if name == SPLIT else precision, fed)
        graph = onnx.load(path)
        if plain is None:
            _narrow(graph)
        formats.settle(graph)
        for tensor in graph.graph.output:  # of which the converter forgets some channels
            sizes = alone.output[tensor.name].shape[1:]
            for dimension, size in zip(tensor.type.tensor_type.shape.dim[1:], sizes, strict=True):
                dimension.dim_value = size
        if plain is None:
            stored = subnetworks[name].weights if name in subnetworks else []
            values = {weight.path: keras.ops.convert_to_numpy(weight) for weight in stored}
            weights_in_graphs.describe(graph, values)
        formats.write_checked(graph, path)
        graphs[name] = Graph(inputs, tuple(alone.output), untrusted.sha256(path))
    model_folder.write_description(
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
