"""The split of an object's colours into diffuse and grey light: Eq. 4 in closed form.

In grey light m_a, m_s and S are grey, so each pixel of an object is m_d · D plus something grey.
The chroma of a pixel, which is left of a colour when its mean over R, G and B is taken away, is
therefore D times the chroma of m_d (the dichromatic reflection model; Shafer 1985):

- its direction, the same for all pixels, is the hue of m_d;
- its length d is D up to one factor;
- mean(I) − k · d is m_s · S + m_a, for one unknown k: the mean of m_d over the length of its
  chroma;
- since S and m_a are not negative, k is at most the least of mean(I) / d over the pixels. The most
  saturated patch attains it where S and m_a are small.

A grey object shows nothing of this; then the hue and d are 0. The functions take NumPy arrays or
Keras tensors, and compute in single precision at least.
"""

from typing import Any, NamedTuple

import numpy as np

from lime_keras.optics import colour
from lime_keras.optics.namespace import namespace

CHANNELS = 4  # number of channels of `channels`

_PATCH = 4
"""Height and width, in pixels, of the patches whose saturation is compared: JPEG blurs chroma."""
_DARK = 2e-3  # radiance that is added to the mean of a patch: in the dark, noise is saturated
_GREY = 2e-2
"""Saturation that is added to the largest: of a grey object all light then counts as grey."""
_COVERED = 0.75
"""Least coverage of a patch, over that of the fullest, from which on its saturation counts."""
_LEAST_CHROMA = 1e-3
"""Least chroma, linear radiance, over which a mean has a direction: a quarter of an 8-bit level."""
_LEAST_SQUARE = 1e-20
SECOND_COLOUR = 0.15
"""`second_colour` above which an object has several hues; one in grey light has 0.04 at most."""
_FEWEST = 64  # pixels from which on their median is trusted
_COLOURED = (0.5, 0.65)
"""Chroma over mean, of the median pixel, from which a colour is the object's, and no longer may be
the light's: that of white paper and china by a lamp is below, and felt, cloth and wood above."""
_PATCHES = 48
"""Number of patches along the longer side of an object, about, whose colours are compared."""
_FEWEST_PATCHES = 24
_NEAR = 0.8  # share of the patches that are compared: the nearest to their median
_SPREAD_DARK = 0.01  # radiance that is added to the mean of a patch where its colour is compared
_ROOT = 1e-4  # radiance added below the root of the grey light, which has no gradient at 0


class Split(NamedTuple):
    """The parts of an object's light; zeros where the object is grey, black, clipped or missing.

    Attributes:
        hue: direction of the chroma of m_d, `(B, 3)`, of length 1.
        saturation: length of the chroma over the mean of the most saturated patch, `(B, 1)`, at
            least 0: the inverse of the largest k that the pixels allow.
        diffuse: mean(m_d) · D where k is the largest, linear radiance `(B, H, W, 1)`, at least 0; D
            up to one factor.
        grey: m_s · S + m_a where k is the largest, linear radiance `(B, H, W, 1)`, at least 0.
        trusted: whether the object's colour is strong enough to be split, `(B, 1)`, 0 or 1.
    """

    hue: Any
    saturation: Any
    diffuse: Any
    grey: Any
    trusted: Any


def split(image: Any, mask: Any) -> Split:
    """Split the light of objects into diffuse and grey light.

    The result is exact for an image without noise with a pixel of S = m_a = 0, if patches are one
    pixel and `_DARK` and `_GREY` are 0; their values are for photographs. Taking a quantile of the
    saturation for the largest was worse under every flaw of a photograph
    (benchmarks/dichromatic.py).

    Args:
        image: photos `(B, H, W, 3)`, sRGB in [0, 1].
        mask: coverage of the objects `(B, H, W, 1)` in [0, 1].
    """
    xp = namespace(image, mask)
    linear, weight = _usable(image, mask, xp)
    mean = xp.mean(linear, axis=-1, keepdims=True)
    chroma = _chroma(linear, xp)
    hue, known = _direction(chroma, weight, xp)
    along = xp.sum(chroma * xp.reshape(hue, (-1, 1, 1, 3)), axis=-1, keepdims=True)
    length = xp.maximum(along, np.float32(0))
    saturation = known * _largest(length, mean, weight, xp)
    inside = xp.where(mask > 0, np.float32(1), np.float32(0))
    factor = xp.reshape(saturation + np.float32(_GREY), (-1, 1, 1, 1))
    least = np.float32(_LEAST_SQUARE)
    diffuse = inside * length / xp.maximum(factor, least)
    return Split(
        hue=hue,
        saturation=saturation,
        diffuse=diffuse,
        grey=inside * xp.maximum(mean - diffuse, np.float32(0)),
        trusted=known,
    )


