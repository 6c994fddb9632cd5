"""ꟻLIP (Andersson et al. 2020) of estimated layers: the difference that the eye would see.

OpenImageIO's implementation, at the viewing distance that is usual for it (0.7 m before a 0.7 m
wide screen of 3,840 pixels: 67 pixels a degree).
"""

import numpy as np
import OpenImageIO as oiio

from .tone import coloured, white_point


def layer_flip(layer: np.ndarray, found: np.ndarray, mask: np.ndarray) -> float:
    """Mean ꟻLIP of a layer inside the mask, in [0, 1]; 0 where the mask is empty.

    Both are shown alike, as a report does: cut out, the truth's 99th percentile white, more than
    that clipped.

    Args:
        layer: true linear radiance `(H, W, 1)`.
        found: estimated, the same shape.
        mask: true coverage `(H, W, 1)`.
    """
    inside = mask >= 0.5
    if not inside.any():
        return 0.0
    white = white_point(layer, mask)
    truth, shown = (_linear_image(coloured(one * inside / white)) for one in (layer, found))
    # In linear light, and of low dynamic range, so that no exposures are searched for.
    difference = oiio.ImageBufAlgo.FLIP_diff(truth, shown, hdr=0, nthreads=1)
    if difference.has_error:
        raise RuntimeError(f"OpenImageIO's FLIP_diff failed: {difference.geterror()}")
    return float(np.asarray(difference.get_pixels(oiio.FLOAT))[inside].mean())


def _linear_image(pixels: np.ndarray) -> oiio.ImageBuf:
    height, width, channels = pixels.shape
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.FLOAT))
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32))
    return image
