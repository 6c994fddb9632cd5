"""Cases for the camera law: what is drawn for a photo, from numbers at the ends of their range."""

import mpmath

from lime_keras.eval.stability.verdicts import Case
from lime_keras.optics import camera_law

from .. import curves
from ..precisions import ARRAYS, SINGLE, XLA

_LAW = {
    "exposure": (camera_law.exposure, lambda x: 2 ** (mpmath.mpf("0.5") * (2 * x - 1))),
    "full well": (camera_law.full_well, lambda x: 1000 * mpmath.mpf(30) ** x),
    "JPEG quality": (camera_law.quality, lambda x: 60 + 38 * x),
}
_NUMBERS = {"0": 0.0, "1e-30": 1e-30, "1/4": 0.25, "1/2": 0.5, "1 - 2^-24": 1 - 2.0**-24, "1": 1.0}


def cases() -> list[Case]:
    """Return the cases of the camera law."""
    return [
        case
        for name, (function, exact) in _LAW.items()
        for case in curves.cases(
            f"camera law: {name}", function, exact, _NUMBERS, (SINGLE, XLA, *ARRAYS)
        )
    ]
