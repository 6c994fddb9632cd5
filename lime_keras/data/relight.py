"""The relight augmentation: a scene in a new mixture of the lights that its record holds."""

import tensorflow as tf

from lime_keras.data import records

_LEAST_STRENGTH = 1e-6
"""Least strength of a light that takes part, so that the strengths never sum to 0."""


def relight(example: dict[str, tf.Tensor], seed: tf.Tensor) -> dict[str, tf.Tensor]:
    """Mix the lights of a scene with the weights of `draw_weights`.

    D, S, M and the environment are linear in the light, so the same mixture of each is a scene. The
    mixture has the spherical mean of the lights, and its strongest lights are in front of the
    object, as all of them are. A scene of one light stays as it is.

    Args:
        example: example from `records.parse`, with any of the features `records.LIT`, and the
            encoded further lights of each.
        seed: `(2,)` integers; the same seed gives the same mixture.

    Returns:
        The example with the mixed features and without further lights. `image` still shows the
        first light (see `recomposition.recompose`), and `light` is still its name.
    """
    out = {k: v for k, v in example.items() if k not in records.FURTHER.values()}
    lit = [name for name in records.LIT if name in example]
    if lit:
        weights = draw_weights(1 + tf.size(example[records.FURTHER[lit[0]]]), seed)
        out |= {
            name: _mixed(example[name], example[records.FURTHER[name]], weights) for name in lit
        }
    return out


def has_several_lights(example: dict[str, tf.Tensor]) -> tf.Tensor:
    """Return whether a record holds several lights, a boolean `()`.

    Args:
        example: example from `records.parse`, with D and its encoded further ones.
    """
    return tf.size(example[records.FURTHER["diffuse_shading"]]) > 0


def draw_weights(count: tf.Tensor, seed: tf.Tensor) -> tf.Tensor:
    """Draw the weights of lights in a mixture.

    The number of lights that take part is uniform in 1 … L, and every choice of so many is equally
    likely. Their weights are uniform over all non-negative weights that sum to 1.

    Args:
        count: L, the number of lights, at least 1.
        seed: `(2,)` integers.

    Returns:
        Weights `(L,)` that sum to 1; 0 for lights that take no part.
    """
    drawn = tf.random.stateless_uniform((2 * count + 1,), seed)
    number = 1 + tf.cast(drawn[0] * tf.cast(count, tf.float32), tf.int32)
    places = tf.argsort(tf.argsort(drawn[1 : count + 1]))
    # Normalised exponential numbers are uniform over the simplex.
    strengths = tf.maximum(-tf.math.log1p(-drawn[count + 1 :]), _LEAST_STRENGTH)
    strengths = tf.where(places < number, strengths, 0.0)
    return strengths / tf.reduce_sum(strengths)


def _mixed(first: tf.Tensor, further: tf.Tensor, weights: tf.Tensor) -> tf.Tensor:
    """Return the weighted sum of an image and of encoded others; weight 0 is not decoded."""
    taking_part = tf.where(weights[1:] > 0)[:, 0]
    strengths = tf.gather(weights[1:], taking_part)

    def with_others() -> tf.Tensor:
        others = records.decode(tf.gather(further, taking_part))
        return weights[0] * first + tf.tensordot(strengths, others, 1)

    return tf.cond(tf.size(taking_part) > 0, with_others, lambda: first)
