"""The repaint augmentation: a scene with other albedos, and the same shape, light and exponent."""

import functools

import numpy as np
import tensorflow as tf

from lime_keras.optics import material_law

_NEAR = 64
"""Materials on either side of a scene's s in the table of natural ones, 0.024 decades."""


def repaint(
    example: dict[str, tf.Tensor],
    seed: tf.Tensor,
    materials: tuple[str, ...] = (material_law.UNIFORM,),
) -> dict[str, tf.Tensor]:
    """Draw new m_d and m_s for the object.

    D, S and M do not depend on the albedos.

    Args:
        example: example from `records.parse`.
        seed: `(2,)` integers; the same seed gives the same albedos.
        materials: one or more of `material_law.LAWS`; the albedos follow any of them, given s,
            with the same chance.

    Returns:
        The example with a new `diffuse_albedo` `(3,)` and a new `specular_albedo` `()`; m_a stays.
        `image` still shows the old albedos (see `recomposition.recompose`).
    """
    drawn = [_DRAW[law](example, seed) for law in materials]
    # Parts of a seed do not repeat the numbers that it gives itself.
    which = tf.random.stateless_uniform(
        (), tf.random.split(seed, 2)[1], 0, len(materials), tf.int32
    )
    albedos = tf.gather(tf.stack(drawn), which)
    return example | {"diffuse_albedo": albedos[:3], "specular_albedo": albedos[3]}


def _uniform(example: dict[str, tf.Tensor], seed: tf.Tensor) -> tf.Tensor:
    # Section 5.1 draws uniformly in YUV and keeps valid RGB. This is uniform in RGB, because the
    # conversion is linear.
    return tf.random.stateless_uniform((4,), seed)


def _natural(example: dict[str, tf.Tensor], seed: tf.Tensor) -> tf.Tensor:
    logs, albedos = _natural_table()
    log = tf.math.log(tf.maximum(example["shininess"], 1.0)) / np.log(10.0).astype(np.float32)
    nearest = tf.searchsorted(logs, log[None])[0]
    offset = tf.random.stateless_uniform((), seed, -_NEAR, _NEAR + 1, tf.int32)
    return tf.constant(albedos)[tf.clip_by_value(nearest + offset, 0, len(logs) - 1)]


@functools.cache
def _natural_table() -> tuple[np.ndarray, np.ndarray]:
    """Return log10 s `(N,)` and the albedos `(N, 4)` of natural materials."""
    table = material_law.natural_table()
    return table[:, 0].copy(), table[:, 1:].copy()


_DRAW = {material_law.UNIFORM: _uniform, material_law.NATURAL: _natural}
