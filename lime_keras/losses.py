"""The losses: those of the paper (section 5, Eq. 5), and those in their place; `(B,)` each.

The arguments are Keras tensors, with the examples along the first axis. The caller reduces each
loss over the batch and weights the losses. Shapes and ranges are not checked: a shape that does not
fit raises an error of the backend.
"""

from typing import Any

from keras import ops

from lime_keras.optics import colour
from lime_keras.optics.compositing import compose
from lime_keras.optics.dynamic_range import compress, expand
from lime_keras.optics.masking import masked_mean

_NEVER = -1e30  # logit of a class that cannot be: finite, so that no gradient is NaN
_EDGES = 15
"""Width of the window, in pixels, whose mean says how near an edge a pixel of a mask lies.

It was tried at 128 pixels and does not scale: at 64 most pixels are beside an edge.
"""
_EDGE_WEIGHT = 5.0  # additional weight of a pixel whose window holds nothing like itself
_LOGIT = 4.0
"""Factor from coverage less one half to a logit: the sigmoid then rises by 1 per unit at 0.5."""


def squared(true: Any, predicted: Any) -> Any:
    """Return the mean squared error over all axes but the first, `(B,)`, at least 0.

    Args:
        true: true values `(B, ...)`: a mask, an albedo, or log10 s.
        predicted: predicted values of the same shape.

    Example:
        >>> float(squared(ops.ones((1, 2, 2, 1)), ops.full((1, 2, 2, 1), 0.5))[0])
        0.25
    """
    return _mean(ops.square(predicted - true))


def absolute(true: Any, predicted: Any) -> Any:
    """Return the mean absolute error over all axes but the first, `(B,)`, at least 0.

    Of an albedo it is what Table 1 measures. Its best answer is the median of what a photo leaves
    possible: of most objects the m_s of dielectrics, where the mean lies between dielectrics and
    metals.

    Args:
        true: true values `(B, ...)`: an albedo, or log10 s.
        predicted: predicted values of the same shape.

    Example:
        >>> float(absolute(ops.ones((1, 3)), ops.full((1, 3), 0.75))[0])
        0.25
    """
    return _mean(ops.abs(predicted - true))


def mask_structure(mask: Any, predicted: Any) -> Any:
    """Return the cross-entropy of the mask plus 1 − IoU, both weighted towards its edges, `(B,)`.

    A pixel weighs 1, and up to 6 where the mean of the mask around it differs from it: beside edges
    and on thin parts. The coverage p is taken as the probability σ(4 (p − ½)), which has the slope
    of p at one half; p may lie outside [0, 1].

    Args:
        mask: true coverage `(B, H, W, 1)` in [0, 1].
        predicted: predicted coverage `(B, H, W, 1)`.

    Example:
        >>> wrong, right = (
        ...     float(mask_structure(ops.ones((1, 4, 4, 1)), ops.full((1, 4, 4, 1), p))[0])
        ...     for p in (-8.0, 8.0)
        ... )
        >>> wrong > 34, right < 1e-6
        (True, True)
    """
    logit = _LOGIT * (predicted - 0.5)
    around = ops.average_pool(mask, _EDGES, strides=1, padding="same")
    weight = 1 + _EDGE_WEIGHT * ops.abs(around - mask)
    found = ops.sigmoid(logit)
    # The binary cross-entropy of logits, which neither overflows nor loses digits; by a maximum
    # and an absolute value, its derivative at a logit of 0 would be wrong.
    entropy = ops.softplus(logit) - logit * mask
    axes = (1, 2, 3)
    # Shares of all pixels' weights, whose sums do not overflow; a pixel's weight keeps the IoU of
    # nothing with nothing at 1.
    total = ops.sum(weight, axis=axes, keepdims=True)
    share, pixel = weight / total, 1 / total[:, 0, 0, 0]
    both = ops.sum(share * (found * mask), axis=axes)
    either = ops.sum(share * (found + mask - found * mask), axis=axes)
    return ops.sum(share * entropy, axis=axes) + 1 - (both + pixel) / (either + pixel)


def shading_l1(shading: Any, predicted: Any, mask: Any, linear: bool = False) -> Any:
    """Return the mean absolute error of S or M inside the mask, `(B,)`, at least 0.

    An empty mask gives 0.

    Args:
        shading: true S or M, linear radiance `(B, H, W, 1)`, at least 0.
        predicted: output of the network `(B, H, W, 1)`: linear, or else compressed by log(1 + x)
            (`lime_keras.optics.dynamic_range`).
        mask: coverage `(B, H, W, 1)` in [0, 1], the weight of each pixel.
        linear: whether the network predicts linear radiance.

    Example:
        >>> nothing = ops.zeros((1, 2, 2, 1))
        >>> float(shading_l1(nothing, nothing + 0.5, nothing + 1)[0])
        0.5
    """
    return masked_mean(ops.abs(predicted - (shading if linear else compress(shading))), mask)


def exponent_cross_entropy(exponent_bin: Any, logits: Any) -> Any:
    """Return the cross-entropy of the true class of the exponent in nats, `(B,)`, at least 0.

    Args:
        exponent_bin: true classes `(B,)`, integers 0…7 (`lime_keras.optics.shininess`).
        logits: logits of the classes `(B, 8)`, finite. Their softmax are the predicted
            probabilities. The loss does not compute these: a probability that rounds to 0 would
            have no logarithm, and no gradient to learn from.

    Example:
        A network that cannot tell pays log 8:

        >>> round(float(exponent_cross_entropy(ops.array([3]), ops.zeros((1, 8)))[0]), 4)
        2.0794
    """
    return ops.sparse_categorical_crossentropy(exponent_bin, logits, from_logits=True)


