"""The scenes of a video, each with one fused material, and their files.

A scene ends at a cut, and where an object was lost for so long that the fusion restarts. How sure
its estimate is, its frames say together.
"""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lime_keras.estimate import files, preview
from lime_keras.io import photo
from lime_keras.io.video_reader import Frame
from lime_keras.material import Caution, Material
from lime_keras.video.tracking import Step, material_of

OFTEN = 0.5
"""Share of a scene's frames with an object from which a frame's warning is the scene's.

The fusion takes medians, so what is true of fewer than half of the frames does not change it.
"""


@dataclasses.dataclass
class Scene:
    """A scene with an object.

    Attributes:
        number: number of the scene in the video, from 1; scenes without an object count.
        start: time of the first frame in seconds since the video's first.
        end: time of the last frame in seconds.
        frames: number of frames.
        found: number of frames with an object.
        material: fused material, with the mask of the frame that shows the object largest.
        image_srgb: that frame, `(H, W, 3)` uint8 sRGB.
    """

    number: int
    start: float
    end: float
    frames: int
    found: int
    material: Material
    image_srgb: np.ndarray

    def to_json(self) -> dict[str, object]:
        """Return times, counts and the fused material's numbers, ready for `json.dumps`."""
        counts = {"scene": self.number, "start": round(self.start, 6), "end": round(self.end, 6)}
        counts |= {"frames": self.frames, "found": self.found}
        return counts | self.material.to_json()


class _Running:
    """The scene that is being followed: its counts, and the frame with the largest object."""

    def __init__(self, number: int, *, is_cut: bool):
        self.number, self.is_cut = number, is_cut
        self.frames = self.found = 0
        self.start = self.end = 0.0
        self.confidences: list[float] = []
        self.probabilities: list[np.ndarray] = []
        self.messages: dict[str, list[str]] = {}
        self.fused: np.ndarray | None = None
        self.largest: tuple[np.ndarray, Material] | None = None

    def add(self, frame: Frame, material: Material, step: Step) -> None:
        self.start = self.start if self.frames else frame.time
        self.end = frame.time
        self.frames, self.found = self.frames + 1, self.found + step.found
        if step.found:
            self._add_cautions(material)
        if np.isfinite(step.fused).any():
            self.fused = step.fused
        before = self.largest[1].mask_coverage if self.largest else 0
        if (material.mask_coverage or 0) > (before or 0):
            self.largest = frame.image_srgb, material

    def _add_cautions(self, material: Material) -> None:
        if material.mask_confidence is not None:
            self.confidences.append(material.mask_confidence)
        if material.exponent_bin_probabilities is not None:
            self.probabilities.append(material.exponent_bin_probabilities)
        for caution in material.warnings:
            self.messages.setdefault(caution.code, []).append(caution.message)

    def result(self) -> Scene | None:
        """Return the scene up to now, or None if it has no object."""
        if self.fused is None or self.largest is None:
            return None
        image, shown = self.largest
        material = dataclasses.replace(
            material_of(self.fused, shown.gloss_calibration),
            mask_coverage=shown.mask_coverage,
            mask_confidence=float(np.mean(self.confidences)) if self.confidences else None,
            exponent_bin_probabilities=np.mean(self.probabilities, axis=0)
            if self.probabilities
            else None,
            warnings=self._warnings(),
            square=shown.square,
            layers={name: layer for name, layer in shown.layers.items() if name == "mask"},
        )
        counts = self.number, self.start, self.end, self.frames, self.found
        return Scene(*counts, material, image)

    def _warnings(self) -> tuple[Caution, ...]:
        """Return the warnings of at least `OFTEN` of the frames with an object, as last worded."""
        return tuple(
            Caution(code, f"in {len(messages) / self.found:.0%} of the frames, {messages[-1]}")
            for code, messages in self.messages.items()
            if len(messages) >= OFTEN * self.found
        )


class Scenes:
    """The scenes of a video, followed frame by frame.

    Attributes:
        every: all scenes so far, those without an object among them.
    """

    def __init__(self) -> None:
        self.every = [_Running(1, is_cut=False)]

    def add(self, frame: Frame, material: Material, step: Step) -> None:
        """Add the next frame, its estimate and the state of the tracking after it."""
        last = self.every[-1]
        is_lost = last.fused is not None and not np.isfinite(step.fused).any()
        if step.cut or is_lost:
            self.every.append(_Running(last.number + 1, is_cut=step.cut))
        self.every[-1].add(frame, material, step)

    def with_objects(self) -> list[Scene]:
        """Return the scenes so far that have an object, the last one among them."""
        return [scene for one in self.every if (scene := one.result()) is not None]


def names(name: str, scenes: Iterable[Scene]) -> list[str]:
    """Return the beginning of the names of each scene's files: NAME, or of several NAME-scene-2."""
    numbers = [scene.number for scene in scenes]
    return [name] if len(numbers) == 1 else [f"{name}-scene-{number}" for number in numbers]


def write(folder: Path, name: str, scenes: list[Scene]) -> list[str]:
    """Write each scene's material as a photo's (`files.write_formats`), and its preview.

    Returns:
        The names of the files, which begin with `names`.

    Raises:
        OSError: if a file cannot be written.
    """
    written = []
    for scene, own in zip(scenes, names(name, scenes), strict=True):
        written += files.write_formats(folder, own, scene.material)
        if "mask" in scene.material.layers:
            sheet = preview.sheet(scene.image_srgb / np.float32(255), scene.material)
            photo.write(folder / f"{own}-preview.png", sheet)
            written.append(f"{own}-preview.png")
    return written