def channels(image: Any, mask: Any) -> Any:
    """Return what the subnetworks see of the split, `(B, H, W, 4)`, each 0 outside the mask.

    The root of the grey light; the saturation of each pixel over the largest; the largest, the same
    for all pixels; and whether a channel of the pixel is clipped, in which case its split is false.

    Args:
        image: photos `(B, H, W, 3)`, sRGB in [0, 1].
        mask: coverage of the objects `(B, H, W, 1)` in [0, 1].
    """
    xp = namespace(image, mask)
    parts = split(image, mask)
    inside = xp.where(mask > 0, np.float32(1), np.float32(0))
    root = xp.sqrt(parts.grey + np.float32(_ROOT)) - np.float32(_ROOT**0.5)
    whole = parts.diffuse + parts.grey
    relative = parts.diffuse / (whole + np.float32(_DARK))
    largest = xp.reshape(parts.saturation, (-1, 1, 1, 1)) * inside
    brightest = xp.max(image, axis=-1, keepdims=True)
    clipped = xp.where(brightest >= colour.CLIPPED, inside, np.float32(0))
    return xp.concatenate([root, relative, largest, clipped], axis=-1)


def with_hue_of_pixels(diffuse_albedo: Any, masked_image: Any) -> Any:
    """Return albedos turned to the hue of the object's pixels; grey part and saturation stay.

    An albedo stays as it is if the pixels are grey, if there are none, or if all are clipped.

    Args:
        diffuse_albedo: estimated m_d, linear RGB `(B, 3)`, finite.
        masked_image: photos times the object's coverage `(B, H, W, 3)`, sRGB in [0, 1].

    Returns:
        m_d, linear RGB `(B, 3)`. The turned albedo may lie outside [0, 1].
    """
    xp = namespace(diffuse_albedo, masked_image)
    linear, weight = _usable(masked_image, np.float32(1), xp)
    hue, known = _direction(_chroma(linear, xp), weight, xp)
    own = _chroma(diffuse_albedo, xp)
    turned = diffuse_albedo - own + _length(own, xp) * hue
    return xp.where(known > 0, turned, diffuse_albedo)


