"""The public door to pictures; how they are read and written stands in `lime_keras.io.photo`."""

from lime_keras.io.photo import read, read_mask, read_srgb, write

__all__ = ["read", "read_mask", "read_srgb", "write"]
