"""A scene in a mirror, as an augmentation: left and right change places, all of it stays true."""

import tensorflow as tf

_IMAGES = ("image", "clipped", "mask", "diffuse_shading", "specular_shading", "mirror")


def flip(example: dict[str, tf.Tensor]) -> dict[str, tf.Tensor]:
    """Turn x into −x in camera space.

    The mirrored shape under the mirrored light shades as the mirrored image does, because a lobe
    depends on angles alone; so Eqs. 2 to 5 hold as before, with the same material.

    Args:
        example: as of `records.parse` or `pipeline.resize`: all of it, or some of it, with the
            mask if the camera is there.

    Returns:
        The example with its pictures' and its light's columns reversed, the first component of its
        normals negated, and its camera's principal point as far from the other edge.
    """
    out = dict(example)
    for name in filter(example.__contains__, _IMAGES):
        out[name] = tf.reverse(example[name], [1])
    if "normal" in example:
        out["normal"] = tf.reverse(example["normal"], [1]) * [-1.0, 1.0, 1.0]
    if "environment" in example:
        # Longitude runs from −z through +x: to reverse its columns is to change the sign of x.
        out["environment"] = tf.reverse(example["environment"], [1])
    if "camera" in example:
        fx, fy, cx, cy = tf.unstack(example["camera"])
        width = tf.cast(tf.shape(out["mask"])[1], tf.float32)
        out["camera"] = tf.stack([fx, fy, width - cx, cy])
    return out
