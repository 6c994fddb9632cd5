"""The law by which the light of each scene is drawn; no two scenes are lit alike.

A light is a random mixture of one to three maps of a bank, and of up to `LAMPS` lamps. D, S and M
are linear in the light, so the mixture is exact. The spherical mean of every light is
`environment.MEAN_RADIANCE`.

Maps. One, two or three (shares 0.65, 0.25, 0.10), each any of the allowed ones with the same
chance, mirrored left to right or not, and turned about its vertical by any number of columns that
leaves its strongest light in front. Their powers are uniform over all ways to divide the maps' part
of the light among them. A single map, as photographed, lights a quarter of the scenes.

Lamps. A scene is one of six settings (`_SETTINGS`), which say how many lamps are added, of which
kinds (`_KINDS`) and with which part of the power:

| setting  | share | lamps | part of the power | kinds                         |
|----------|-------|-------|-------------------|-------------------------------|
| maps     | 0.40  | 0     | 0                 |                               |
| canopies | 0.16  | 1–3   | 0.50–1.00         | canopies                      |
| lamps    | 0.14  | 1–6   | 0.05–0.80         | any                           |
| windows  | 0.10  | 1–3   | 0.10–0.90         | windows                       |
| studio   | 0.10  | 1–4   | 0.30–0.99         | soft boxes, strips, few lamps |
| night    | 0.10  | 1–4   | 0.50–0.99         | bulbs                         |

The number of lamps and their part of the power are uniform in these ranges; the power is divided
uniformly among them, as among maps. Radii and half lengths are log-uniform:

| kind     | half length, ° | width : length | edge      | elevation, ° | otherwise             |
|----------|----------------|----------------|-----------|--------------|-----------------------|
| bulb     | 0.5–3          | 1              | sharp     | −10–75       | a disc                |
| lamp     | 0.5–15         | 1              | sharp     | −10–75       | a disc                |
| window   | 5–25           | 0.4–1          | sharp     | −5–35        | upright; half of them |
|          |                |                |           |              | with bars             |
| soft box | 8–30           | 0.5–1          | soft      | −10–75       | half of them round    |
| strip    | 10–40          | 0.03–0.12      | sharp     | −10–75       | half of them tubes    |
| canopy   | 35–65          | 0.6–1          | soft      | −45–75       | as a sky, a ceiling,  |
|          |                |                |           |              | a wall; half round    |

So a light may be flatter than most skies (under a canopy) and harder than the sun (one bulb with
99 % of the power). The shares of the settings were chosen to cover the spread of photographed maps
in contrast and direction, and to reach beyond its hard end.

In front. The camera looks down or up by an angle in `environment.CAMERA_PITCH`, and the maps'
vertical is tilted by it. As in the paper, the strongest light lies in front of the object (z > 0 in
camera space): that of each map does, and the middle of each lamp. The pitch is drawn from those
angles at which every map can be turned so. Only 0.3 of the lamps after the first stand behind, as
rim lights: none gives more than a quarter of the energy to a texel of 11° that the strongest lamp
in front gives to one (a canopy, which is even over many texels, not more than 0.8 of it).

What may still be strongest behind: texels of a map with many lights that are nearly as strong (such
maps may also change which is strongest when they are turned), sums of several maps, the far part of
a wide lamp whose middle is in front, and a light at the zenith or the nadir if another map has its
own at the other pole. Of 600 lights drawn from 103 photographed maps, 40 rooms and 48 skies, 1 %
have their strongest texel of 11° behind.

All of a light follows from `NUMBERS` uniform numbers of its scene's generator.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lime_keras.optics import environment

from .lights import LightBank

MAPS = 3
"""Largest number of maps in a mixture."""
LAMPS = 6
"""Largest number of lamps added to a mixture."""
LAMP_PARTS = {
    "towards": slice(0, 3),
    "across": slice(3, 6),
    "half": slice(6, 8),
    "roundness": slice(8, 9),
    "softness": slice(9, 10),
    "bars_at": slice(10, 12),
    "bars_half": slice(12, 14),
    "power": slice(14, 15),
}
"""Parts of a lamp's 15 numbers; `LightDraw.lamps` says what they are."""
NUMBERS = 5 + 4 * MAPS + 13 * LAMPS
"""Uniform numbers that a scene's light follows from."""

