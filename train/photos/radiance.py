"""The linear radiance of a stored scene, with the albedos that it has or with new ones (Eq. 4)."""

import functools
from collections.abc import Collection

import numpy as np
import tensorflow as tf

from lime_keras.data import pipeline
from lime_keras.data.camera import SCENE, linear, objects_share
from lime_keras.optics import material_law

_NEAR = 64  # materials on either side of a scene's s in the table of natural ones, 0.024 decades

_natural_table = functools.cache(material_law.natural_table)


def scene(
    serialized: tf.Tensor,
    seed: tf.Tensor,
    features: Collection[str],
    materials: tuple[str, ...] = (),
) -> dict[str, tf.Tensor]:
    """Return a record's features and its light, unclipped in pixels that the object covers fully.

    D, S and M do not depend on the albedos, so new albedos give the exact light of the object. What
    is behind it keeps its light: at the silhouette this is the stored image minus the object's
    stored share, at least 0.

    Args:
        serialized: serialised example.
        seed: `(2,)` integers; the same seed gives the same albedos.
        features: names of the features of a batch that are wanted.
        materials: laws of new albedos, of `material_law.LAWS`, any of which the object's follow;
            none for the albedos that the scene was rendered with.

    Returns:
        The features and those of `camera.SCENE`; `object`, coverage × Eq. 4, and `background`, what
        it leaves of the rest, both linear radiance `(S, S, 3)`, whose sum is the scene's.
    """
    wanted = pipeline.stored_for(features) | {"seed", "index", "shininess", *SCENE}
    example = pipeline.parse_finite(serialized, wanted)
    share = objects_share(example)
    rest = tf.maximum(linear(example["image"]) - share, 0.0)
    # Inside the object the difference is that of rounding to 8 bits.
    example["background"] = tf.where(example["mask"] < 1.0, rest, 0.0)
    if materials:
        example = repaint(example, seed, materials)
        share = objects_share(example)
    return example | {"object": share}


def repaint(
    example: dict[str, tf.Tensor], seed: tf.Tensor, materials: tuple[str, ...]
) -> dict[str, tf.Tensor]:
    """Draw new m_d and m_s for the object.

    Args:
        example: example from `records.parse`.
        seed: `(2,)` integers; the same seed gives the same albedos.
        materials: one or more of `material_law.LAWS`; the albedos follow any of them, given s, with
            the same chance.

    Returns:
        The example with a new `diffuse_albedo` `(3,)` and `specular_albedo` `()`; m_a stays, and
        `image` still shows the old albedos.
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
    table = _natural_table()
    logs, albedos = table[:, 0].copy(), table[:, 1:].copy()
    log = tf.math.log(tf.maximum(example["shininess"], 1.0)) / np.log(10.0).astype(np.float32)
    nearest = tf.searchsorted(logs, log[None])[0]
    offset = tf.random.stateless_uniform((), seed, -_NEAR, _NEAR + 1, tf.int32)
    return tf.constant(albedos)[tf.clip_by_value(nearest + offset, 0, len(logs) - 1)]


_DRAW = {material_law.UNIFORM: _uniform, material_law.NATURAL: _natural}
