"""The features of a training batch, by name; kept apart from the pipeline and its TensorFlow."""

LEARNT_FROM = (
    "image",
    "mask",
    "diffuse_shading",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "ambient",
    "clipped",
    "cast",
    "exponent_bin",
)
"""Features that the losses need. Strings, which other backends do not take, are left out.

Normals are left out, too: the losses do not use them, and decoding takes time.
"""
