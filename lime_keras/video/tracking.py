"""The tracking of one object's material through a video, with a restart for another object."""

import math
from dataclasses import dataclass

import numpy as np

from lime_keras.material import Material
from lime_keras.optics.gloss import Calibration
from lime_keras.video.cuts import CutDetector
from lime_keras.video.fusion import Fusion

LOST_AFTER = 30
"""Number of frames in a row without an object, about a second, after which tracking restarts."""

PARAMETERS = ("diffuse_r", "diffuse_g", "diffuse_b", "specular", "exponent")
"""Names of the fused quantities, in the order of the arrays below; these hold log10 s."""


@dataclass(frozen=True)
class Step:
    """The state of the tracking after one frame.

    Attributes:
        found: whether the frame has an object.
        cut: whether a new scene begins with the frame.
        estimate: estimate of this frame alone, `(5,)` (see `parameters`).
        fused: estimate fused over the frames since the last restart, `(5,)`; NaN if none of them
            had an object.
    """

    found: bool
    cut: bool
    estimate: np.ndarray
    fused: np.ndarray


class Tracker:
    """A tracker of one object through the frames of a video.

    The fusion restarts after a scene cut, and after more than `LOST_AFTER` frames in a row without
    an object, because the next object may be another. During a shorter gap the fused estimate is
    kept.
    """

    def __init__(self) -> None:
        self._cuts = CutDetector()
        self._fusion = Fusion()
        self._lost = 0

    def step(self, image_srgb: np.ndarray, material: Material) -> Step:
        """Add the next frame `(H, W, 3)`, uint8 sRGB, and its estimate; return the new state."""
        cut, found = self._cuts.is_cut(image_srgb), bool(material.mask_coverage)
        self._lost = 0 if found else self._lost + 1
        if cut or self._lost > LOST_AFTER:
            self._fusion = Fusion()
        estimate = parameters(material)
        fused = self._fusion.update(estimate)
        return Step(found, cut, estimate, fused)


def parameters(material: Material) -> np.ndarray:
    """Return the quantities of an estimate to fuse: m_d, m_s and log10 s, `(5,)` float64.

    A quantity that was not estimated is NaN. If no object was found, all are NaN.
    """
    # The exponent is fused by its logarithm: s is uncertain by factors, and the mean of 10 and 1000
    # should be 100. The eight probabilities are not fused. Their expected log10 s is linear in
    # them, so the average would be the same. But medians of single probabilities are no longer a
    # distribution: if the winning class changes from frame to frame, all medians can be 0. And a
    # network that regresses the exponent has no probabilities.
    if not material.mask_coverage:
        return np.full(len(PARAMETERS), np.nan)
    diffuse = np.full(3, np.nan) if material.diffuse_albedo is None else material.diffuse_albedo
    specular = math.nan if material.specular_albedo is None else material.specular_albedo
    log_exponent = math.nan if material.exponent is None else math.log10(material.exponent)
    return np.array([*diffuse, specular, log_exponent], np.float64)


def material_of(fused: np.ndarray, calibration: Calibration) -> Material:
    """Return the material of parameters `(5,)` (see `parameters`); NaN becomes None.

    Args:
        fused: parameters.
        calibration: `Material.gloss_calibration` of the model that estimated them.
    """
    *diffuse, specular, log_exponent = (float(value) for value in fused)
    return Material(
        diffuse_albedo=None if math.isnan(diffuse[0]) else np.array(diffuse, np.float32),
        specular_albedo=None if math.isnan(specular) else specular,
        exponent=None if math.isnan(log_exponent) else 10.0**log_exponent,
        gloss_calibration=calibration,
    )
