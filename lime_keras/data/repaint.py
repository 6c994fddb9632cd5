"""The repaint augmentation: a scene with other albedos, and the same shape, light and exponent."""

import tensorflow as tf


def repaint(example: dict[str, tf.Tensor], seed: tf.Tensor) -> dict[str, tf.Tensor]:
    """Draw new m_d and m_s for the object, as in section 5.1.

    D, S and M do not depend on the albedos.

    Args:
        example: example from `records.parse`.
        seed: `(2,)` integers; the same seed gives the same albedos.

    Returns:
        The example with a new `diffuse_albedo` `(3,)` and a new `specular_albedo` `()`; m_a stays.
        `image` still shows the old albedos (see `recomposition.recompose`).
    """
    # Section 5.1 draws uniformly in YUV and keeps valid RGB. This is uniform in RGB, because the
    # conversion is linear.
    drawn = tf.random.stateless_uniform((4,), seed)
    return example | {"diffuse_albedo": drawn[:3], "specular_albedo": drawn[3]}
