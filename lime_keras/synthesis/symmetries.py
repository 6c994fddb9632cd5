"""The eight symmetries of a square, applied to G-buffers before they are lit.

The turned and mirrored shape is another shape in the same light: up stays up. NumPy on the host,
on codes as they are stored, so nothing is rounded.
"""

from collections.abc import Mapping

import numpy as np

from lime_keras.optics.octahedral import LARGEST

SYMMETRIES = 8
"""Number of symmetries; they are numbered from 0, which changes nothing."""


def turned(gbuffer: Mapping[str, np.ndarray], which: np.ndarray) -> dict[str, np.ndarray]:
    """Turn and mirror the G-buffers of a batch, and the cameras with them.

    Args:
        gbuffer: five arrays as from `GeometryBank.read`: `coverage` and `share` `(B, S, S)`,
            `normal` `(B, 2, S, S, 2)` octahedral codes, 0 where there is no surface, `spread`
            `(B, 2, S, S)`, and `camera` `(B, 4)`, fx, fy, cx, cy in pixels.
        which: 0 … 7, `(B,)`; first, bit 2 exchanges rows and columns, which takes (x, y) of
            camera space to (−y, −x); then bit 0 exchanges left and right, and bit 1 top and bottom.

    Returns:
        The same five arrays, of the same types.
    """
    size = gbuffer["coverage"].shape[1]
    names = ("coverage", "share", "normal", "spread", "camera")
    out = {name: np.empty_like(gbuffer[name]) for name in names}
    codes, turned_codes = (part["normal"].view(np.uint32)[..., 0] for part in (gbuffer, out))
    for index, bits in enumerate(which.tolist()):
        for name in ("coverage", "share"):
            out[name][index] = _moved(gbuffer[name][index], bits)
        for surface in range(codes.shape[1]):
            place = index, surface
            out["spread"][place] = _moved(gbuffer["spread"][place], bits)
            turned_codes[place] = _moved(_reflected(codes[place], bits), bits)
        fx, fy, cx, cy = gbuffer["camera"][index]
        if bits & 4:
            fx, fy, cx, cy = fy, fx, cy, cx
        out["camera"][index] = fx, fy, size - cx if bits & 1 else cx, size - cy if bits & 2 else cy
    return out


def _moved(image: np.ndarray, bits: int) -> np.ndarray:
    """Return a view of an image `(S, S)` with its pixels where a symmetry takes them."""
    image = image.T if bits & 4 else image
    return image[:: -1 if bits & 2 else 1, :: -1 if bits & 1 else 1]


def _reflected(codes: np.ndarray, bits: int) -> np.ndarray:
    """Apply a symmetry to coded normals.

    Args:
        codes: pairs of octahedral codes, each pair as one number, `(S, S)` uint32; 0 where there is
            no surface, and 0 afterwards.
        bits: the symmetry.
    """
    if not bits:
        return codes
    exchanged = codes << 16 | codes >> 16 if bits & 4 else codes
    # A code c becomes `LARGEST` − c = c + `LARGEST` − 2 c where the axis is negated.
    negated = np.array([bool(bits & 4) != bool(bits & bit) for bit in (1, 2)], np.uint16)
    [largest], [chosen] = ((negated * np.uint16(n)).view(np.uint32) for n in (LARGEST, 0xFFFF))
    reflected = exchanged + largest - 2 * (exchanged & chosen)
    return reflected * (codes != 0)
