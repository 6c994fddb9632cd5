"""The scenes of a video, each with one fused material, and their files.

A scene ends at a cut, and where an object was lost for so long that the fusion restarts. How sure
its estimate is, its frames say together.
"""

import dataclasses
from pathlib import Path

import numpy as np

from lime_keras.estimate import files, preview
from lime_keras.io import atomic, photo
from lime_keras.io.video_reader import Frame
from lime_keras.material import Caution, Material
from lime_keras.optics import shininess
from lime_keras.video.tracking import PARAMETERS, Step, material_of

OFTEN = 0.5
"""Share of a scene's frames with an object from which a frame's warning is the scene's.

The fusion takes medians, so what is true of fewer than half of the frames does not change it.
"""


class Scene:
    """A scene of a video, followed frame by frame.

    Attributes:
        number: number of the scene in the video, from 1; scenes without an object count.
        is_cut: whether it begins with a cut.
        start: time of the first frame in seconds since the video's first.
        end: time of the last frame in seconds.
        frames: number of frames.
        found: number of frames with an object.
        fused: fused parameters `(5,)` (`tracking.parameters`); all NaN if it has no object.
        image_srgb: the frame that shows the object largest, `(H, W, 3)` uint8 sRGB; once the scene
            has ended, None.
        preview: its preview, a PNG, once the scene has ended; None if it shows no object.
    """

    def __init__(self, number: int, *, is_cut: bool):
        self.number, self.is_cut = number, is_cut
        self.frames = self.found = 0
        self.start = self.end = 0.0
        self.fused = np.full(len(PARAMETERS), np.nan)
        self._largest = Material(mask_coverage=0.0)
        self.image_srgb: np.ndarray | None = None
        self.preview: bytes | None = None
        self._confidences: list[float] = []
        self._probabilities: list[np.ndarray] = []
        self._messages: dict[str, tuple[int, str]] = {}

    def add(self, frame: Frame, material: Material, step: Step) -> None:
        """Add the next frame, its estimate and the state of the tracking after it."""
        self.start = self.start if self.frames else frame.time
        self.end = frame.time
        self.frames, self.found = self.frames + 1, self.found + step.found
        if step.found:
            self._add_cautions(material)
        if np.isfinite(step.fused).any():
            self.fused = step.fused
        if (material.mask_coverage or 0) > (self._largest.mask_coverage or 0):
            layers = {name: one for name, one in material.layers.items() if name == "mask"}
            self._largest = dataclasses.replace(material, image_srgb=None, layers=layers)
            self.image_srgb = frame.image_srgb if layers else None

    def _add_cautions(self, material: Material) -> None:
        if material.mask_confidence is not None:
            self._confidences.append(material.mask_confidence)
        if material.exponent_bin_probabilities is not None:
            self._probabilities.append(material.exponent_bin_probabilities)
        for caution in material.warnings:
            count, _ = self._messages.get(caution.code, (0, ""))
            self._messages[caution.code] = count + 1, caution.message

    def close(self) -> None:
        """Draw the preview, and let go of frame and mask: a video may have hundreds of scenes."""
        if self.image_srgb is not None and np.isfinite(self.fused).any():
            sheet = preview.sheet(self.image_srgb / np.float32(255), self.material)
            self.preview = photo.encoded(Path("preview.png"), sheet)
        self._largest, self.image_srgb = dataclasses.replace(self._largest, layers={}), None

    @property
    def material(self) -> Material:
        """The fused material; until the scene ends, with the mask of `image_srgb`."""
        shown = self._largest
        mean = np.mean(self._probabilities, axis=0) if self._probabilities else None
        return dataclasses.replace(
            material_of(self.fused, shown.gloss_calibration),
            mask_coverage=shown.mask_coverage,
            mask_confidence=float(np.mean(self._confidences)) if self._confidences else None,
            exponent_bin_probabilities=mean,
            exponent_entropy=None if mean is None else float(shininess.entropy(mean)),
            warnings=self._warnings(),
            square=shown.square,
            layers=shown.layers,
        )

    def _warnings(self) -> tuple[Caution, ...]:
        """Return the warnings of at least `OFTEN` of the frames with an object, as last worded."""
        return tuple(
            Caution(code, f"in {count / self.found:.0%} of the frames, {last}")
            for code, (count, last) in self._messages.items()
            if count >= OFTEN * self.found
        )

    def to_json(self) -> dict[str, object]:
        """Return times, counts and the fused material's numbers, ready for `json.dumps`."""
        counts = {"scene": self.number, "start": round(self.start, 6), "end": round(self.end, 6)}
        counts |= {"frames": self.frames, "found": self.found}
        return counts | self.material.to_json()


class Scenes:
    """The scenes of a video, followed frame by frame.

    Attributes:
        every: all scenes so far, those without an object among them.
    """

    def __init__(self) -> None:
        self.every = [Scene(1, is_cut=False)]

    def add(self, frame: Frame, material: Material, step: Step) -> None:
        """Add the next frame, its estimate and the state of the tracking after it."""
        last = self.every[-1]
        is_lost = np.isfinite(last.fused).any() and not np.isfinite(step.fused).any()
        if step.cut or is_lost:
            last.close()
            self.every.append(Scene(last.number + 1, is_cut=step.cut))
        self.every[-1].add(frame, material, step)

    def with_objects(self) -> list[Scene]:
        """Return the scenes so far that have an object, the last one among them."""
        return [scene for scene in self.every if np.isfinite(scene.fused).any()]


def write(folder: Path, name: str, scenes: list[Scene]) -> list[str]:
    """Write each scene's material as a photo's (`files.write_formats`), and its preview.

    Returns:
        The names of the files, which begin with NAME, or of several scenes with NAME-scene-2.

    Raises:
        OSError: if a file cannot be written.
    """
    written = []
    for scene in scenes:
        own = name if len(scenes) == 1 else f"{name}-scene-{scene.number}"
        written += files.write_formats(folder, own, scene.material)
        scene.close()
        if scene.preview is not None:
            atomic.write(folder / f"{own}-preview.png", scene.preview)
            written.append(f"{own}-preview.png")
    return written
