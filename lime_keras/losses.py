"""The paper's losses (section 5, with Eq. 5), each one number per example: shape `(B,)`.

The reduction over the batch, and the weights between the terms, are the caller's.
"""

from typing import Any

from keras import ops

from lime_keras.optics import colour
from lime_keras.optics.compositing import compose
from lime_keras.optics.dynamic_range import compress, expand
from lime_keras.optics.masking import masked_mean
from lime_keras.optics.shininess import LOG_LOW


def mask_l2(mask: Any, predicted: Any) -> Any:
    """Mean squared error of the mask over the whole image; both `(B, H, W, 1)` in [0, 1]."""
    return ops.mean(ops.square(predicted - mask), axis=(1, 2, 3))


def shading_l1(shading: Any, predicted_compressed: Any, mask: Any) -> Any:
    """Masked ℓ1 on S or M, both compressed (`dynamic_range`).

    Args:
        shading: true linear shading `(B, H, W, 1)`.
        predicted_compressed: what the network answers, `(B, H, W, 1)`.
        mask: coverage `(B, H, W, 1)`.
    """
    return masked_mean(ops.abs(predicted_compressed - compress(shading)), mask)


def albedo_l2(albedo: Any, predicted: Any) -> Any:
    """Mean squared error of an albedo `(B, C)` in [0, 1]."""
    return ops.mean(ops.square(predicted - albedo), axis=-1)


def exponent_cross_entropy(exponent_bin: Any, probabilities: Any) -> Any:
    """Cross-entropy in nats of the true class `(B,)` under `(B, 8)` probabilities."""
    least = 1e-7
    chosen = ops.take_along_axis(probabilities, ops.expand_dims(exponent_bin, -1), axis=-1)
    return -ops.log(ops.maximum(chosen[:, 0], least))


def log_exponent_l2(exponent: Any, log_predicted: Any) -> Any:
    """Squared error of log10 s: true exponents `(B,)` at least 0, predicted logarithms `(B, 1)`.

    As for the bins, a smaller exponent counts as 1.
    """
    log = ops.log10(ops.maximum(exponent, 10.0**LOG_LOW))
    return ops.square(log_predicted[:, 0] - log)


def compositing_l1(
    image_srgb: Any,
    mask: Any,
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    diffuse_shading: Any,
    specular_compressed: Any,
    clipped: Any = None,
) -> Any:
    """Eq. 5: the image recomposed from predicted m_d, m_s, S and true D, m_a, against the photo.

    A clipped channel says only that the radiance was at least what the photo shows, so there the
    error is how far the prediction falls short of it, and overshoot is free; elsewhere it is the
    distance in linear radiance. The prediction itself is never clipped, or an overshoot would
    lose its gradient.

    Args:
        image_srgb: `(B, H, W, 3)` in [0, 1], sRGB.
        mask: coverage `(B, H, W, 1)`; pixels of partial coverage show background and do not count.
        diffuse_albedo: predicted m_d `(B, 3)`.
        specular_albedo: predicted m_s `(B, 1)`.
        ambient: true m_a `(B,)`.
        diffuse_shading: true D `(B, H, W, 1)`.
        specular_compressed: predicted S `(B, H, W, 1)`, compressed.
        clipped: `(B, H, W, 3)`, above 0 where a channel, or a part of the pixel before the photo
            was made smaller, was clipped; by default the channels at `colour.CLIPPED` and above.
    """
    if clipped is None:
        clipped = ops.cast(image_srgb >= colour.CLIPPED, image_srgb.dtype)
    specular_shading = expand(specular_compressed)
    composed = compose(diffuse_albedo, specular_albedo, ambient, diffuse_shading, specular_shading)
    image = colour.srgb_to_linear(image_srgb)
    error = ops.where(clipped > 0, ops.maximum(image - composed, 0.0), ops.abs(composed - image))
    full = ops.cast(mask >= 1.0, error.dtype)
    return masked_mean(error, full)
