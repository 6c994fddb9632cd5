"""The quantisation of an ONNX model: float16, or eight-bit integers calibrated on images.

In eight bits, weights have a scale for each channel. Activations have a scale for each tensor, from
the values for calibration images (static quantisation, QDQ format). The last layers, SpecularNet's
decoder, the guided filter, masking, clipping and the expansion of S and M, which reach 59,873, stay
float32. Input images and outputs are always float32.
"""

import functools
import re
import types
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import onnx
from onnxruntime import quantization
from onnxruntime.transformers import float16

from lime_keras.export.formats import REPEATED
from lime_keras.networks import SUBNETWORKS
from lime_keras.runtime.engine import Arrays

HEADS = {head for subnetwork in SUBNETWORKS.values() for head in subnetwork.heads}
"""Names of the subnetworks' last layers."""

_INTEGER = (
    *("Conv", "MatMul", "Gemm", "Relu", "Clip", "MaxPool", "Concat", "Resize"),
    *("Transpose", "Reshape"),
)
"""Operators that compute in eight bits. `Clip` is the ReLU6 of a pretrained encoder: a convolution
before it has the scale of 0 to 6, not of all that is clipped. Those of the second line move values;
in floating point they would separate the eight-bit convolutions."""

_WAY_UP = re.compile(r"/specular_net\w*/(up|skip)\d")
"""Nodes of SpecularNet's decoder, by name. Its features have the range of radiance: those of `live`
reach 115 times their 99th percentile, too far for 256 equal steps."""
_GUIDED = re.compile(r"/segmentation_net\w*/guided")
"""Nodes of the guided filter, by name: its small differences of means vanish in few bits."""
_SUMS = ("ReduceSum", "ReduceMean")
"""Operators over all pixels, whose sums in float16 lose what they sum, or overflow."""
_REPEATED = re.compile(f"/{REPEATED}$")
"""Nodes that repeat a channel for arithmetic in float32, by name."""


def narrow(path: Path, precision: str, inputs: Iterable[Arrays]) -> None:
    """Let an ONNX file, which `formats.write_onnx` wrote, compute in fewer bits.

    In float16, weights and activations have 16 bits, but for the guided filter and sums. S and M
    have the 11 significant bits of float16, and their largest value, 59,873, is below its largest,
    65,504. In int8, they have eight bits, but for `in_float32`.

    Args:
        path: the file, which is replaced.
        precision: `float16` or `int8`; in `float32` shapes are inferred and biases fused alone.
        inputs: for int8, the model's inputs for each calibration image, by name.
    """
    quantization.quant_pre_process(str(path), str(path), skip_symbolic_shape=True)
    model = onnx.load(path)
    if precision == "float16":
        exact = [node.name for node in model.graph.node if _GUIDED.search(node.name)]
        # What reads a sum gets it in float32: of many pixels it may exceed 65,504.
        sums = {one for node in model.graph.node if node.op_type in _SUMS for one in node.output}
        exact += [node.name for node in model.graph.node if sums & set(node.input)]
        narrowed = float16.convert_float_to_float16(
            model,
            keep_io_types=True,
            op_block_list=[*float16.DEFAULT_OP_BLOCK_LIST, *_SUMS],
            node_block_list=exact,
        )
        _keep_between(narrowed)
        onnx.save(narrowed, path)
    elif precision == "int8":
        # Scales are from the extremes over all images; what else was tried:
        # docs/how-to/exporting.md.
        quantization.quantize_static(
            str(path),
            str(path),
            # One image at a time, so that ONNX Runtime sees a range for each.
            types.SimpleNamespace(get_next=functools.partial(next, iter(inputs), None)),
            quant_format=quantization.QuantFormat.QDQ,
            op_types_to_quantize=list(_INTEGER),
            nodes_to_exclude=in_float32(model),
            per_channel=True,
            activation_type=quantization.QuantType.QUInt8,
            # Not signed: without AVX-512 VNNI, sums of products of both signs would be cut off.
            weight_type=quantization.QuantType.QUInt8,
            calibrate_method=quantization.CalibrationMethod.MinMax,
        )


def _keep_between(model: onnx.ModelProto) -> None:
    """Let the nodes in float32 pass float32 on, where the converter narrows it and widens it again.

    Casts that nothing reads any more are taken out.
    """
    nodes = model.graph.node
    casts = {
        node.output[0]: (node.input[0], node.attribute[0].i)
        for node in nodes
        if node.op_type == "Cast"
    }
    for node in nodes:
        for index, name in enumerate(node.input):
            narrowed, kind = casts.get(name, ("", 0))
            exact, inner = casts.get(narrowed, ("", 0))
            if (kind, inner) == (onnx.TensorProto.FLOAT, onnx.TensorProto.FLOAT16):
                node.input[index] = exact
    read = {name for node in nodes for name in node.input} | {
        one.name for one in model.graph.output
    }
    for node in [one for one in nodes if one.op_type == "Cast" and one.output[0] not in read]:
        nodes.remove(node)


def in_float32(model: onnx.ModelProto) -> list[str]:
    """Return the names of the nodes that int8 leaves in float32.

    They are the last layers, SpecularNet's decoder, the guided filter, repeated channels, which no
    convolution reads, and `Clip` where it is not the ReLU6 of a convolution in eight bits. Other
    operators than `_INTEGER` need no name.
    """
    nodes = model.graph.node
    exact = (_WAY_UP, _GUIDED, _REPEATED)
    named = [node.name for node in nodes if any(words.search(node.name) for words in exact)]
    out = [*heads(model), *named]
    narrow = (node for node in nodes if node.op_type == "Conv" and node.name not in out)
    convolved = {output for node in narrow for output in node.output}
    clips = (node for node in nodes if node.op_type == "Clip")
    return [*out, *(node.name for node in clips if node.input[0] not in convolved)]


def heads(model: onnx.ModelProto) -> list[str]:
    """Return the names of the nodes that are last layers; their kernels' names identify them."""
    weighted = (node for node in model.graph.node if node.op_type in ("Conv", "MatMul", "Gemm"))
    return [
        node.name
        for node in weighted
        if any(part.rstrip("_0123456789") in HEADS for part in node.input[1].split("/"))
    ]


def relative_error(expected: Arrays, answer: Arrays) -> dict[str, float]:
    """Return each output's mean difference divided by its mean magnitude, by name.

    It is 0 without any difference, and 1 for an output of zeros.

    Args:
        expected: outputs of the float32 model.
        answer: outputs of the model in fewer bits for the same images.
    """
    return {
        name: float(np.mean(np.abs(answer[name] - value)) / max(np.mean(np.abs(value)), 1e-6))
        for name, value in expected.items()
    }
