"""Prints: paint of other colours on a part of an object, whose material and highlights stay.

The model has one material for each object; photographed ones bear labels, patterns and stains. The
subnetworks of the material learn from prints on a share of the objects that these are no
highlights, and that the split of the colours (`optics.dichromatic`) is false where colours meet.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lime_keras.data import clutter
from lime_keras.optics import camera_law, colour

_PRINTED, _MOTTLED = 0.1, 0.1
"""Shares of the objects with one to three prints, and with small changes of their diffuse albedo.
"""
_LEVELS = 0.2, 1.8
"""Least and largest level of the noise from which on there is a print: on 42 to 4 %."""
_BRIGHTEST = 0.9
"""Largest albedo of a print."""
_MOTTLING = 0.15
"""Largest standard deviation of the small changes, as a share of the albedo."""


def add(batch: Mapping[str, Any], generator: np.random.Generator) -> np.ndarray:
    """Return the photos of a batch with prints on the objects, `(B, S, S, 3)` sRGB in [0, 1].

    By Eq. 4 a print changes the light of a pixel by (m − m_d) · D, under the photo's own cast;
    pixels with a clipped channel stay.

    Args:
        batch: features of a batch by name: `image`, `mask`, `diffuse_shading`, `diffuse_albedo`
            and, of photos, `cast`.
        generator: source of all random numbers.
    """
    images = np.array(batch["image"], np.float32)
    for row, image in enumerate(images):
        own = np.asarray(batch["diffuse_albedo"][row], np.float32)
        change = _change(own, len(image), generator)
        if change is None:
            continue
        mask = np.asarray(batch["mask"][row])
        light = mask * np.asarray(batch["diffuse_shading"][row])
        if "cast" in batch:
            cast = np.asarray(batch["cast"][row])[None]
            light = light * camera_law.balance(cast, camera_law.places(len(image)))[0]
        linear = np.maximum(colour.srgb_to_linear(image) + change * light, 0)
        stays = (mask == 0) | (image.max(axis=-1, keepdims=True) >= colour.CLIPPED)
        images[row] = np.where(stays, image, colour.linear_to_srgb(np.minimum(linear, 1)))
    return images


def _change(own: np.ndarray, size: int, generator: np.random.Generator) -> np.ndarray | None:
    """Return the change of the albedo at each pixel `(S, S, 3)`, or None for none."""
    albedo = np.broadcast_to(own, (size, size, 3))
    is_mottled, is_printed = generator.random(2) < (_MOTTLED, _PRINTED)
    if not (is_mottled or is_printed):
        return None
    if is_mottled:
        noise = clutter.smooth_noise(size, generator)
        tint = 1 + 0.5 * generator.uniform(-1, 1, 3).astype(np.float32)
        albedo = albedo * np.maximum(1 + generator.uniform(0, _MOTTLING) * noise * tint, 0)
    if is_printed:
        for _ in range(generator.integers(1, 4)):
            part = clutter.pattern(size, generator, generator.uniform(*_LEVELS))
            paint = generator.uniform(0, _BRIGHTEST, 3).astype(np.float32)
            albedo = albedo + part * (paint - albedo)
    return (albedo - own).astype(np.float32)
