"""The perceptual error ꟻLIP (Andersson et al. 2020) of estimated layers.

The implementation is OpenImageIO's, at its default viewing distance: 0.7 m from a screen that is
0.7 m wide with 3,840 pixels, or 67 pixels per degree.
"""

import numpy as np
import OpenImageIO as oiio

from .tone import coloured, white_point


def layer_flip(layer: np.ndarray, estimated: np.ndarray, mask: np.ndarray) -> float:
    """Return the mean ꟻLIP of a layer inside the mask, in [0, 1]; 0 if the mask is empty.

    Both layers are shown as in a report: cut out by the mask, the truth's 99th percentile as white,
    higher values clipped.

    Args:
        layer: true linear radiance `(H, W, 1)`.
        estimated: estimated linear radiance `(H, W, 1)`.
        mask: true coverage `(H, W, 1)`.
    """
    inside = mask >= 0.5
    if not inside.any():
        return 0.0
    white = white_point(layer, mask)
    # Cut off at white first: a division of the largest floats would overflow.
    cut = (np.minimum(one, white) * inside for one in (layer, estimated))
    truth, shown = (oiio.ImageBuf(coloured(one / white).astype(np.float32)) for one in cut)
    # The images are linear with values up to 1: with hdr=0 ꟻLIP does not search for exposures.
    difference = oiio.ImageBufAlgo.FLIP_diff(truth, shown, hdr=0, nthreads=1)
    if difference.has_error:
        raise RuntimeError(f"OpenImageIO's FLIP_diff failed: {difference.geterror()}")
    return float(np.asarray(difference.get_pixels(oiio.FLOAT))[inside].mean())
