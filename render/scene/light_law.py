"""The law of mixed lights: no two of them are alike.

A light is a random mixture of one to three environment maps, and of up to six lamps. D, S and M are
linear in the light, so the mixture is exact.

Maps. One, two or three (shares 0.65, 0.25, 0.10), each any map with the same chance, mirrored left
to right or not, and turned about its vertical by any angle that leaves its strongest light in front
(z > 0 in the mixture's frame). Their powers are uniform over all ways to divide the maps' part of
the light among them. A single map, as photographed, makes a quarter of the lights.

Lamps. A light has one of six settings (`_SETTINGS`), which say how many lamps are added, of which
kinds (`_KINDS`) and with which part of the power. The number of lamps and their part of the power
are uniform in these ranges; the power is divided uniformly among them, as among maps. Half lengths
are log-uniform.

So a light may be flatter than most skies (under a canopy) and harder than the sun (one bulb with
99 % of the power). The shares of the settings were chosen to cover the spread of photographed maps
in contrast and direction, and to reach beyond its hard end.

The middle of the first lamp lies in front, as the strongest light of each map does. Of the others,
a share of 0.3 stand behind, as rim lights: none gives more than a quarter of the energy to a texel
of 11° that the strongest lamp in front gives to one (a canopy, which is even over many texels, not
more than 0.8 of it).
"""

import math
from typing import NamedTuple

import numpy as np


class Lamp(NamedTuple):
    """A lamp: a rectangle or a disc in the plane that touches the unit sphere at its middle.

    Lengths are measured in this plane, seen from the sphere's centre (the tangent of the angle).

    Attributes:
        towards: unit direction of the middle, `(3,)`, in the light's frame.
        across: unit direction of the length, `(3,)`, at a right angle to `towards`.
        half: half length and half width.
        roundness: radius of the corners over the half width; 1 for discs and tubes.
        softness: width of the edge, over which the radiance falls to 0.
        bars_at: distance from the middle of the bars across the length and across the width, on
            both sides.
        bar: half the angle that a bar takes, in radians; 0 without bars.
        power: part of the light's spherical mean.
    """

    towards: np.ndarray
    across: np.ndarray
    half: tuple[float, float]
    roundness: float
    softness: float
    bars_at: tuple[float, float]
    bar: float
    power: float


class LightDraw(NamedTuple):
    """A light, as drawn; `mixing.mixed` makes its map. C is the number of its maps, 1 to 3.

    Attributes:
        maps: indices of the maps, `(C,)`.
        powers: part of each map in the light's spherical mean, `(C,)`.
        azimuths: azimuth in radians to which each map's strongest light is turned, `(C,)`.
        mirrored: whether each map is mirrored left to right first, `(C,)`.
        lamps: the lamps, none to six; their powers and those of the maps add up to 1.
    """

    maps: np.ndarray
    powers: np.ndarray
    azimuths: np.ndarray
    mirrored: np.ndarray
    lamps: tuple[Lamp, ...]


class _Kind(NamedTuple):
    """A kind of lamp: ranges of half length and elevation in degrees, and of width over length.

    `rounded` and `barred` are the shares of those with round corners and with bars.
    """

    half: tuple[float, float]
    elevation: tuple[float, float]
    ratio: tuple[float, float]
    rounded: float
    soft: bool = False
    barred: float = 0.0


class _Setting(NamedTuple):
    """A setting: its share, ranges of the lamps' number and power, and the shares of the kinds."""

    share: float
    lamps: tuple[int, int]
    power: tuple[float, float]
    kinds: dict[str, float]


_MAP_COUNTS = (0.65, 0.25, 0.1)
_KINDS = {
    "bulb": _Kind((0.5, 3), (-10, 75), (1.0, 1.0), rounded=1.0),
    "lamp": _Kind((0.5, 15), (-10, 75), (1.0, 1.0), rounded=1.0),
    "window": _Kind((5, 25), (-5, 35), (0.4, 1.0), rounded=0.0, barred=0.5),
    "soft box": _Kind((8, 30), (-10, 75), (0.5, 1.0), rounded=0.5, soft=True),
    "strip": _Kind((10, 40), (-10, 75), (0.03, 0.12), rounded=0.5),
    "canopy": _Kind((35, 65), (-45, 75), (0.6, 1.0), rounded=0.5, soft=True),
}
"""Round bulbs and lamps are discs, round strips tubes; a canopy is a sky, a ceiling or a wall."""
_ANY = {
    **{"bulb": 0.2, "lamp": 0.3, "window": 0.1},
    **{"soft box": 0.15, "strip": 0.15, "canopy": 0.1},
}
_SETTINGS = (
    _Setting(0.40, (0, 0), (0.0, 0.0), _ANY),  # maps alone
    _Setting(0.16, (1, 3), (0.5, 1.0), {"canopy": 1.0}),
    _Setting(0.14, (1, 6), (0.05, 0.8), _ANY),
    _Setting(0.10, (1, 3), (0.1, 0.9), {"window": 1.0}),
    _Setting(0.10, (1, 4), (0.3, 0.99), {"lamp": 0.1, "soft box": 0.6, "strip": 0.3}),  # a studio
    _Setting(0.10, (1, 4), (0.5, 0.99), {"bulb": 1.0}),  # night
)
_BEHIND = 0.3  # share of the lamps after the first that stand behind
_RIM, _RIM_CANOPY = 0.25, 0.8  # limits of their energy; a canopy is even over many texels
_COARSE = (math.pi / 16) ** 2
"""Solid angle in steradians of the texels that energies are compared in."""
_REACH = math.radians(15)  # a lamp's middle is as far in front as its half length, this at most
_BARS = (0.02, 0.06)  # range of the half angle of a window's bars over the window's half length
_SOFTEST = 1.6  # widest soft edge over the half width: the middle keeps its full radiance


