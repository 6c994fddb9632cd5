"""The laws of materials: what section 5.1 of the paper draws for each scene, and a natural one.

Both draw s alike, so that every bin is as likely, and m_a. They differ in the albedos.

`uniform`, the paper's: m_d and m_s are uniform and do not depend on s. Half of these materials
reflect more light than they receive, and one in twenty has the specular albedo of a plastic.

`natural`: the kinds of materials that objects are made of, with the reflectances that they have in
the MERL database, where m_s goes with the kind, and most materials are dielectrics whatever their
gloss (docs/explanation/decisions.md). No material reflects more light than it receives.

| kind           | share, dull → glossy | m_s                                   | m_d              |
|----------------|----------------------|---------------------------------------|------------------|
| metal          | 0.05 → 0.17          | 0.25 – 0.95, uniform                  | grey, up to 0.08 |
| metallic paint | 0.05                 | 0.1 – 0.45, log-uniform               | a third of below |
| dielectric     | the others           | 0.045 within a factor 1.8 → 1.3,      | below            |
|                |                      | log-normal                            |                  |

Dull is s = 1, glossy s = 1000, and shares and factors are linear in log s between them. The m_d of
objects has any luminance up to 0.9 and the hue of a `uniform` m_d, whose saturation is reduced by a
uniform factor: grey, white and black are common, saturated colours are not.
"""

import math

import numpy as np

from lime_keras.optics import colour, shininess
from lime_keras.optics.blinn_phong import BlinnPhong

AMBIENT = (0.0, 0.05)  # range of m_a, linear radiance
UNIFORM, NATURAL = "uniform", "natural"
LAWS = (UNIFORM, NATURAL)  # names of the laws

_METAL, _METALLIC_PAINT = (0.05, 0.17), 0.05  # shares
_METALS_SPECULAR, _METALS_DIFFUSE = (0.25, 0.95), 0.08
_PAINTS_SPECULAR, _PAINTS_DIFFUSE = (0.1, 0.45), 1 / 3
_DIELECTRICS_SPECULAR, _FACTOR = 0.045, (1.8, 1.3)
_BRIGHTEST = 0.9
_TABLE = 1 << 14


def sample_material(rng: np.random.Generator, law: str = UNIFORM) -> BlinnPhong:
    """Draw a material.

    s is uniform over the bins and log-uniform inside a bin; m_a is uniform; the albedos follow the
    law.

    Args:
        rng: source of all randomness.
        law: one of `LAWS`.
    """
    exponent_bin = rng.integers(shininess.BIN_COUNT)
    log = shininess.LOG_LOW + shininess.BIN_WIDTH * (exponent_bin + rng.uniform())
    if law == NATURAL:
        diffuse, specular = _natural_albedos(rng, log)
    else:
        diffuse, specular = sample_diffuse_albedo(rng), float(rng.uniform())
    return BlinnPhong(
        diffuse_albedo=diffuse,
        specular_albedo=specular,
        exponent=float(10.0**log),
        ambient=float(rng.uniform(*AMBIENT)),
    )


def sample_diffuse_albedo(rng: np.random.Generator) -> np.ndarray:
    """Draw m_d, `(3,)` linear RGB in [0, 1], uniformly from the YUV colours that are RGB colours.

    Other YUV colours are rejected: if they were clipped, three quarters of all albedos would lie on
    the faces of the RGB cube.
    """
    while True:
        rgb = colour.yuv_to_rgb(rng.uniform(colour.YUV_LOW, colour.YUV_HIGH))
        if rgb.min() >= 0 and rgb.max() <= 1:
            return rgb


def natural_table(count: int = _TABLE) -> np.ndarray:
    """Return natural materials by growing log10 s, the same ones every time.

    Neighbours in the table have nearly the same s, so their albedos are draws for that s.

    Returns:
        `(count, 5)` float32: log10 s, evenly spaced; m_d, linear RGB; m_s.
    """
    rng = np.random.default_rng(0)
    logs = np.linspace(shininess.LOG_LOW, shininess.LOG_HIGH, count)
    rows = [
        (log, *diffuse, specular)
        for log in logs
        for diffuse, specular in [_natural_albedos(rng, log)]
    ]
    return np.array(rows, np.float32)


def _natural_albedos(rng: np.random.Generator, log: float) -> tuple[np.ndarray, float]:
    """Draw m_d `(3,)` and m_s of a natural material, given log10 s."""
    gloss = (log - shininess.LOG_LOW) / (shininess.LOG_HIGH - shininess.LOG_LOW)
    metal = _METAL[0] + (_METAL[1] - _METAL[0]) * gloss
    kind = rng.uniform()
    while True:
        if kind < metal:
            diffuse = np.full(3, rng.uniform(0.0, _METALS_DIFFUSE))
            specular = rng.uniform(*_METALS_SPECULAR)
        elif kind < metal + _METALLIC_PAINT:
            diffuse = _PAINTS_DIFFUSE * _natural_diffuse_albedo(rng)
            specular = math.exp(rng.uniform(*np.log(_PAINTS_SPECULAR)))
        else:
            diffuse = _natural_diffuse_albedo(rng)
            factor = _FACTOR[0] + (_FACTOR[1] - _FACTOR[0]) * gloss
            specular = _DIELECTRICS_SPECULAR * factor ** rng.normal()
        if diffuse.max() + specular <= 1:
            return diffuse, float(specular)


def _natural_diffuse_albedo(rng: np.random.Generator) -> np.ndarray:
    """Draw the m_d `(3,)` of an object's colour; luminance, linear, is uniform up to 0.9."""
    while True:
        yuv = colour.rgb_to_yuv(sample_diffuse_albedo(rng))
        yuv[1:] *= rng.uniform()
        yuv[0] = rng.uniform(0.0, _BRIGHTEST)
        rgb = colour.yuv_to_rgb(yuv)
        if rgb.min() >= 0 and rgb.max() <= 1:
            return rgb
