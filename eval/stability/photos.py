"""Extreme photos: black, white, constant, with one odd pixel, chequered, and a 16-bit ramp."""

import numpy as np


def extreme_photos(side: int) -> dict[str, np.ndarray]:
    """Return extreme photos `(side, side, 3)`, sRGB in [0, 1], by name."""
    lit = np.zeros((side, side, 3))
    lit[side // 2, side // 3] = 1.0
    dark = 1 - lit
    board = np.indices((side, side)).sum(0) % 2 * np.ones((3, 1, 1))
    ramp = np.arange(side * side * 3).reshape(side, side, 3) % 65536 / 65535
    return {
        "black": np.zeros_like(lit),
        "white": np.ones_like(lit),
        "constant": np.full_like(lit, 0.5),
        "one pixel lit": lit,
        "one pixel dark": dark,
        "chequered": np.moveaxis(board, 0, -1),
        "in steps of 16 bits": ramp,
    }
