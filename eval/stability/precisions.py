"""The precisions and formats in which a system is tried."""

from dataclasses import dataclass, field, replace

ROUNDINGS = 8
"""Units in the last place that a short formula may lose for each unit of its condition number: one
for each of four rounded operations, and two for each of two library functions."""


@dataclass(frozen=True)
class Precision:
    """A number format in which Keras computes.

    Attributes:
        name: name in the tables.
        dtype: name of the number format.
        epsilon: distance from 1 to the next larger number.
        compiled: whether XLA compiles the functions that Keras computes.
        format: format of the exported model that computes, as in `lime-export --format`; None for
            Keras.
    """

    name: str
    dtype: str
    epsilon: float
    compiled: bool = field(default=False, kw_only=True)
    format: str | None = field(default=None, kw_only=True)


SINGLE = Precision("float32", "float32", 2.0**-23)
HALF = Precision("float16", "float16", 2.0**-10)
BRAIN = Precision("bfloat16", "bfloat16", 2.0**-7)
XLA = replace(SINGLE, name="XLA float32", compiled=True)
TENSORS = (SINGLE, HALF, BRAIN, XLA)
EXPORTED = (
    replace(XLA, name="SavedModel", format="savedmodel"),
    replace(XLA, name="ONNX", format="onnx"),
)
