"""The eight symmetries of a square, applied to G-buffers before they are lit.

The turned and mirrored shape is another shape in the same light: up stays up. NumPy on the host,
on codes as they are stored, so nothing is rounded.
"""

from collections.abc import Mapping

import numpy as np

from lime_keras.optics import octahedral

SYMMETRIES = 8


def turned(gbuffer: Mapping[str, np.ndarray], which: np.ndarray) -> dict[str, np.ndarray]:
    """Turn and mirror the G-buffers of a batch, and the camera with them.

    Args:
        gbuffer: from `GeometryBank.read`: `coverage` `(B, S, S)`, `normal` `(B, S, S, 2)`
            octahedral codes, `spread` `(B, S, S)` and `camera` `(B, 4)`, fx, fy, cx, cy in pixels.
        which: 0 … 7, `(B,)`; first, bit 2 exchanges rows and columns, which takes (x, y) of
            camera space to (−y, −x); then bit 0 exchanges left and right, and bit 1 top and bottom.

    Returns:
        The same four arrays, of the same types.
    """
    size = gbuffer["coverage"].shape[1]
    out = {name: np.empty_like(gbuffer[name]) for name in ("coverage", "normal", "spread")}
    out["camera"] = gbuffer["camera"].copy()
    for index, bits in enumerate(which.tolist()):
        steps = (slice(None, None, -1 if bits & 2 else 1), slice(None, None, -1 if bits & 1 else 1))
        for name in ("coverage", "normal", "spread"):
            image = gbuffer[name][index]
            out[name][index] = (image.swapaxes(0, 1) if bits & 4 else image)[steps]
        normal, camera = out["normal"][index], out["camera"][index]
        if bits & 4:
            normal[:] = octahedral.LARGEST - normal[..., ::-1]
            camera[:] = camera[[1, 0, 3, 2]]
        for axis, bit in enumerate((1, 2)):
            if bits & bit:
                normal[..., axis] = octahedral.LARGEST - normal[..., axis]
                camera[2 + axis] = size - camera[2 + axis]
        normal *= (out["coverage"][index] > 0)[..., None]
    return out
