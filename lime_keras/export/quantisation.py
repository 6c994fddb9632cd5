"""An ONNX model in fewer bits: float16, and eight-bit integers calibrated on images.

Weights get a scale for each channel, activations one for each tensor, from the values that
calibration images give (static quantisation, QDQ format); masking, clipping and the expansion of S
and M, which reach 59,873, stay float32 there. Images and answers are float32 in any case.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnxruntime import quantization
from onnxruntime.transformers import float16

from lime_keras.networks import SUBNETWORKS

HEADS = {head for subnetwork in SUBNETWORKS.values() for head in subnetwork.heads}
"""Names of the subnetworks' last layers."""
RANGES = {"widest": False, "mean": True}
"""What a tensor's scale covers: its extremes over all calibration images, or the mean of each
image's, which one odd image moves little. As ONNX Runtime's option of a moving average has it."""

_INTEGER = (
    *("Conv", "MatMul", "Gemm", "Relu", "MaxPool", "Concat"),
    *("Unsqueeze", "Tile", "Transpose", "Reshape"),
)
"""What is computed on eight bits. The second line is how upsampling comes out of the converter:
left in floating point, it would part the convolutions."""


def prepare(source: Path, target: Path) -> None:
    """Write the model with its shapes inferred and its biases fused, as the functions below need.

    Args:
        source: of `lime_keras.export.formats.write_onnx`.
        target: written to.
    """
    quantization.quant_pre_process(str(source), str(target), skip_symbolic_shape=True)


def write_float16(prepared: Path, target: Path) -> None:
    """Write the model with float16 weights and activations.

    S and M pass through float16 on their way out, with its 11 bits: 59,873, the most that there
    is, is below its 65,504.
    """
    narrow = float16.convert_float_to_float16(onnx.load(prepared), keep_io_types=True)
    onnx.save(narrow, target)


def write_int8(
    prepared: Path, target: Path, images: np.ndarray, *, ranges: str, float_heads: bool
) -> None:
    """Write the model with eight-bit weights and activations.

    Args:
        prepared: of `prepare`.
        target: written to.
        images: `(N, S, S, 3)` sRGB in [0, 1] to calibrate with.
        ranges: a name of `RANGES`.
        float_heads: whether the subnetworks' last layers stay float32.
    """
    quantization.quantize_static(
        str(prepared),
        str(target),
        _Reader(images),
        quant_format=quantization.QuantFormat.QDQ,
        op_types_to_quantize=list(_INTEGER),
        nodes_to_exclude=heads(onnx.load(prepared)) if float_heads else [],
        per_channel=True,
        activation_type=quantization.QuantType.QUInt8,
        weight_type=quantization.QuantType.QInt8,
        calibrate_method=quantization.CalibrationMethod.MinMax,
        extra_options={"CalibMovingAverage": RANGES[ranges]},
    )


def heads(model: onnx.ModelProto) -> list[str]:
    """Names of the nodes that are the subnetworks' last layers, told by their kernels' names."""
    weighted = (node for node in model.graph.node if node.op_type in ("Conv", "MatMul", "Gemm"))
    return [
        node.name
        for node in weighted
        if any(part.rstrip("_0123456789") in HEADS for part in node.input[1].split("/"))
    ]


def harm(expected: Mapping[str, np.ndarray], answer: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Mean difference of each output over its mean magnitude: 0 none, 1 as good as an answer of 0.

    Args:
        expected: answers of the float32 model.
        answer: answers of the other one, to the same images.
    """
    return {
        name: float(np.mean(np.abs(answer[name] - value)) / max(np.mean(np.abs(value)), 1e-6))
        for name, value in expected.items()
    }


class _Reader(quantization.CalibrationDataReader):
    """The images as ONNX Runtime asks for them: one at a time, so that each has its own range."""

    def __init__(self, images: np.ndarray):
        self._images = iter(images)

    def get_next(self) -> dict[str, np.ndarray] | None:
        """The model's input, or None at the end."""
        image = next(self._images, None)
        return None if image is None else {"image": image[None]}
