"""The reference evaluator of onnx as an engine: a second opinion on the files that are written.

It is NumPy, node by node, in the types that a file names. So it finds what ONNX Runtime forgives:
nodes in a wrong order, and values that overflow float16, which ONNX Runtime widens.
"""

from collections.abc import Callable, Collection
from typing import Any

import numpy as np
import onnx
from onnx.reference import ReferenceEvaluator
from onnx.reference.ops.op_dequantize_linear import DequantizeLinear_19
from onnx.reference.ops.op_quantize_linear import QuantizeLinear_19

from lime_keras.runtime.engine import Arrays
from lime_keras.runtime.onnx_graphs import OnnxGraphs


class DequantizeLinear(DequantizeLinear_19):
    """The operator in the files' older set, where it is the same; onnx has it from 19 on."""

    op_domain = ""

    def _run(self, *operands: Any, axis: int = 1, **_: Any) -> Any:
        return super()._run(*operands, axis=axis)  # type: ignore[misc]


class QuantizeLinear(QuantizeLinear_19):
    """The inverse operator, likewise."""

    op_domain = ""

    def _run(self, *operands: Any, axis: int = 1, **_: Any) -> Any:
        return super()._run(*operands, axis=axis)  # type: ignore[misc]


class ReferenceGraphs(OnnxGraphs):
    """The graphs of another engine."""

    def __init__(self, engine: OnnxGraphs):
        super().__init__(engine.folder, engine.description)

    def run(self, outputs: Collection[str], inputs: Arrays) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Answering`)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return super().run(outputs, inputs)

    def _open(self, content: Callable[[], bytes]) -> Any:
        model = onnx.load_from_string(content())
        return ReferenceEvaluator(model, new_ops=[DequantizeLinear, QuantizeLinear])
