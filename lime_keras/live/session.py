"""The estimate of a stream of frames: one object's material, fused, and the light it is under."""

import dataclasses
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lime_keras.estimate import framing, recomposition
from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.estimate.estimator import Estimator, View
from lime_keras.lighting import guessed_light
from lime_keras.material import Material
from lime_keras.optics import shading
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import Tracker, is_found, material_of

_SHOWN = ("diffuse_albedo", "specular_albedo", "exponent")
_NUMBERS = (*_SHOWN, "exponent_bin_probabilities", "exponent_entropy")


@dataclass(frozen=True)
class Wanted:
    """The parts of an answer that a frame asks for.

    Attributes:
        material: whether the layers S and M and the material are estimated; else only the mask.
        light: whether the light is estimated; it takes the material.
        fusion: whether material and light are fused over the frames since the last cut.
    """

    material: bool = True
    light: bool = True
    fusion: bool = True


@dataclass(frozen=True)
class Answer:
    """The answer to one frame.

    Attributes:
        numbers: all but the images, ready for `json.dumps`.
        arrays: images by name: `mask` `(S, S)` uint8, 0 to 255; and those of these that were
            estimated, float32, linear radiance: `specular_shading` and `mirror` `(S, S)`, `light`
            `(64, 128)` in camera space.
    """

    numbers: dict[str, Any]
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


class Session:
    """A stream of frames and what is known of its object so far.

    Args:
        estimator: estimator of single frames.
    """

    def __init__(self, estimator: Estimator):
        self._estimator = estimator
        self.restart()

    def restart(self) -> None:
        """Forget all frames, because another stream begins."""
        self._tracker, self._light = Tracker(), Fusion()

    def answer(self, image_srgb: np.ndarray, mask: np.ndarray | None, wanted: Wanted) -> Answer:
        """Estimate the next frame.

        Args:
            image_srgb: frame `(H, W, 3)`, uint8 sRGB.
            mask: coverage `(H, W)` uint8, 255 where the object is; None to find it.
            wanted: parts to estimate.

        Raises:
            ValueError: if the frame cannot be estimated.
        """
        # The object, and its material.
        watch = _Watch()
        view = self._estimator.view(image_srgb, None if mask is None else mask / np.float32(255))
        watch.lap("framing_and_mask")
        material = Material(mask_coverage=view.coverage, square=view.square)
        if wanted.material and is_found(material):
            material = self._estimator.read(view)
            told = self._estimator.place(view, material).warnings
            material = dataclasses.replace(material, warnings=told)
            watch.lap("material")

        # What is known of it since the last cut.
        step = self._tracker.step(image_srgb, material)
        fused = material_of(step.fused, material.gloss_calibration)
        if step.cut or np.isnan(step.fused).all():
            self._light.restart()

        # The layers, the light and what may be wrong with them.
        told = material.warnings if is_found(material) else (NO_OBJECT,)
        warnings = [dataclasses.asdict(caution) for caution in told]
        arrays = {"mask": np.rint(255 * view.mask[..., 0]).astype(np.uint8)}
        for name in ("specular_shading", "mirror"):
            if name in material.layers:
                arrays[name] = _plain(material.layers[name][..., 0])
        if wanted.light and material.layers:
            try:
                arrays["light"] = self._lit(view, material, image_srgb.shape, wanted.fusion)
            except ValueError as error:
                warnings.append({"code": "no-light", "message": f"no light was found: {error}"})
            watch.lap("light")

        numbers = {
            "found": step.found,
            "cut": step.cut,
            "size": len(view.mask),
            "square": view.square,
            "mask_coverage": view.coverage,
            "mask_confidence": view.confidence,
            "material": _numbers(material, _NUMBERS) if material.layers else None,
            "fused": (_numbers(fused, _SHOWN) or None) if wanted.fusion else None,
            "ms": watch.laps(),
            "warnings": warnings,
        }
        return Answer(numbers, arrays)

    def _lit(
        self, view: View, material: Material, shape: tuple[int, ...], fusion: bool
    ) -> np.ndarray:
        """Return the light `(64, 128)`, fused if asked for."""
        height, width = shape[:2]
        size, (top, left, side) = len(view.mask), view.square
        # What lies beyond the photo was not seen.
        mask = np.minimum(view.mask, 1) * framing.inside(view.square, height, width, size)
        specular = material.layers["specular_shading"]
        diffuse = recomposition.diffuse(view.image, view.mask, specular, material)
        seen = dataclasses.replace(
            material, layers=material.layers | {"mask": mask, "diffuse": diffuse}
        )
        focal, _, x, y = shading.assumed_camera(height, width)
        camera = np.array([focal, focal, x - left, y - top]) * (size / side)
        light = guessed_light.estimate(view.image, seen, camera)
        return _plain(self._light.update(light) if fusion else light)


class _Watch:
    """The times in ms of the parts of an estimate."""

    def __init__(self) -> None:
        self._begun = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        """Count the time since the last lap as that of a part."""
        now = time.perf_counter()
        self._laps[name], self._last = round(1000 * (now - self._last), 1), now

    def laps(self) -> dict[str, float]:
        """Return the times by part, and their `total`."""
        return self._laps | {"total": round(1000 * (time.perf_counter() - self._begun), 1)}


def _numbers(material: Material, names: tuple[str, ...]) -> dict[str, Any]:
    numbers = material.to_json()
    return {name: numbers[name] for name in names if name in numbers}


def _plain(values: np.ndarray) -> np.ndarray:
    """Return radiance as float32, with 0 for what is not known."""
    return np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
