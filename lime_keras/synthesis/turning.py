"""The eight symmetries of a square, applied to G-buffers before they are lit.

The turned and mirrored shape is another shape in the same light: up stays up. NumPy on the host,
on codes as they are stored, so nothing is rounded.
"""

from collections.abc import Mapping

import numpy as np

from lime_keras.optics import octahedral

SYMMETRIES = 8
_ROWS = {"coverage": 0, "share": 0, "normal": 1, "spread": 1}
"""Axis of the rows in the images of one scene, by name."""


def turned(gbuffer: Mapping[str, np.ndarray], which: np.ndarray) -> dict[str, np.ndarray]:
    """Turn and mirror the G-buffers of a batch, and the camera with them.

    Args:
        gbuffer: from `GeometryBank.read`: `coverage` and `share` `(B, S, S)`, `normal`
            `(B, 2, S, S, 2)` octahedral codes, `spread` `(B, 2, S, S)` and `camera` `(B, 4)`, fx,
            fy, cx, cy in pixels.
        which: 0 … 7, `(B,)`; first, bit 2 exchanges rows and columns, which takes (x, y) of
            camera space to (−y, −x); then bit 0 exchanges left and right, and bit 1 top and bottom.

    Returns:
        The same five arrays, of the same types.
    """
    size = gbuffer["coverage"].shape[1]
    out = {name: np.empty_like(gbuffer[name]) for name in _ROWS}
    out["camera"] = gbuffer["camera"].copy()
    for index, bits in enumerate(which.tolist()):
        for name, row in _ROWS.items():
            image = gbuffer[name][index]
            image = image.swapaxes(row, row + 1) if bits & 4 else image
            mirrored = [axis for axis, bit in ((row, 2), (row + 1, 1)) if bits & bit]
            out[name][index] = np.flip(image, mirrored)
        normal, camera = out["normal"][index], out["camera"][index]
        there = (normal != 0).any(axis=-1, keepdims=True)
        if bits & 4:
            normal[:] = octahedral.LARGEST - normal[..., ::-1]
            camera[:] = camera[[1, 0, 3, 2]]
        for axis, bit in enumerate((1, 2)):
            if bits & bit:
                normal[..., axis] = octahedral.LARGEST - normal[..., axis]
                camera[2 + axis] = size - camera[2 + axis]
        normal *= there
    return out
