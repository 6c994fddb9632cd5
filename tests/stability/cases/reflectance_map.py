"""Cases for the baseline's reflectance map under extreme lights."""

import functools
import math
from typing import Any

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome, joined
from lime_keras.optics import environment
from lime_keras.optics import reflectance_map as library

from ..lights import EXPONENTS, normaliser
from ..precisions import BRAIN, HALF, SINGLE, TENSORS, XLA, Precision

_SIZE = 17  # odd, so that the middle pixel shows the normal that faces the viewer
# Powers of two scale exactly, so that only overflow and underflow can cause errors.
_SCALES = {"radiance 1e-8": 2.0**-27, "radiance 1e8": 2.0**27}
_GRID = 0.02
"""Largest error of interpolation between rings 1.4° apart, as a share of a highlight's peak."""


def cases() -> list[Case]:
    """Return the cases of the reflectance map."""
    out = []

    def add(name: str, precision: Precision, measure: Any, *arguments: Any) -> None:
        measure = functools.partial(measure, precision, *arguments)
        out.append(Case("reflectance map", name, precision.name, measure))

    for precision in (SINGLE, XLA):
        for name, s in EXPONENTS.items():
            add(f"s = {name}, exactly 1 in a furnace at n = o", precision, _furnace, s)
        for name, s in list(EXPONENTS.items())[:4]:
            add(f"s = {name}, one texel", precision, _one_texel, s)
        for name, scale in _SCALES.items():
            add(name, precision, _scaled, scale)
        for value in (np.nan, np.inf):
            add(f"a {value} texel shows, in its own example alone", precision, _unsound, value)
        add("s = 1e6 counts as 1e3", precision, _beyond)
    for precision in TENSORS:
        add("black", precision, _black)
    # No training step differentiates the map, so its gradients are not tried under XLA.
    for precision in (SINGLE, HALF, BRAIN):
        add("gradients by the albedos and the ambient term", precision, _layers)
    return out


def _drawn(
    environment_map: Any, shininess: Any, diffuse_albedo: Any, specular_albedo: Any, ambient: Any
) -> Any:
    batch = {
        "environment": environment_map,
        "shininess": shininess,
        "diffuse_albedo": diffuse_albedo,
        "specular_albedo": specular_albedo,
        "ambient": ambient,
        "mask": np.zeros((1, _SIZE, _SIZE, 1)),
    }
    return library.true_reflectance_map(batch)


def _maps(
    precision: Precision, lights: list[np.ndarray], s: float, m_d: float = 0.0, m_s: float = 1.0
) -> np.ndarray:
    """Return the reflectance maps `(B, 17, 17, 3)` of a grey material under B lights."""
    return precision.value(_drawn, *_arguments(lights, s, m_d, m_s))


def _arguments(lights: list[np.ndarray], s: float, m_d: float, m_s: float) -> list[np.ndarray]:
    """Return the arguments of `_drawn` for a grey material under B lights."""
    count = len(lights)
    return [
        np.stack(lights)[..., None],
        np.full(count, s),
        np.full((count, 3), m_d),
        np.full(count, m_s),
        np.zeros(count),
    ]


def _uneven() -> np.ndarray:
    return np.random.default_rng(0).exponential(size=environment.STORED_SHAPE)


def _furnace(precision: Precision, s: float) -> Outcome:
    found = _maps(precision, [np.ones(environment.STORED_SHAPE)] * 3, s)
    return Outcome(Compared(found[:, _SIZE // 2, _SIZE // 2], 1.0, 1.0, _GRID / 2))


def _one_texel(precision: Precision, s: float) -> Outcome:
    """Compare a map with D + S by Eqs. 2 and 3, except where the light is near the horizon."""
    light = np.zeros(environment.STORED_SHAPE)
    row, column = 25, 70
    light[row, column] = 1000.0
    found = _maps(precision, [light] * 3, s, m_d=1.0)
    theta, phi = math.pi * (row + 0.5) / 64, 2 * math.pi * (column + 0.5) / 128
    i = np.array(
        [math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi)]
    )
    energy = 1000.0 * 2 * math.sin(theta) * math.sin(math.pi / 128) * (2 * math.pi / 128)
    half = i + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    centres = (2 * np.arange(_SIZE) + 1) / _SIZE - 1
    u, v = np.meshgrid(centres, -centres)
    n = np.stack([u, v, np.sqrt(np.maximum(1 - u**2 - v**2, 0))], axis=-1)
    constant = normaliser(s)
    peak = energy * (constant + 1 / math.pi)
    lit = (n @ i > 0) & (n @ half > 0)
    right = energy * (np.maximum(n @ i, 0) / math.pi)
    right += energy * constant * np.where(lit, np.maximum(n @ half, 0), 0) ** s * lit
    sure = (u**2 + v**2 <= 1) & (np.abs(n @ i) > 2 * math.pi / 64)
    return Outcome(Compared(found[0, ..., 0][sure], right[sure], right[sure], _GRID * peak))


def _scaled(precision: Precision, scale: float) -> Outcome:
    found = _maps(precision, [_uneven(), scale * _uneven(), _uneven()], 30.0, m_d=0.5)
    right = found[0] * scale
    return Outcome(Compared(found[1], right, right, precision.tolerance(right)))


def _unsound(precision: Precision, value: float) -> Outcome:
    broken = _uneven()
    broken[20, 40] = value
    found = _maps(precision, [_uneven(), broken, _uneven()], 30.0)
    alone = _maps(precision, [_uneven()] * 3, 30.0)
    on = np.broadcast_to(library.disc(_SIZE), alone[0].shape) > 0
    right = np.stack([alone[0], np.where(on, np.nan, found[1]), alone[2]])
    return Outcome(Compared(found, right, right, precision.tolerance(np.nan_to_num(right))))


def _beyond(precision: Precision) -> Outcome:
    found, right = (_maps(precision, [_uneven()] * 3, s) for s in (1e6, 1e3))
    return Outcome(Compared(found, right, right, 0.0))


def _black(precision: Precision) -> Outcome:
    found = _maps(precision, [np.zeros(environment.STORED_SHAPE)] * 3, 30.0, m_d=1.0)
    return Outcome(Compared(found, 0.0, 0.0, 0.0))


def _layers(precision: Precision) -> Outcome:
    """Try the gradients: a map is linear in m_d and m_s, so the maps of 1 are its derivatives."""
    light = [_uneven()] * 3
    found, gradients = precision.evaluate(_drawn, *_arguments(light, 30.0, 0.5, 0.5))
    # Like the library's function, the reference is in single precision for arguments of any type.
    rounded = [precision.rounded(light[0])] * 3
    matte, shiny = (_maps(SINGLE, rounded, 30.0, *ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
    slopes = [matte.sum((1, 2)), shiny.sum((1, 2, 3)), np.full(3, 3 * library.disc(_SIZE).sum())]
    pixels = 3 * _SIZE**2
    compared = [
        precision.compare(gradient, slope, slope, slope, terms=pixels)
        for gradient, slope in zip(gradients[2:], slopes, strict=True)
    ]
    right = (matte + shiny) / 2
    value = SINGLE.compare(found, right, right, right.max(), terms=pixels)
    return Outcome(value, joined(compared))
