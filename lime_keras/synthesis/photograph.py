"""Photos of composed scenes, as `lime_keras.data.camera` takes them of stored ones.

Batches of scenes in `keras.ops`, on the device that trains. What is random was drawn before
(`scene_draws.draw`), so each photo follows from its own scene's draws.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from keras import ops

from lime_keras.optics import camera_law, colour
from lime_keras.synthesis import jpeg


def photograph(
    radiance: Any, scene: Mapping[str, Any], draws: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Photograph scenes, each with the camera that was drawn for it.

    Args:
        radiance: linear radiance of the whole image before the exposure, at least 0,
            `(B, S, S, 3)` float32; from `backdrop.compose`. S is a multiple of 16 if there are
            draws.
        scene: features of the batch, as in `lime_keras.data.pipeline`.
        draws: draws of the camera, of `scene_draws.draw`, each with a leading axis of B; by default
            the camera only clips and rounds, as in the records of a corpus.

    Returns:
        The scene with `image`, sRGB in multiples of 1/255, and `clipped`, 1 where the light,
        without the noise, saturates the sensor, both `(B, S, S, 3)`; with `cast` `(B, 4)`; and
        with its light (`camera_law.LIT`) scaled by the exposure.

    Raises:
        ValueError: if there are draws and S is no multiple of 16.
    """
    out = dict(scene)
    if draws is None:
        light = radiance
        out["cast"] = ops.zeros((light.shape[0], 4))
        levels = _levels(ops.clip(light, 0.0, 1.0))
    else:
        exposure = draws["exposure"]
        for name in filter(out.__contains__, camera_law.LIT):
            out[name] = out[name] * _each(exposure, len(out[name].shape))
        light = _defocused(radiance * _each(exposure), draws["defocus"])
        light = light * camera_law.balance(draws["cast"], camera_law.places(light.shape[1]))
        out["cast"] = draws["cast"]
        levels = _sensed(light, draws["full_well"], draws["grain"])
        photo = jpeg.compressed(levels, draws["quality"])
        levels = ops.where(_each(draws["compressed"]) > 0, photo, levels)
    out["clipped"] = ops.cast(light >= camera_law.SATURATED, "float32")
    out["image"] = levels / 255.0
    return out


def _each(values: Any, rank: int = 4) -> Any:
    """Return values `(B,)` as `(B, 1, …)` of a rank."""
    return ops.reshape(values, (-1, *(1,) * (rank - 1)))


def _defocused(light: Any, strength: Any) -> Any:
    """Blur light `(B, S, S, 3)` by circles of confusion of radii `strength` `(B,)` × the largest.

    The image is mirrored beyond its edges. A circle that fits into a pixel leaves the light as it
    is.
    """
    size = light.shape[1]
    largest = camera_law.CONFUSION * size
    reach = max(math.ceil(largest - 0.5), 0)
    if reach == 0:
        return light
    offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
    distances = np.hypot(*offsets.T)
    reached = distances < largest + 0.5
    disc = ops.clip(strength * largest + (0.5 - distances[reached, None]), 0.0, 1.0)
    disc = ops.cast(disc / ops.sum(disc, axis=0), "float32")
    corners = ops.convert_to_tensor((offsets[reached] + reach).astype(np.int32))
    padded = ops.pad(light, ((0, 0), (reach, reach), (reach, reach), (0, 0)), "symmetric")

    # In a loop, because XLA would compute the light anew for each of the disc's pixels.
    def add(pixel: Any, blurred: Any) -> Any:
        row, column = corners[pixel, 0], corners[pixel, 1]
        moved = ops.slice(padded, (0, row, column, 0), light.shape)
        return blurred + _each(disc[pixel]) * moved

    return ops.fori_loop(0, corners.shape[0], add, ops.zeros_like(light))


def _sensed(light: Any, full_well: Any, grain: Any) -> Any:
    """Return the sensor's images of linear radiance: noisy, clipped, 8-bit sRGB levels.

    The noise is added to the root of the radiance (`camera_law.READ_NOISE`).

    Args:
        light: linear radiance `(B, S, S, 3)`, at least 0.
        full_well: electrons at white, `(B,)`.
        grain: rows of `camera_law.grain_table`, `(B, n)` int32, with enough numbers for an image.

    Returns:
        Whole numbers 0 … 255, `(B, S, S, 3)` float32.
    """
    batch, *shape = light.shape
    full_well = _each(full_well)
    dark = camera_law.READ_NOISE**2 / full_well
    deviation = 0.5 / ops.sqrt(full_well)
    noise = ops.reshape(ops.take(camera_law.grain_table(), grain, axis=0), (batch, -1))
    noise = ops.reshape(noise[:, : math.prod(shape)], (batch, *shape))
    root = ops.sqrt(light + dark) + deviation * noise
    return _levels(ops.clip(ops.square(root) - dark - deviation**2, 0.0, 1.0))


def _levels(linear: Any) -> Any:
    """Return linear radiance in [0, 1] as 8-bit sRGB levels: whole numbers 0 … 255, float32."""
    return ops.floor(colour.linear_to_srgb(linear) * np.float32(255.0) + 0.5)
