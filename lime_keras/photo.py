"""The public functions that read and write pictures, implemented in `lime_keras.io.photo`."""

from lime_keras.io.photo import read_mask, read_srgb, write

__all__ = ["read_mask", "read_srgb", "write"]
