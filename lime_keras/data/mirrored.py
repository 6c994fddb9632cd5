"""The flip augmentation: a scene with left and right exchanged, and its ground truth with it."""

import tensorflow as tf

_IMAGES = ("image", "clipped", "mask", "diffuse_shading", "specular_shading", "mirror")


def flip(example: dict[str, tf.Tensor]) -> dict[str, tf.Tensor]:
    """Turn x into −x in camera space.

    The mirrored shape under the mirrored light gives the mirrored image, because a lobe depends on
    angles alone. So Eqs. 2 to 5 still hold, with the same material.

    Args:
        example: example from `records.parse` or `pipeline.resize`, with all features or some of
            them; with `camera`, `mask` is needed as well.

    Returns:
        The example with the columns of its pictures and of its light reversed, the x of its normals
        negated, and the principal point of its camera mirrored.
    """
    out = dict(example)
    for name in filter(example.__contains__, _IMAGES):
        out[name] = tf.reverse(example[name], [1])
    if "normal" in example:
        out["normal"] = tf.reverse(example["normal"], [1]) * [-1.0, 1.0, 1.0]
    if "environment" in example:
        # Longitude runs from −z through +x, so reversing the columns changes the sign of x.
        out["environment"] = tf.reverse(example["environment"], [1])
    if "cast" in example:
        out["cast"] = example["cast"] * [1.0, 1.0, -1.0, 1.0]
    if "camera" in example:
        fx, fy, cx, cy = tf.unstack(example["camera"])
        width = tf.cast(tf.shape(out["mask"])[1], tf.float32)
        out["camera"] = tf.stack([fx, fy, width - cx, cy])
    return out