_MAP_COUNTS = (0.65, 0.25, 0.1)
_SETTINGS = np.array(
    # Share of the scenes; lamps, from and to; part of the power, from and to.
    [
        (0.40, 0, 0, 0.00, 0.00),  # maps
        (0.16, 1, 3, 0.50, 1.00),  # canopies
        (0.14, 1, 6, 0.05, 0.80),  # lamps
        (0.10, 1, 3, 0.10, 0.90),  # windows
        (0.10, 1, 4, 0.30, 0.99),  # studio
        (0.10, 1, 4, 0.50, 0.99),  # night
    ]
)
_KINDS = np.array(
    # Half length and elevation in degrees, width : length, each from and to; share of round ones;
    # whether edges are soft; share with bars.
    [
        (0.5, 3, -10, 75, 1.00, 1.00, 1.0, 0, 0.0),  # bulb
        (0.5, 15, -10, 75, 1.00, 1.00, 1.0, 0, 0.0),  # lamp
        (5.0, 25, -5, 35, 0.40, 1.00, 0.0, 0, 0.5),  # window
        (8.0, 30, -10, 75, 0.50, 1.00, 0.5, 1, 0.0),  # soft box
        (10.0, 40, -10, 75, 0.03, 0.12, 0.5, 0, 0.0),  # strip
        (35.0, 65, -45, 75, 0.60, 1.00, 0.5, 1, 0.0),  # canopy
    ]
)
_WINDOW, _CANOPY = 2, 5
_KINDS_OF = np.array(
    # Share of each kind among the lamps of each setting.
    [
        (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        (0.2, 0.3, 0.1, 0.15, 0.15, 0.1),
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        (0.0, 0.1, 0.0, 0.6, 0.3, 0.0),
        (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]
)
_BEHIND = 0.3
"""Share of the lamps after the first that stand behind."""
_RIM, _RIM_CANOPY = 0.25, 0.8
"""Most energy that a rim light gives to a coarse texel, over what a lamp in front gives to one.

A small lamp in front may be divided among four texels; a canopy is even over many.
"""
_COARSE = (math.pi / 16) ** 2
"""Solid angle in steradians of the texels by whose energy the strongest light is told."""
_REACH = math.radians(15)
"""A lamp's middle is as far in front as its half length, or as this angle, whichever is less."""
_BARS = (0.02, 0.06)
"""Range of the half angle of a window's bars over the window's half length."""
_NO_BARS = -10.0
_SOFTEST = 1.6
"""Width of the softest edge over the smaller half length: the middle keeps its full radiance."""


class LightDraw(NamedTuple):
    """The light of a scene, as drawn; or those of a batch, with a batch axis before all others.

    A lamp is a rectangle or a disc in the plane that touches the unit sphere at the lamp's middle,
    seen from the sphere's centre. Lengths are measured in this plane (the tangent of the angle).

    Attributes:
        maps: indices of the maps in the bank, `(3,)` int32.
        weights: factor of each map as the bank stores it, `(3,)` float32, 0 where there are fewer
            maps. Over the bank's `scale`, it is the map's part of the light's spherical mean.
        shifts: columns by which each map is rolled to the right, `(3,)` int32, in [0, W).
        mirrored: whether each map is mirrored left to right, before it is rolled, `(3,)` bool.
        lamps: the lamps in the map's frame, `(6, 15)` float32, with these numbers (`LAMP_PARTS`):

            - towards: unit direction of the middle (3);
            - across: unit direction of the length, at a right angle to it (3);
            - half: half length and half width (2);
            - roundness: radius of the corners over the half width, 1 for discs and tubes;
            - softness: width of the edge, over which the radiance falls to 0;
            - bars_at: distance from the middle of the bars across the length and across the width,
              on both sides (2);
            - bars_half: half the angle that these bars take, in radians, the same all along a bar
              (2), far below 0 where there are none;
            - power: part of the light's spherical mean, 0 where there are fewer lamps.

        rotation: rotation from the map's frame to camera space, `(3, 3)` float32.
    """

    maps: np.ndarray
    weights: np.ndarray
    shifts: np.ndarray
    mirrored: np.ndarray
    lamps: np.ndarray
    rotation: np.ndarray


def draw(rngs: Sequence[np.random.Generator], bank: LightBank, allowed: np.ndarray) -> LightDraw:
    """Draw the lights of a batch of scenes.

    A scene's light depends on its own generator alone, not on the batch around it. A batch takes
    little longer than a scene.

    Args:
        rngs: the generator of each scene; `NUMBERS` uniform numbers are taken from each.
        bank: the maps.
        allowed: indices `(A,)` of the maps to choose from, at least one.

    Raises:
        ValueError: if no map is allowed.
    """
    if len(allowed) == 0:
        raise ValueError("no map to draw a light from; allow at least one")
    # Uniform numbers.
    batch = len(rngs)
    numbers = np.stack([rng.random(NUMBERS) for rng in rngs])
    count, setting, looking = numbers[:, :3].T
    which, weight, turn, flip = numbers[:, 3 : 3 + 4 * MAPS].reshape(batch, 4, MAPS).swapaxes(0, 1)
    number, part = numbers[:, 3 + 4 * MAPS : 5 + 4 * MAPS].T
    lamp_numbers = numbers[:, 5 + 4 * MAPS :].reshape(batch, 13, LAMPS).swapaxes(0, 1)

    # Maps, each turned so that its strong light has a direction drawn for it.
    maps = np.asarray(allowed)[(which * len(allowed)).astype(np.int64)]
    mirrored = flip < 0.5
    present = np.arange(MAPS) <= _chosen(count, np.array(_MAP_COUNTS))[:, None]
    strong = np.asarray(bank.strong_direction, np.float64)[maps]
    azimuth = np.arctan2(np.where(mirrored, -1.0, 1.0) * strong[..., 0], -strong[..., 2])
    polar = np.arccos(np.clip(strong[..., 1], -1, 1))
    pitch = _pitch(looking, np.where(present, polar, math.pi / 2))
    columns = bank.radiance.shape[-1]
    target = _in_front(turn, polar, pitch, np.zeros_like(polar), math.pi / columns)
    shifts = np.rint((target - azimuth) * (columns / (2 * math.pi))).astype(np.int64) % columns

    # Lamps.
    setting = _chosen(setting, _SETTINGS[:, 0])
    _, fewest, most, least, largest = _SETTINGS[setting].T
    lamp_count = (fewest + np.floor(number * (most - fewest + 1))).astype(np.int64)
    share = least + part * (largest - least)
    weights = _divided(weight, present) * (1 - share[:, None])
    lamps = _lamps(lamp_numbers, setting, lamp_count, share, pitch)
    lamps[..., LAMP_PARTS["power"]] *= environment.MEAN_RADIANCE

    # The camera's pitch.
    sine, cosine = np.sin(pitch), np.cos(pitch)
    rotation = np.zeros((batch, 3, 3), np.float32)
    rotation[:, 0, 0] = 1
    rotation[:, 1, 1] = rotation[:, 2, 2] = cosine
    rotation[:, 1, 2], rotation[:, 2, 1] = -sine, sine
    return LightDraw(
        maps=maps.astype(np.int32),
        weights=(weights * environment.MEAN_RADIANCE * bank.scale[maps]).astype(np.float32),
        shifts=shifts.astype(np.int32),
        mirrored=mirrored,
        lamps=lamps,
        rotation=rotation,
    )


def _lamps(
    numbers: np.ndarray,
    setting: np.ndarray,
    count: np.ndarray,
    share: np.ndarray,
    pitch: np.ndarray,
) -> np.ndarray:
    """Return the lamps of a batch, `(B, LAMPS, 15)` float32, whose powers add up to `share`."""
    kind, size, ratio, height, turn, roll, power, rounding, soft, side, *window_numbers = numbers
    # Shape: kind, size and edge of each lamp.
    kind = _chosen(kind, _KINDS_OF[setting][:, None])
    small, large, low, high, thin, thick, round_share, soft_edge, bar_share = np.moveaxis(
        _KINDS[kind], -1, 0
    )
    angle = np.radians(small * (large / small) ** size)
    half = np.tan(angle)
    width = half * thin * (thick / thin) ** ratio
    roundness = np.where(rounding < round_share, 1.0, 0.0)
    softness = np.where(soft_edge > 0, soft * _SOFTEST * width, 0.0)
    window = kind == _WINDOW
    # A window lies or stands; anything else may hang at any angle.
    roll = np.where(window, np.where(roll < 0.5, 0.0, math.pi / 2), roll * math.pi)

    # Power, the lamps behind limited to a rim.
    present = np.arange(LAMPS) < count[:, None]
    power = _divided(power, present)
    behind = (side < _BEHIND) & (np.arange(LAMPS) > 0)
    area = 4 * half * width - (4 - math.pi) * (roundness * width) ** 2
    seen = np.minimum(_COARSE / area, 1.0)
    brightest = np.max(np.where(behind, 0.0, power * seen), axis=1, keepdims=True)
    limit = np.where(kind == _CANOPY, _RIM_CANOPY, _RIM) * brightest / seen
    power = np.where(behind, np.minimum(power, limit), power)
    total = np.sum(power, axis=1, keepdims=True)
    power *= share[:, None] / np.where(total > 0, total, 1.0)

    # Place: uniform over the zone of the sphere.
    low, high = np.sin(np.radians(low)), np.sin(np.radians(high))
    up = low + height * (high - low)
    polar = np.arccos(up)
    azimuth = _in_front(turn, polar, pitch, np.minimum(angle, _REACH), 0.0)
    back = (2 * turn - 1) * _edge(polar, pitch, np.zeros_like(polar))
    azimuth = np.where(behind, back, azimuth)
    around, ahead, side_on = np.sin(polar), -np.cos(azimuth), np.sin(azimuth)
    towards = np.stack([around * side_on, up, around * ahead], axis=-1)
    level = np.stack([-ahead, np.zeros_like(up), side_on], axis=-1)
    upright = np.stack([-up * side_on, around, -up * ahead], axis=-1)
    across = np.cos(roll)[..., None] * level + np.sin(roll)[..., None] * upright

    # Bars of windows.
    barred, many, thickness = window_numbers
    bar = half * (_BARS[0] + thickness * (_BARS[1] - _BARS[0]))
    bar = np.where(barred < bar_share, bar, _NO_BARS)
    # One bar in the middle, or two, each way.
    two = np.stack([many < 0.5, many % 0.5 < 0.25], axis=-1)
    # Put together.
    lamps = np.zeros((*kind.shape, 15), np.float32)
    halves = np.stack([half, width], axis=-1)
    for name, values in {
        "towards": towards,
        "across": across,
        "half": halves,
        "roundness": roundness[..., None],
        "softness": softness[..., None],
        "bars_at": np.where(two, halves / 3, 0.0),
        "bars_half": bar[..., None],
        "power": power[..., None],
    }.items():
        lamps[..., LAMP_PARTS[name]] = values
    return lamps


def _chosen(number: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return the choice that each uniform number stands for; `shares` `(..., C)` add up to 1."""
    return np.sum(number[..., None] >= np.cumsum(shares, axis=-1)[..., :-1], axis=-1)


def _divided(number: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Divide 1 among those present, `(B, C)`, uniformly over all ways to divide it."""
    spacing = np.where(present, -np.log1p(-number), 0.0)
    # All numbers 0: the first gets all.
    spacing[:, 0] += np.where(present[:, 0] & (spacing.sum(axis=1) == 0), 1.0, 0.0)
    total = spacing.sum(axis=1, keepdims=True)
    return spacing / np.where(total > 0, total, 1.0)


def _pitch(number: np.ndarray, polar: np.ndarray) -> np.ndarray:
    """Draw the camera's pitch `(B,)` in radians, at which each map can have its light in front.

    A light near the zenith can be in front if the camera looks not too far up, and one near the
    nadir if it looks not too far down.

    Args:
        number: uniform numbers `(B,)`.
        polar: angle of each map's strongest light from the zenith, `(B, 3)`.
    """
    low, high = environment.CAMERA_PITCH
    low = np.maximum(low, -polar.min(axis=1))
    high = np.minimum(high, math.pi - polar.max(axis=1))
    return low + number * (high - low)


def _in_front(
    number: np.ndarray, polar: np.ndarray, pitch: np.ndarray, reach: np.ndarray, inset: float
) -> np.ndarray:
    """Draw azimuths `(B, C)` in radians at which directions lie in front after the tilt.

    z in camera space is sin p cos θ − cos p sin θ cos φ. If no azimuth does, the farthest ahead is
    taken.

    Args:
        number: uniform numbers `(B, C)`.
        polar: θ, `(B, C)`.
        pitch: p, `(B,)`.
        reach: angle by which a direction lies in front at least, `(B, C)`.
        inset: angle to stay away from the ends of the range, in radians.
    """
    edge = np.minimum(_edge(polar, pitch, reach) + inset, math.pi)
    return edge + number * (2 * math.pi - 2 * edge)


def _edge(polar: np.ndarray, pitch: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return the azimuth `(B, C)` in [0, π] beyond which directions lie in front by `reach`."""
    tilted = np.sin(pitch)[:, None] * np.cos(polar) - np.sin(reach)
    across = np.maximum(np.cos(pitch)[:, None] * np.sin(polar), 1e-9)
    return np.arccos(np.clip(tilted / across, -1, 1))
