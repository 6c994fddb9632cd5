"""The numerical precision in which the networks compute."""

import contextlib
from collections.abc import Iterator

import keras

POLICIES = {"float32": "float32", "bfloat16": "mixed_bfloat16", "float16": "mixed_float16"}
"""Keras policy of each precision. Weights and the networks' last layers are float32 in all three.
"""


@contextlib.contextmanager
def computing_in(precision: str) -> Iterator[None]:
    """Let the layers that are built inside this context compute in a precision of `POLICIES`."""
    before = keras.config.dtype_policy()
    keras.config.set_dtype_policy(POLICIES[precision])
    try:
        yield
    finally:
        keras.config.set_dtype_policy(before)
