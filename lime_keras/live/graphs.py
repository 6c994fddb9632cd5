"""The two graphs that the page runs without Python: `mask` and `material`.

They are made of the graphs of a model (`lime_keras.model.graphs`). `mask` is
SegmentationNet, from `image`. `material` is all other subnetworks, from `image` and `mask`, and
gives exactly their numbers. Both take one image at a time.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

import onnx

from lime_keras.model import graphs as graph_folder
from lime_keras.model.graphs import Description
from lime_keras.outputs import OUTPUTS

NAMES = ("mask", "material")


def write(folder: Path, graphs: Path) -> None:
    """Write `mask.onnx` and `material.onnx`.

    Args:
        folder: existing folder to write to.
        graphs: folder of a model's graphs.

    Raises:
        ValueError: if the folder holds no graphs, or a graph is damaged.
    """
    description = graph_folder.read(graphs)
    if description is None:
        raise ValueError(f"{graphs} holds no graphs: run lime-estimate with this model once")
    for name in NAMES:
        parts = [
            part
            for part, graph in description.graphs.items()
            if ("mask" in graph.outputs) == (name == "mask")
        ]
        models = {part: _opened(graphs, description, part) for part in parts}
        answered = {output for part in parts for output in description.graphs[part].outputs}
        joined = _joined(name, models, filter(answered.__contains__, OUTPUTS))
        onnx.checker.check_model(joined)
        onnx.save(joined, folder / f"{name}.onnx")


def _opened(graphs: Path, description: Description, part: str) -> onnx.ModelProto:
    """Return a subnetwork's graph, for one image at a time."""
    content = graph_folder.read_verified(graphs, part, description.graphs[part])
    model = onnx.load_from_string(content)
    for tensor in (*model.graph.input, *model.graph.output):
        tensor.type.tensor_type.shape.dim[0].dim_value = 1
    return model


def _joined(
    name: str, models: Mapping[str, onnx.ModelProto], outputs: Iterable[str]
) -> onnx.ModelProto:
    """Return one graph of several that read one another's answers by name."""
    parts = [
        onnx.compose.add_prefix(model, f"{part}/", rename_inputs=False, rename_outputs=False)
        for part, model in models.items()
    ]
    answered = {tensor.name: tensor for part in parts for tensor in part.graph.output}
    read = {tensor.name: tensor for part in parts for tensor in part.graph.input}
    graph = onnx.helper.make_graph(
        [node for part in parts for node in part.graph.node],
        name,
        [tensor for tensor in read.values() if tensor.name not in answered],
        [answered[output] for output in outputs],
        [constant for part in parts for constant in part.graph.initializer],
    )
    return onnx.helper.make_model(
        graph,
        ir_version=max(part.ir_version for part in parts),
        opset_imports=list(
            {opset.domain: opset for part in parts for opset in part.opset_import}.values()
        ),
    )
