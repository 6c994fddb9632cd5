"""JPEG compression and decompression of batches in `keras.ops`, on the device that trains.

The steps and their roundings are libjpeg's: 8-bit YCbCr, chroma of half resolution, 8 × 8 DCT,
the standard's quantisation tables (ITU-T T.81, annex K) scaled by the quality, and chroma
interpolated linearly. Entropy coding loses nothing and is left out.
"""

from typing import Any

import numpy as np
from keras import ops

_LUMINANCE_STEPS = np.array(
    [
        *(16, 11, 10, 16, 24, 40, 51, 61),
        *(12, 12, 14, 19, 26, 58, 60, 55),
        *(14, 13, 16, 24, 40, 57, 69, 56),
        *(14, 17, 22, 29, 51, 87, 80, 62),
        *(18, 22, 37, 56, 68, 109, 103, 77),
        *(24, 35, 55, 64, 81, 104, 113, 92),
        *(49, 64, 78, 87, 103, 121, 120, 101),
        *(72, 92, 95, 98, 112, 100, 103, 99),
    ],
    np.float32,
)
_CHROMINANCE_STEPS = np.array(
    [
        *(17, 18, 24, 47, 99, 99, 99, 99),
        *(18, 21, 26, 66, 99, 99, 99, 99),
        *(24, 26, 56, 99, 99, 99, 99, 99),
        *(47, 66, 99, 99, 99, 99, 99, 99),
        *(99, 99, 99, 99, 99, 99, 99, 99),
        *(99, 99, 99, 99, 99, 99, 99, 99),
        *(99, 99, 99, 99, 99, 99, 99, 99),
        *(99, 99, 99, 99, 99, 99, 99, 99),
    ],
    np.float32,
)
_YCC_FROM_RGB = np.array(
    [[0.299, 0.587, 0.114], [-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]], np.float32
)
_OFFSET = np.array([0.0, 128.0, 128.0], np.float32)
_BLOCK = 8
"""Side of the blocks that are transformed, in pixels."""


def compressed(image: Any, quality: Any) -> Any:
    """Compress images as JPEGs, with chroma of half resolution (4:2:0), and decompress them.

    Args:
        image: sRGB in 8-bit levels 0 … 255, whole numbers, `(B, H, W, 3)` float32; H and W are
            multiples of 16.
        quality: quality of libjpeg, whole numbers 1 … 100, `(B,)` float32.

    Returns:
        The decompressed images, whole numbers 0 … 255, `(B, H, W, 3)` float32.

    Raises:
        ValueError: if H or W is no multiple of 16.
    """
    height, width = image.shape[1:3]
    if height % (2 * _BLOCK) or width % (2 * _BLOCK):
        raise ValueError(
            f"JPEG compression takes images whose sides are multiples of {2 * _BLOCK}, not "
            f"{height} x {width}: choose another size"
        )
    components = ops.round(ops.matmul(image, _YCC_FROM_RGB.T) + _OFFSET)
    luma, blueness, redness = (components[..., k] for k in range(3))
    chroma = ops.concatenate([_halved(blueness), _halved(redness)], axis=1)
    luma = _quantised(luma, _steps(_LUMINANCE_STEPS, quality))
    chroma = _quantised(chroma, _steps(_CHROMINANCE_STEPS, quality)) - 128.0
    blueness, redness = _doubled(chroma[:, : height // 2]), _doubled(chroma[:, height // 2 :])
    red = luma + ops.round(1.402 * redness)
    green = luma + ops.round(-0.344136 * blueness - 0.714136 * redness)
    blue = luma + ops.round(1.772 * blueness)
    return ops.clip(ops.stack([red, green, blue], axis=-1), 0.0, 255.0)


def _steps(table: np.ndarray, quality: Any) -> Any:
    """Return the quantisation steps `(B, 64)`, 1 … 255, of a table `(64,)` at qualities `(B,)`."""
    per_cent = ops.where(quality < 50.0, ops.floor(5000.0 / quality), 200.0 - 2.0 * quality)
    # Half a hundredth is added, so that whole hundredths survive a rounded division.
    scaled = ops.floor((table * per_cent[:, None] + 50.5) * 0.01)
    return ops.clip(scaled, 1.0, 255.0)


def _quantised(plane: Any, steps: Any) -> Any:
    """Return planes `(B, H, W)` after DCT, quantisation, inverse DCT, rounding and clipping.

    Args:
        plane: whole numbers 0 … 255; H and W are multiples of 8.
        steps: quantisation steps of the 64 coefficients, `(B, 64)`.
    """
    batch, height, width = plane.shape
    shape = (batch, height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK)
    blocks = ops.transpose(ops.reshape(plane - 128.0, shape), (0, 1, 3, 2, 4))
    blocks = ops.reshape(blocks, (batch, -1, _BLOCK * _BLOCK))
    steps = steps[:, None]
    coefficients = ops.round(ops.matmul(blocks, _DCT.T) / steps) * steps
    blocks = ops.clip(ops.round(ops.matmul(coefficients, _DCT) + 128.0), 0.0, 255.0)
    blocks = ops.reshape(blocks, (batch, shape[1], shape[3], _BLOCK, _BLOCK))
    return ops.reshape(ops.transpose(blocks, (0, 1, 3, 2, 4)), (batch, height, width))


def _dct() -> np.ndarray:
    """Return the orthonormal discrete cosine transform of 8 × 8 blocks, `(64, 64)`."""
    k = np.arange(_BLOCK)
    waves = np.cos(np.pi * np.outer(k, 2 * k + 1) / (2 * _BLOCK)) * np.sqrt(2 / _BLOCK)
    waves[0] /= np.sqrt(2)
    return np.kron(waves, waves).astype(np.float32)


_DCT = _dct()


def _halved(plane: Any) -> Any:
    """Return the means of 2 × 2 pixels, `(B, H/2, W/2)`, rounded down and up in turn."""
    batch, height, width = plane.shape
    total = ops.sum(ops.reshape(plane, (batch, height // 2, 2, width // 2, 2)), axis=(2, 4))
    return ops.floor((total + _alternating(1.0, 2.0, width // 2)) * 0.25)


def _doubled(plane: Any) -> Any:
    """Return planes interpolated linearly to twice the size, `(B, 2 H, 2 W)`, rounded.

    Each new pixel lies a quarter of an old one off its centre.
    """
    batch, height, width = plane.shape
    above = ops.concatenate([plane[:, :1], plane[:, :-1]], axis=1)
    below = ops.concatenate([plane[:, 1:], plane[:, -1:]], axis=1)
    tall = ops.stack([3.0 * plane + above, 3.0 * plane + below], axis=2)
    tall = ops.reshape(tall, (batch, 2 * height, width))
    left = ops.concatenate([tall[..., :1], tall[..., :-1]], axis=2)
    right = ops.concatenate([tall[..., 1:], tall[..., -1:]], axis=2)
    wide = ops.stack([3.0 * tall + left, 3.0 * tall + right], axis=3)
    wide = ops.reshape(wide, (batch, 2 * height, 2 * width))
    return ops.floor((wide + _alternating(8.0, 7.0, 2 * width)) * 0.0625)


def _alternating(first: float, second: float, count: int) -> np.ndarray:
    return np.resize(np.array([first, second], np.float32), count)
