"""The estimate of a stream of frames: one object's material, fused, and the light it is under."""

import dataclasses
import itertools
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lime_keras.estimate import framing, recomposition
from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.estimate.estimator import Estimator, View
from lime_keras.estimate.framing import Square
from lime_keras.lighting import guessed_light
from lime_keras.material import Caution, Material
from lime_keras.optics import colour, shading
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import Step, Tracker, material_of

_MATERIAL, _LAYERS = ("albedo", "exponent"), ("specular", "mirror")
"""Estimates of a frame, and those that it takes for its layers and light."""
_SHOWN = ("diffuse_albedo", "specular_albedo", "exponent")
_NUMBERS = (*_SHOWN, "exponent_bin_probabilities", "exponent_entropy")


_LIGHT_PIXELS = 64
"""Height and width to which a square is reduced for its light, which has 64 × 128 texels: more
pixels take four times as long, and move the light by less than the next frame does."""
_WARNED_EVERY = 10  # number of frames after which warnings are looked for without layers, too


@dataclass(frozen=True)
class FrameRequest:
    """The parts of a result that a frame asks for.

    Attributes:
        material: whether the material is estimated; else only the mask.
        layers: whether S and M are answered, and the warnings looked for; they take the material.
        light: whether the light is estimated; it takes the material.
        fusion: whether material and light are fused over the frames since the last cut.
    """

    material: bool = True
    layers: bool = True
    light: bool = True
    fusion: bool = True


@dataclass(frozen=True)
class FrameResult:
    """The result of one frame.

    Attributes:
        numbers: all but the images, ready for `json.dumps`.
        arrays: images by name: `mask` `(S, S)` uint8, 0 to 255; and those of these that were
            asked for, float32, linear radiance: `specular_shading` and `mirror` `(S, S)`, `light`
            `(64, 128)` in camera space.
    """

    numbers: dict[str, Any]
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