def exponent_binary_cross_entropy(exponent_bin: Any, logits: Any) -> Any:
    """Return the binary cross-entropy of the one-hot bins in nats, a mean over bins, `(B,)`.

    −1/8 Σ_k [t_k log p_k + (1 − t_k) log(1 − p_k)] with the softmax p of the logits. Computed from
    the logits, it is finite where a probability rounds to 0 or 1.

    Args:
        exponent_bin: true classes `(B,)`, integers 0…7 (`lime_keras.optics.shininess`).
        logits: logits of the classes `(B, 8)`, finite.

    Example:
        A network that cannot tell pays (log 8 + 7 log 8/7) / 8:

        >>> round(float(exponent_binary_cross_entropy(ops.array([3]), ops.zeros((1, 8)))[0]), 4)
        0.3768
    """
    count = logits.shape[-1]
    total = ops.logsumexp(logits, axis=-1, keepdims=True)
    # 1 − p_k is the sum of the other probabilities: a difference would lose its digits near 1.
    alone = ops.eye(count, dtype="bool")
    others = ops.logsumexp(ops.where(alone, _NEVER, ops.expand_dims(logits, -2)), axis=-1)
    true = ops.one_hot(exponent_bin, count, dtype=logits.dtype)
    return -ops.mean(true * (logits - total) + (1 - true) * (others - total), axis=-1)


def compositing_l2(
    image_srgb: Any,
    mask: Any,
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    diffuse_shading: Any,
    specular_compressed: Any,
) -> Any:
    """Return the mean squared error of the recomposed image, as Eq. 5 is printed, `(B,)`.

    The residual B · (I − m_a − m_d D − m_s S) is squared and averaged over the pixels and channels
    of the image, clipped ones and those of the silhouette as any, in linear radiance.

    The arguments are those of `compositing_l1`; the mask is B.

    Example:
        White under D = 1 without gloss, estimated as black:

        >>> one, zero = ops.ones((1, 2, 2, 1)), ops.zeros((1, 2, 2, 1))
        >>> black = ops.zeros((1, 3)), ops.zeros((1, 1)), ops.zeros((1,)), one, zero
        >>> float(compositing_l2(ops.ones((1, 2, 2, 3)), one, *black)[0])
        1.0
    """
    composed = compose(
        diffuse_albedo, specular_albedo, ambient, diffuse_shading, expand(specular_compressed)
    )
    residual = mask * (colour.srgb_to_linear(image_srgb) - composed)
    return ops.mean(ops.square(residual), axis=(1, 2, 3))


def compositing_l1(
    image_srgb: Any,
    mask: Any,
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    diffuse_shading: Any,
    specular_compressed: Any,
    clipped: Any,
    balance: Any = 1.0,
) -> Any:
    """Return the mean absolute error of the recomposed image, our Eq. 5, `(B,)`, at least 0.

    The image is recomposed by Eq. 4 from the predicted m_d, m_s and S and the true D and m_a, and
    compared with the photo in linear radiance. In a clipped channel the photo gives only a lower
    bound of the radiance, so only a prediction that is too dark counts as an error. The prediction
    itself is never clipped: clipping would remove the gradient where it is too bright. Only pixels
    of full coverage count; if there are none, the loss is 0.

    Args:
        image_srgb: photo `(B, H, W, 3)`, sRGB in [0, 1].
        mask: coverage `(B, H, W, 1)` in [0, 1]; a pixel of partial coverage shows background.
        diffuse_albedo: predicted m_d, linear `(B, 3)` in [0, 1].
        specular_albedo: predicted m_s, `(B, 1)` in [0, 1].
        ambient: true m_a, linear radiance `(B,)`.
        diffuse_shading: true D, linear radiance `(B, H, W, 1)`.
        specular_compressed: predicted S `(B, H, W, 1)`, compressed by log(1 + x).
        clipped: `(B, H, W, 3)`, above 0 where a channel was clipped. If the photo was made smaller,
            this holds for any part of the pixel.
        balance: gains of the photo's channels `(B, H, W, 3)`, where its white balance errs.

    Example:
        A grey material under D = 1 without gloss recomposes to itself:

        >>> grey = ops.full((1, 2, 2, 3), colour.linear_to_srgb(0.25))
        >>> one, zero = ops.ones((1, 2, 2, 1)), ops.zeros((1, 2, 2, 1))
        >>> m_d, m_s, m_a = ops.full((1, 3), 0.25), ops.zeros((1, 1)), ops.zeros((1,))
        >>> error = compositing_l1(grey, one, m_d, m_s, m_a, one, zero, clipped=0 * grey)
        >>> round(float(error[0]), 6)
        0.0
    """
    specular_shading = expand(specular_compressed)
    composed = balance * compose(
        diffuse_albedo, specular_albedo, ambient, diffuse_shading, specular_shading
    )
    image = colour.srgb_to_linear(image_srgb)
    error = ops.where(clipped > 0, ops.maximum(image - composed, 0.0), ops.abs(composed - image))
    full = ops.cast(mask >= 1.0, error.dtype)
    return masked_mean(error, full)


def _mean(values: Any) -> Any:
    return ops.mean(values, axis=tuple(range(1, len(values.shape))))