def with_saturation_of_pixels(
    diffuse_albedo: np.ndarray, image: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Raise an albedo's saturation to the median of the object's pixels; its mean stays.

    What is added to m_d · D in grey light is grey, so m_d is at least as saturated as any pixel.
    Networks, which learn a mean, fall a tenth below (docs/explanation/decisions.md). The albedo
    stays as it is where the pixels do not show it: fewer than 64 that are not clipped, a second
    hue, or so little colour that the light's own may be all of it.

    Args:
        diffuse_albedo: estimated m_d, linear RGB `(3,)` in [0, 1].
        image: picture of the object `(H, W, 3)`, sRGB in [0, 1].
        mask: coverage of the object `(H, W, 1)` in [0, 1].
    """
    inside = (mask[..., 0] >= 0.5) & (colour.brightest(image) < colour.CLIPPED)
    pixels = image[inside]
    mean, own = float(np.mean(diffuse_albedo)), diffuse_albedo - np.mean(diffuse_albedo)
    length = float(np.linalg.norm(own))
    if len(pixels) < _FEWEST or length <= _LEAST_CHROMA or second_colour(pixels) > SECOND_COLOUR:
        return diffuse_albedo
    linear = colour.srgb_to_linear(pixels)
    grey = colour.grey(linear)
    chroma = np.linalg.norm(linear - grey[:, None], axis=-1)
    median = float(np.median(chroma / (grey + _DARK)))
    low, high = _COLOURED
    share = min(max((median - low) / (high - low), 0.0), 1.0)
    factor = 1 + share * max(median * mean / length - 1, 0.0)
    # No channel may leave [0, 1].
    room = np.where(own < 0, mean, 1 - mean) / np.maximum(np.abs(own), _LEAST_SQUARE)
    factor = min(factor, max(float(room.min()), 1.0))
    return np.asarray(mean + factor * own, diffuse_albedo.dtype)


def second_colour(pixels_srgb: np.ndarray) -> float:
    """Return how much colour an object has beside its own, over its brightness.

    By Eq. 4 in grey light, the chroma of all pixels (their linear colour less its grey mean) has
    one direction, that of m_d. The root mean square of what is across the mean direction, over the
    mean radiance, is returned: 0 for one colour.

    Args:
        pixels_srgb: pixels of the object without a clipped channel `(N, 3)`, sRGB in [0, 1]; 0 if
            there is none.
    """
    linear = colour.srgb_to_linear(pixels_srgb)
    brightness = float(linear.mean()) if len(linear) else 0.0
    if not brightness > 0:
        return 0.0
    chroma = linear - colour.grey(linear)[:, None]
    mean = chroma.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length > _LEAST_CHROMA:
        direction = mean / length
        chroma = chroma - (chroma @ direction)[:, None] * direction
    return float(np.sqrt(np.mean(np.sum(chroma**2, axis=-1)))) / brightness


def colour_spread(image_srgb: np.ndarray, inside: np.ndarray) -> float:
    """Return how far the colours of an object's patches are from one, 0 for one colour.

    The relative chroma of a patch is its linear colour less its grey mean, over that mean. The root
    mean square of its distance from the mean is returned, without the fifth of the patches that is
    farthest from the median: highlights take little of the surface, a second material takes much.
    Patches are used because noise and JPEG colour single pixels.

    Args:
        image_srgb: picture `(H, W, 3)`, sRGB in [0, 1].
        inside: pixels of the object, bool `(H, W)`.
    """
    lit = [np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0)]
    if not lit[0].size:
        return 0.0
    extent = max(int(part[-1] - part[0]) + 1 for part in lit)
    step = max(1, extent // (4 * _PATCHES))
    patch = max(1, -(-extent // (step * _PATCHES)))
    rows, columns = (slice(part[0], part[-1] + 1, step) for part in lit)
    image, covered = image_srgb[rows, columns], inside[rows, columns]
    high, wide = (size // patch for size in covered.shape)
    shape = (high, patch, wide, patch)
    cut = slice(0, high * patch), slice(0, wide * patch)
    usable = covered[cut] & (colour.brightest(image[cut]) < colour.CLIPPED)
    whole = usable.reshape(shape).all(axis=(1, 3))
    if whole.sum() < _FEWEST_PATCHES:
        return 0.0
    linear = colour.srgb_to_linear(image[cut].astype(np.float32))
    means = linear.reshape(*shape, 3).mean(axis=(1, 3))[whole].astype(np.float64)
    grey = means.mean(axis=-1, keepdims=True)
    relative = (means - grey) / (grey + _SPREAD_DARK)
    far = np.sum((relative - np.median(relative, axis=0)) ** 2, axis=-1)
    near = relative[np.argsort(far, kind="stable")[: round(_NEAR * len(far))]]
    return float(np.sqrt(np.mean(np.sum((near - near.mean(axis=0)) ** 2, axis=-1))))


def _usable(image: Any, mask: Any, xp: Any) -> tuple[Any, Any]:
    """Return linear radiance `(B, H, W, 3)`, and the weight of each pixel `(B, H, W, 1)`.

    A pixel with a clipped channel, whose hue is false, has no weight.
    """
    brightest = xp.max(image, axis=-1, keepdims=True)
    usable = xp.logical_and(brightest > 0, brightest < colour.CLIPPED)
    # Single precision: the pixels of a large mask sum to more than float16's largest number.
    weight = xp.where(usable, xp.multiply(mask, np.float32(1)), np.float32(0))
    return colour.srgb_to_linear(xp.multiply(image, np.float32(1)), xp), weight


def _direction(chroma: Any, weight: Any, xp: Any) -> tuple[Any, Any]:
    """Return the direction of the mean chroma `(B, 3)`, or 0, and 1 or 0 for this `(B, 1)`."""
    count = xp.sum(weight, axis=(1, 2))
    mean = xp.sum(weight * chroma, axis=(1, 2)) / xp.maximum(count, np.float32(1e-6))
    length = _length(mean, xp)
    known = xp.where(length > np.float32(_LEAST_CHROMA), np.float32(1), np.float32(0))
    return known * mean / xp.maximum(length, np.float32(_LEAST_CHROMA)), known


def _largest(length: Any, mean: Any, weight: Any, xp: Any) -> Any:
    """Return the largest saturation of the patches that the object fills, `(B, 1)`."""
    covered, coloured, bright = (
        _sums(values, xp) for values in (weight, weight * length, weight * mean)
    )
    least = xp.max(covered, axis=1, keepdims=True) * np.float32(_COVERED)
    size = xp.maximum(bright + covered * np.float32(_DARK), np.float32(1e-6))
    saturation = xp.where(covered >= least, coloured / size, np.float32(0))
    return xp.max(saturation, axis=1, keepdims=True)


def _sums(values: Any, xp: Any) -> Any:
    """Return the sums over whole patches, `(B, N)`."""
    rows, columns = (size // _PATCH for size in values.shape[1:3])
    cut = values[:, : rows * _PATCH, : columns * _PATCH, 0]
    blocks = xp.reshape(cut, (-1, rows, _PATCH, columns, _PATCH))
    return xp.reshape(xp.sum(blocks, axis=(2, 4)), (-1, rows * columns))


def _chroma(rgb: Any, xp: Any) -> Any:
    return rgb - xp.mean(rgb, axis=-1, keepdims=True)


def _length(vector: Any, xp: Any) -> Any:
    # At 0 the root has no gradient.
    least = np.float32(_LEAST_SQUARE)
    return xp.sqrt(xp.maximum(xp.sum(xp.square(vector), axis=-1, keepdims=True), least))