class Session:
    """A stream of frames and what is known of its object so far.

    The object is looked for in the square of the frame before, and in the whole frame when it is
    not there (`Estimator.look`).
    """

    def __init__(self, estimator: Estimator):
        self._estimator = estimator
        self.restart()

    def restart(self) -> None:
        """Forget all frames, because another stream begins."""
        self._tracker, self._light = Tracker(), Fusion()
        self._square: Square | None = None
        self._warnings: tuple[Caution, ...] = ()
        self._unwarned = _WARNED_EVERY

    def process(
        self, image_srgb: np.ndarray, mask: np.ndarray | None, request: FrameRequest
    ) -> FrameResult:
        """Estimate the next frame.

        Args:
            image_srgb: frame `(H, W, 3)`, uint8 sRGB.
            mask: coverage `(H, W)` uint8, 255 where the object is; None to find it.
            request: parts to estimate.

        Raises:
            ValueError: if the frame cannot be estimated.
        """
        # The object, and its material.
        laps, (height, width, _) = [("begin", time.perf_counter())], image_srgb.shape
        if mask is None:
            view = self._estimator.look(image_srgb, self._square)
            self._square = framing.following(view.mask, view.square, height, width)
        else:
            view = self._estimator.view(image_srgb, mask / np.float32(255))
            self._square = None
        laps.append(("framing_and_mask", time.perf_counter()))
        material = Material(mask_coverage=view.coverage, square=view.square)
        if request.material and material.mask_coverage:
            wanted = request.layers or request.light
            material = self._estimator.read(view, [*_MATERIAL, *(_LAYERS if wanted else ())])
            laps.append(("material", time.perf_counter()))

        # What is known of it since the last cut.
        # A stroke of a mask is no frame of the stream.
        seen = material if request.fusion else Material(mask_coverage=view.coverage)
        step = self._tracker.step(image_srgb, seen)
        fused = material_of(step.fused, self._estimator.gloss_calibration)
        if step.cut or np.isnan(step.fused).all():
            self._light = Fusion()
        if step.cut:
            self._square = None

        # The layers, the light and what may be wrong with them.
        arrays = {"mask": np.rint(255 * view.mask[..., 0]).astype(np.uint8)}
        estimated = request.material and step.found
        if request.layers:
            for name in set(material.layers) & {"specular_shading", "mirror"}:
                arrays[name] = _plain(material.layers[name][..., 0])
        warnings = [dataclasses.asdict(caution) for caution in self._doubts(view, step, request)]
        if request.light and estimated:
            try:
                arrays["light"] = self._lit(view, material, request.fusion)
            except ValueError as error:
                warnings.append({"code": "no-light", "message": f"no light was found: {error}"})
            laps.append(("light", time.perf_counter()))

        numbers = {
            "found": step.found,
            "cut": step.cut,
            "size": len(view.mask),
            "square": view.square,
            "mask_coverage": view.coverage,
            "mask_confidence": view.confidence,
            "material": _numbers(material, _NUMBERS) if estimated else None,
            "fused": (_numbers(fused, _SHOWN) or None) if request.fusion else None,
            "ms": _times(laps),
            "warnings": warnings,
        }
        return FrameResult(numbers, arrays)

    def _doubts(self, view: View, step: Step, request: FrameRequest) -> tuple[Caution, ...]:
        """Return the warnings of this frame, or of the last one in which they were looked for.

        They are of the whole frame's pixels, which takes as long as a network.
        """
        self._unwarned += 1
        if not step.found:
            self._warnings, self._unwarned = (NO_OBJECT,), _WARNED_EVERY
        elif request.material and (request.layers or self._unwarned >= _WARNED_EVERY):
            self._warnings, self._unwarned = self._estimator.doubts(view), 0
        elif not request.material:
            return ()
        return self._warnings

    def _lit(self, view: View, material: Material, fusion: bool) -> np.ndarray:
        """Return the light `(64, 128)`, fused if asked for."""
        height, width = view.photo.shape[:2]
        size, (top, left, side) = len(view.mask), view.square
        if lacking := {"specular_shading", "mirror"} - set(material.layers):
            raise ValueError(f"the model has no {' and no '.join(sorted(lacking))}")
        # What lies beyond the photo was not seen.
        mask = np.minimum(view.mask, 1) * framing.inside(view.square, height, width, size)
        layers = material.layers | {"mask": mask}
        small = {name: _reduced(layer) for name, layer in layers.items()}
        image = colour.linear_to_srgb(_reduced(colour.srgb_to_linear(view.image)))
        small["diffuse"] = recomposition.diffuse(
            image, small["mask"], small["specular_shading"], material
        )
        focal, _, x, y = shading.assumed_camera(height, width)
        camera = np.array([focal, focal, x - left, y - top]) * (len(image) / side)
        light = guessed_light.estimate(image, dataclasses.replace(material, layers=small), camera)
        return _plain(self._light.update(light) if fusion else light)


def _reduced(layer: np.ndarray) -> np.ndarray:
    """Return the means `(s, s, C)` of the areas of a layer `(S, S, C)`; s is 64 or a little more.

    A side that has no such divisor stays as it is.
    """
    size, channels = len(layer), layer.shape[-1]
    step = size // _LIGHT_PIXELS
    if step < 2 or size % step:
        return layer
    return layer.reshape(size // step, step, size // step, step, channels).mean(axis=(1, 3))


def _times(laps: list[tuple[str, float]]) -> dict[str, float]:
    """Return the times in ms of parts that end one after the other, and their `total`."""
    times = {name: 1000 * (end - begin) for (_, begin), (name, end) in itertools.pairwise(laps)} | {
        "total": 1000 * (time.perf_counter() - laps[0][1])
    }
    return {name: round(value, 1) for name, value in times.items()}


def _numbers(material: Material, names: tuple[str, ...]) -> dict[str, Any]:
    numbers = material.to_json()
    return {name: numbers[name] for name in names if name in numbers}


def _plain(values: np.ndarray) -> np.ndarray:
    """Return radiance as float32, with 0 for what is not known."""
    return np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
