"""The two graphs that the page runs without Python: `mask` and `material`.

They are made of the graphs of a model (`lime_keras.io.graph_folder`). `mask` is
SegmentationNet, from `image`. `material` is all other subnetworks, from `image` and `mask`, and
gives exactly their numbers. Both take one image at a time.
"""

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import onnx
from onnxruntime import quantization

from lime_keras.io import graph_folder
from lime_keras.io.graph_folder import Description
from lime_keras.live import calibration
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import OnnxEngine

NAMES = ("mask", "material")
PRECISIONS = ("float32", "int8")
_WEIGHTED = ("Conv", "MatMul", "Gemm")
_INTEGER = (*_WEIGHTED, "Relu", "MaxPool", "Concat", "Unsqueeze", "Tile", "Transpose", "Reshape")
"""Operators that compute in eight bits, as in `lime_keras.export.quantisation`."""


def write(folder: Path, graphs: Path, precision: str) -> None:
    """Write `mask-PRECISION.onnx` and `material-PRECISION.onnx`.

    Args:
        folder: existing folder to write to.
        graphs: folder of a model's graphs.
        precision: one of `PRECISIONS`. `int8` is calibrated on `calibration.pictures`; the last
            layers of the subnetworks stay float32.

    Raises:
        ValueError: if the folder holds no graphs, or a graph is damaged.
    """
    description = graph_folder.read(graphs)
    if description is None:
        raise ValueError(f"{graphs} holds no graphs: run lime-estimate with this model once")
    narrow = _narrow(graphs, description) if precision == "int8" else _single
    for name in NAMES:
        parts = [
            part
            for part, graph in description.graphs.items()
            if ("mask" in graph.outputs) == (name == "mask")
        ]
        models = {part: narrow(part, _opened(graphs, description, part)) for part in parts}
        answered = {output for part in parts for output in description.graphs[part].outputs}
        joined = _joined(name, models, filter(answered.__contains__, OUTPUTS))
        onnx.checker.check_model(joined)
        onnx.save(joined, folder / f"{name}-{precision}.onnx")


def _opened(graphs: Path, description: Description, part: str) -> onnx.ModelProto:
    """Return a subnetwork's graph, for one image at a time."""
    content = graph_folder.checked(graphs, part, description.graphs[part])
    model = onnx.load_from_string(content)
    for tensor in (*model.graph.input, *model.graph.output):
        tensor.type.tensor_type.shape.dim[0].dim_value = 1
    return model


def _single(_part: str, model: onnx.ModelProto) -> onnx.ModelProto:
    return model


def _narrow(
    graphs: Path, description: Description
) -> Callable[[str, onnx.ModelProto], onnx.ModelProto]:
    """Return the function that makes a subnetwork's graph compute in eight bits."""
    read = {name for graph in description.graphs.values() for name in graph.inputs} - {"image"}
    images = calibration.pictures(description.size)
    engine = OnnxEngine(graphs, description)
    fed = [
        {"image": image[None], **engine.run(sorted(read), {"image": image[None]})}
        for image in images
    ]

    def narrow(part: str, model: onnx.ModelProto) -> onnx.ModelProto:
        names = description.graphs[part].inputs
        with tempfile.TemporaryDirectory() as scratch:
            source, prepared, target = (Path(scratch) / f"{at}.onnx" for at in range(3))
            onnx.save(model, source)
            quantization.quant_pre_process(str(source), str(prepared), skip_symbolic_shape=True)
            quantization.quantize_static(
                str(prepared),
                str(target),
                _Reader({name: row[name] for name in names} for row in fed),
                quant_format=quantization.QuantFormat.QDQ,
                op_types_to_quantize=list(_INTEGER),
                nodes_to_exclude=_exact(onnx.load(prepared)),
                per_channel=True,
                activation_type=quantization.QuantType.QUInt8,
                weight_type=quantization.QuantType.QInt8,
                calibrate_method=quantization.CalibrationMethod.MinMax,
            )
            return onnx.load(target)

    return narrow


class _Reader(quantization.CalibrationDataReader):
    """A reader of what a graph is fed, one image at a time."""

    def __init__(self, fed: Iterable[Mapping[str, np.ndarray]]):
        self._fed: Iterator[Mapping[str, np.ndarray]] = iter(fed)

    def get_next(self) -> Mapping[str, np.ndarray] | None:
        """Return the next inputs of the graph by name, or None at the end."""
        return next(self._fed, None)


def _exact(model: onnx.ModelProto) -> list[str]:
    """Return the names of the nodes that stay float32: the last ones with weights, and all after.

    Between the last nodes with weights and the outputs, images are masked and expanded, and numbers
    clipped.
    """
    maker = {output: node for node in model.graph.node for output in node.output}
    waiting, met = [output.name for output in model.graph.output], set()
    while waiting:
        node = maker.get(waiting.pop())
        if node is None or node.name in met:
            continue
        met.add(node.name)
        if node.op_type not in _WEIGHTED:
            waiting.extend(node.input)
    return sorted(met)


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
