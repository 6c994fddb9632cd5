"""One object's material through the frames of a video, and when it may be another's."""

import math
from dataclasses import dataclass

import numpy as np

from lime_keras.material import Material
from lime_keras.video.cuts import CutDetector
from lime_keras.video.fusion import Fusion

LOST_AFTER = 30
"""Frames in a row without an object, a second's, after which another object is expected."""

PARAMETERS = ("diffuse_r", "diffuse_g", "diffuse_b", "specular", "exponent")
"""What is fused, in the order of the arrays below; the exponent there by its log10."""


@dataclass(frozen=True)
class Step:
    """What is known after one frame.

    Attributes:
        found: whether there was an object.
        cut: whether a new scene begins.
        estimate: of this frame alone, `(5,)` as of `parameters`.
        fused: over the frames since the last restart, likewise; NaN if none had an object.
    """

    found: bool
    cut: bool
    estimate: np.ndarray
    fused: np.ndarray


class Tracker:
    """Follows one object through the frames, and notices when it may be another.

    A scene cut restarts the fusion; so do more than `LOST_AFTER` frames in a row without an object.
    During fewer the fused estimate is held.
    """

    def __init__(self) -> None:
        self._cuts = CutDetector()
        self._fusion = Fusion()
        self._lost = 0

    def step(self, image_srgb: np.ndarray, material: Material) -> Step:
        """Take in the next frame `(H, W, 3)` uint8 and its estimate."""
        cut, found = self._cuts.is_cut(image_srgb), is_found(material)
        self._lost = 0 if found else self._lost + 1
        if cut or self._lost > LOST_AFTER:
            self._fusion.restart()
        estimate = parameters(material)
        fused = self._fusion.update(estimate)
        return Step(found, cut, estimate, fused)


def is_found(material: Material) -> bool:
    """Whether an estimate is of anything."""
    return bool(material.mask_coverage)


def parameters(material: Material) -> np.ndarray:
    """What is fused of an estimate: m_d, m_s and log10 s, `(5,)` float64.

    NaN stands for what was not asked for, and for everything if no object was found.
    """
    # The exponent is fused by its logarithm: s is uncertain by factors, and the mean of 10 and 1000
    # should be 100. Not by the eight probabilities: their expected log10 s is linear in them, so
    # the average comes to the same, while medians of single probabilities no longer belong to one
    # distribution (when a frame's vote wanders from bin to bin all of them are 0), and a network
    # that regresses has none.
    if not is_found(material):
        return np.full(len(PARAMETERS), np.nan)
    diffuse = np.full(3, np.nan) if material.diffuse_albedo is None else material.diffuse_albedo
    specular = math.nan if material.specular_albedo is None else material.specular_albedo
    log_exponent = math.nan if material.exponent is None else math.log10(material.exponent)
    return np.array([*diffuse, specular, log_exponent], np.float64)


def material_of(fused: np.ndarray) -> Material:
    """The material of `(5,)` parameters; what is NaN becomes None."""
    *diffuse, specular, log_exponent = (float(value) for value in fused)
    return Material(
        diffuse_albedo=None if math.isnan(diffuse[0]) else np.array(diffuse, np.float32),
        specular_albedo=None if math.isnan(specular) else specular,
        exponent=None if math.isnan(log_exponent) else 10.0**log_exponent,
    )