def draw(rng: np.random.Generator, maps: int) -> LightDraw:
    """Draw a light.

    Args:
        rng: source of all randomness.
        maps: number of maps to choose from, at least 1.
    """
    count = 1 + int(rng.choice(len(_MAP_COUNTS), p=_MAP_COUNTS))
    setting = _SETTINGS[rng.choice(len(_SETTINGS), p=[setting.share for setting in _SETTINGS])]
    part = rng.uniform(*setting.power)
    return LightDraw(
        maps=rng.integers(maps, size=count),
        powers=(1 - part) * rng.dirichlet(np.ones(count)),
        azimuths=rng.uniform(math.pi / 2, 3 * math.pi / 2, count),
        mirrored=rng.random(count) < 0.5,
        lamps=_lamps(rng, setting, part),
    )


def _lamps(rng: np.random.Generator, setting: _Setting, part: float) -> tuple[Lamp, ...]:
    """Draw the lamps of a setting, whose powers add up to `part`."""
    count = int(rng.integers(setting.lamps[0], setting.lamps[1] + 1))
    if not count:
        return ()
    names = rng.choice(list(setting.kinds), count, p=list(setting.kinds.values()))
    behind = (rng.random(count) < _BEHIND) & (np.arange(count) > 0)
    powers = rng.dirichlet(np.ones(count))
    lamps = [_lamp(rng, str(name), back) for name, back in zip(names, behind, strict=True)]
    # Limit the lamps behind to a rim.
    in_texel = np.array([min(_COARSE / _area(lamp), 1.0) for lamp in lamps])
    brightest = np.max(powers * in_texel, where=~behind, initial=0.0)
    limit = np.where(names == "canopy", _RIM_CANOPY, _RIM) * brightest / in_texel
    powers = np.where(behind, np.minimum(powers, limit), powers)
    powers *= part / powers.sum()
    return tuple(
        lamp._replace(power=float(power)) for lamp, power in zip(lamps, powers, strict=True)
    )


def _lamp(rng: np.random.Generator, name: str, behind: bool) -> Lamp:
    """Draw the shape and the place of a lamp; its power is 0."""
    kind = _KINDS[name]
    # Shape.
    low, high = np.log(kind.half)
    angle = math.radians(math.exp(rng.uniform(low, high)))
    half = math.tan(angle)
    width = half * math.exp(rng.uniform(*np.log(kind.ratio)))
    rounded, barred = rng.random(2) < (kind.rounded, kind.barred)
    # One bar in the middle, or two, each way.
    bars_at = np.where(rng.random(2) < 0.5, (half / 3, width / 3), 0.0)
    # Place: uniform over the zone of the sphere.
    up = rng.uniform(*np.sin(np.radians(kind.elevation)))
    around = math.sqrt(max(1 - up * up, 0.0))
    # From the azimuth π/2 on a direction lies in front; `edge` is where it does by the reach.
    reach = 0.0 if behind else math.sin(min(angle, _REACH))
    edge = math.acos(max(-reach / max(around, 1e-9), -1.0))
    azimuth = rng.uniform(-edge, edge) if behind else rng.uniform(edge, 2 * math.pi - edge)
    ahead, side_on = -math.cos(azimuth), math.sin(azimuth)
    # A window lies or stands; anything else may hang at any angle.
    roll = rng.choice([0.0, math.pi / 2]) if name == "window" else rng.uniform(0, math.pi)
    level = np.array([-ahead, 0.0, side_on])
    upright = np.array([-up * side_on, around, -up * ahead])
    return Lamp(
        towards=np.array([around * side_on, up, around * ahead]),
        across=math.cos(roll) * level + math.sin(roll) * upright,
        half=(half, width),
        roundness=float(rounded),
        softness=rng.uniform(0, _SOFTEST) * width if kind.soft else 0.0,
        bars_at=(float(bars_at[0]), float(bars_at[1])),
        bar=half * rng.uniform(*_BARS) if barred else 0.0,
        power=0.0,
    )


def _area(lamp: Lamp) -> float:
    """Return the area of a lamp in its plane."""
    half, width = lamp.half
    return 4 * half * width - (4 - math.pi) * (lamp.roundness * width) ** 2
