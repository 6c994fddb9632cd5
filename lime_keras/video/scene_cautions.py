"""Cautions of a scene of a video, gathered from its frames: how sure its estimate is."""

import numpy as np

from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.material import Caution, Material

OFTEN = 0.5
"""Share of a scene's frames with an object from which a frame's warning is the scene's.

The fusion takes medians, so what is true of fewer than half of the frames does not change it.
"""


class SceneCautions:
    """A tally of the frames of one scene."""

    def __init__(self) -> None:
        self._found = 0
        self._confidences: list[float] = []
        self._probabilities: list[np.ndarray] = []
        self._messages: dict[str, list[str]] = {}

    def add(self, material: Material) -> None:
        """Add the estimate of a frame; one without an object does not count."""
        if not material.mask_coverage:
            return
        self._found += 1
        if material.mask_confidence is not None:
            self._confidences.append(material.mask_confidence)
        if material.exponent_bin_probabilities is not None:
            self._probabilities.append(material.exponent_bin_probabilities)
        for caution in material.warnings:
            self._messages.setdefault(caution.code, []).append(caution.message)

    @property
    def mask_confidence(self) -> float | None:
        """The mean confidence of the masks, in [0, 1]; None if no frame has one."""
        if not self._confidences:
            return None
        return sum(self._confidences) / len(self._confidences)

    @property
    def exponent_bin_probabilities(self) -> np.ndarray | None:
        """The mean probabilities of the eight classes `(8,)`; None if no frame has any."""
        if not self._probabilities:
            return None
        return np.mean(self._probabilities, axis=0)

    @property
    def warnings(self) -> tuple[Caution, ...]:
        """The warnings of at least half of the frames with an object, in the words of the last."""
        if not self._found:
            return (NO_OBJECT,)
        return tuple(
            Caution(code, f"in {len(messages) / self._found:.0%} of the frames, {messages[-1]}")
            for code, messages in self._messages.items()
            if len(messages) >= OFTEN * self._found
        )
