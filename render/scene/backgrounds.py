"""Backgrounds of rendered objects: procedural textures, and crops of photographs.

A background is `(size, size, 3)` float32, sRGB-encoded, within [0, 1].

A procedural background is made in two steps. A pattern gives every pixel a number in [0, 1] (noise,
stripes, checks, cells, rings, clutter, often bent by noise); a palette gives each number a colour.
Two such textures are often mixed, and their brightness falls off to one side.

A varied background, to train on, is a picture of either kind, or the light's own map out of focus,
or two of these on both sides of a smooth border, each with a gain and a tint of its own.
"""

import functools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import picture_file, untrusted
from lime_keras.optics import colour, environment, shading

from .lights import Light

LARGEST = 2**27  # largest number of pixels of a picture: a panorama of 16,384 × 8,192
LEAST_SIDE = 8
"""Least number of pixels along either side of a picture; smaller pictures show nothing."""
_BLENDED = 0.4  # share of the varied backgrounds that blend two pictures
_SURROUNDED = 0.3  # share of those whose first picture is the light's map
_GAIN, _MAP_GAIN = (-0.7, 0.4), (-1.0, 1.0)
"""Stops; at 0 a map is as bright as it lights the object."""
_TINT, _MAP_TINT = 0.08, 0.2  # standard deviations of each channel's log gain; light is grey
_CONTRAST = 1.0, 12.0  # of a blend's border: from a gradual change to an edge
_LATTICE = 6  # nodes along each side of the smooth field that a blend's border follows
_FOCUS = (5, 9)
"""Powers of two, the last excluded: rows of the map as it is seen, 5.6° to 0.7° a texel."""


def procedural(rng: np.random.Generator, size: int) -> np.ndarray:
    """Make a random texture.

    Args:
        rng: The only source of randomness.
        size: Pixels along each side.

    Returns:
        `(size, size, 3)` float32, sRGB-encoded, within [0, 1].
    """
    colours = _texture(rng, size)
    if rng.random() < 0.4:
        share = _contrasted(_noise(rng, size, 3), rng.uniform(2, 30))[..., None]
        colours += share * (_texture(rng, size) - colours)
    x, y = _coordinates(size)
    slope = rng.normal(0, 0.3, 2).astype(np.float32)
    colours *= (1 + slope[0] * x + slope[1] * y)[..., None]
    if rng.random() < 0.3:
        colours += rng.normal(0, rng.uniform(0, 0.05), (size, size, 1)).astype(np.float32)
    return np.clip(colours, 0, 1, out=colours)


def photograph(path: str | Path, rng: np.random.Generator, size: int) -> np.ndarray:
    """Cut a random square out of a picture file, mirror it at times, and resize it.

    Args:
        path: Any picture that OpenImageIO reads; its numbers are taken as sRGB-encoded.
        rng: Source of randomness; the square's side is half to all of the picture's shorter side.
        size: Pixels along each side of the result.

    Returns:
        `(size, size, 3)` float32, sRGB-encoded, within [0, 1]; grey pictures get equal channels.

    Raises:
        ValueError: If the file is missing, cannot be read or is too small.
    """
    picture = read(path)[0]
    data = picture.roi  # the first pixel of a file need not be at (0, 0)
    width, height = data.width, data.height
    side = max(1, round(rng.uniform(0.5, 1.0) * min(width, height)))
    left = data.xbegin + int(rng.integers(width - side + 1))
    top = data.ybegin + int(rng.integers(height - side + 1))
    region = oiio.ROI(left, left + side, top, top + side)
    square = oiio.ImageBufAlgo.copy(oiio.ImageBufAlgo.cut(picture, region), oiio.FLOAT)
    # A large reduction uses the box filter: the default filter would take seconds.
    kernel = "box" if side > 2 * size else ""
    resized = oiio.ImageBufAlgo.resize(square, kernel, roi=oiio.ROI(0, size, 0, size))
    pixels = np.asarray(resized.get_pixels(oiio.FLOAT))
    pixels = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    if rng.random() < 0.5:
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(np.clip(pixels, 0, 1), np.float32)


def read(path: str | Path) -> tuple[oiio.ImageBuf, tuple[str, ...]]:
    """Read a picture file and turn it upright.

    Returns:
        The picture, in the file's own numbers, and notes on pixels that were replaced by black.

    Raises:
        ValueError: If the file is missing, cannot be read, or has fewer than `LEAST_SIDE` pixels
            along a side.
    """
    path = Path(path)
    untrusted.check(path, "a picture")
    with untrusted.naming(path, "a picture"):
        picture = picture_file.open_image(path)
        size = picture.spec().width, picture.spec().height, picture.spec().nchannels
        untrusted.check_size(path, *size, largest=LARGEST)
        if not picture.read(force=True):
            raise ValueError(f"{picture.geterror().strip()}; copy it again, or export it anew")
    spec = picture.spec()
    if min(spec.width, spec.height) < LEAST_SIDE:
        raise ValueError(
            f"{path}: is {spec.width}x{spec.height}, expected at least {LEAST_SIDE} pixels along "
            "either side; use a larger picture."
        )
    notes: tuple[str, ...] = ()
    if spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE):
        pixels = np.asarray(picture.get_pixels(oiio.FLOAT))
        if broken := int(np.sum(~np.isfinite(pixels).all(-1))):
            picture.set_pixels(oiio.ROI(), np.where(np.isfinite(pixels), pixels, 0))
            notes = (f"{broken} pixels that were not finite are black",)
    if 1 < picture.orientation <= 8:  # some cameras write 0
        picture = oiio.ImageBufAlgo.reorient(picture)
    return picture, notes


def varied(
    rng: np.random.Generator,
    size: int,
    picture: Callable[[], np.ndarray],
    surroundings: Callable[[], np.ndarray],
) -> np.ndarray:
    """Make a varied background.

    Args:
        rng: source of randomness.
        size: pixels along each side.
        picture: draws a picture `(size, size, 3)`, sRGB in [0, 1].
        surroundings: draws the light's map as the camera sees it, linear radiance
            `(size, size, 1)` (`surroundings`).

    Returns:
        `(size, size, 3)` float32, sRGB-encoded, within [0, 1].
    """

    def graded(linear: np.ndarray, gain: tuple[float, float], tint: float) -> np.ndarray:
        factor = np.exp(rng.normal(rng.uniform(*gain) * math.log(2), tint, 3))
        return np.clip(linear * factor.astype(np.float32), 0, 1)

    if rng.random() < _SURROUNDED:
        out = graded(surroundings(), _MAP_GAIN, _MAP_TINT)
    else:
        out = graded(colour.srgb_to_linear(picture()), _GAIN, _TINT)
    if rng.random() < _BLENDED:
        contrast = math.exp(rng.uniform(*np.log(_CONTRAST)))
        border = _spread(rng.normal(0, contrast, (_LATTICE, _LATTICE)), size)
        other = graded(colour.srgb_to_linear(picture()), _GAIN, _TINT)
        out += (0.5 + 0.5 * np.tanh(border / 2))[..., None] * (other - out)
    return np.clip(colour.linear_to_srgb(out), 0, 1).astype(np.float32)


def surroundings(
    rng: np.random.Generator, light: Light, rotation: np.ndarray, camera: np.ndarray, size: int
) -> np.ndarray:
    """Return the light's map as a camera sees it, more or less out of focus.

    Args:
        rng: source of randomness.
        light: the light.
        rotation: rotation `(3, 3)` from the map's frame to camera space.
        camera: fx, fy, cx, cy in pixels.
        size: pixels along each side.

    Returns:
        Linear radiance `(size, size, 1)` float32, at least 0.
    """
    energy = light.levels[min(2 ** int(rng.integers(*_FOCUS)), max(light.levels))].energy
    rays = -shading.view_directions(camera, size, size).reshape(-1, 3) @ rotation
    radiance = environment.lookup(energy / environment.solid_angles(*energy.shape), rays)
    return radiance.reshape(size, size, 1).astype(np.float32)


def _texture(rng: np.random.Generator, size: int) -> np.ndarray:
    pattern = PATTERNS[rng.integers(len(PATTERNS))]
    return _coloured(rng, pattern(rng, size))


# ---- palettes --------------------------------------------------------------------------------


def _coloured(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    """Map numbers in [0, 1] to a random palette of two to six colours, smooth or in flat steps."""
    count = int(rng.integers(2, 7))
    stops = _palette(rng, count)
    table = np.arange(256) / 255 * (count - 1)
    if rng.random() < 0.25:
        table = np.round(table)
    ramp = np.stack([np.interp(table, np.arange(count), channel) for channel in stops.T], 1)
    index = np.clip(values * 255, 0, 255).astype(np.uint8)
    return ramp.astype(np.float32)[index]


def _palette(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return `count` random colours that fit together: their hues lie around one or two hues."""
    hue = rng.random() + rng.normal(0, rng.choice([0.03, 0.1, 0.3]), count)
    hue += 0.5 * (rng.random(count) < rng.choice([0.0, 0.4]))
    vividness = np.clip(rng.normal(rng.choice([0.1, 0.3, 0.6]), 0.15, count), 0, 1)
    lightness = np.clip(rng.normal(rng.uniform(0.15, 0.8), rng.uniform(0.05, 0.3), count), 0, 1)
    wheel = 0.5 + 0.5 * np.cos(2 * np.pi * (hue[:, None] - [0, 1 / 3, 2 / 3]))
    return lightness[:, None] * (1 + vividness[:, None] * (1.6 * wheel - 1.1))


# ---- patterns: numbers in [0, 1] -------------------------------------------------------------


def _coordinates(size: int) -> tuple[np.ndarray, np.ndarray]:
    axis = np.linspace(-1, 1, size, dtype=np.float32)
    return np.broadcast_to(axis, (size, size)), np.broadcast_to(axis[:, None], (size, size))


def _spread(lattice: np.ndarray, size: int) -> np.ndarray:
    """Interpolate a lattice over the image by uniform cubic B-splines, which blur its cells."""
    rows, columns = (_spline_weights(count, size) for count in lattice.shape)
    return rows @ lattice.astype(np.float32) @ columns.T


@functools.lru_cache(64)
def _spline_weights(count: int, size: int) -> np.ndarray:
    """Return the weights `(size, count)` float32 of uniform cubic B-splines, for each pixel.

    The outermost of `count` nodes, at least 4, lie outside of the image.
    """
    position = np.linspace(1, count - 2, size)[:, None]
    d = np.abs(position - np.arange(count))
    near = 2 / 3 - d**2 + d**3 / 2
    return np.where(d < 1, near, np.maximum(2 - d, 0) ** 3 / 6).astype(np.float32)


def _contrasted(values: np.ndarray, gain: float) -> np.ndarray:
    """Map values to [0, 1] by a smooth step around their mean."""
    return 0.5 + 0.5 * np.tanh(np.float32(gain / 2) * (values - values.mean()))


def _noise(rng: np.random.Generator, size: int, cells: int) -> np.ndarray:
    """Return octaves of noise; each has cells half as wide, lower by a random factor."""
    persistence = rng.uniform(0.2, 0.75)
    total = np.zeros((size, size), np.float32)
    strength = 2.0
    while cells < size and strength > 0.05:
        total += np.float32(strength) * _spread(rng.normal(size=(cells + 3, cells + 3)), size)
        cells, strength = 2 * cells, strength * persistence
    return total


def _clouds(rng: np.random.Generator, size: int) -> np.ndarray:
    noise = _noise(rng, size, int(rng.integers(2, 20)))
    if rng.random() < 0.3:
        noise = np.abs(noise)  # ridges where it crosses zero
    return _contrasted(noise, rng.uniform(0.7, 5))


def _warped(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates x and y of the pixels, turned and often bent by noise."""
    x, y = _coordinates(size)
    angle = rng.uniform(0, 2 * np.pi)
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    x, y = c * x - s * y, s * x + c * y
    bend = np.float32(rng.choice([0.0, rng.uniform(0.01, 0.25)], p=(0.4, 0.6)))
    if bend:
        cells = int(rng.integers(1, 8))
        x, y = x + bend * _noise(rng, size, cells), y + bend * _noise(rng, size, cells)
    return x, y


def _wave(rng: np.random.Generator, phase: np.ndarray) -> np.ndarray:
    """Apply a random periodic profile (sine, saw or step) to phases given in periods."""
    kind = rng.choice(3)
    if kind == 0:
        return 0.5 + 0.5 * np.sin(np.float32(2 * np.pi) * phase)
    saw = phase - np.floor(phase)
    return saw if kind == 1 else _contrasted(saw - np.float32(rng.uniform(-0.3, 0.3)), 40)


def _stripes(rng: np.random.Generator, size: int) -> np.ndarray:
    x, _ = _warped(rng, size)
    return _wave(rng, x * np.float32(rng.uniform(1, 16)))


def _checks(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return tiles in two shades, or each in its own shade; rows may be shifted like bricks."""
    x, y = _warped(rng, size)
    across, down = np.exp(rng.uniform(np.log(1.5), np.log(10), 2))
    j = np.floor(y * np.float32(down)).astype(np.int32)
    shifted = x * np.float32(across) + rng.choice([0.0, 0.5]) * (j % 2)
    i = np.floor(shifted).astype(np.int32)
    if rng.random() < 0.5:
        return ((i + j) % 2).astype(np.float32)
    return rng.random((32, 32), np.float32)[i % 32, j % 32]


def _rings(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return rings around a point that may lie outside the image: wood, agate, ripples."""
    x, y = _warped(rng, size)
    centre = rng.uniform(-2.5, 2.5, 2).astype(np.float32)
    return _wave(rng, np.hypot(x - centre[0], y - centre[1]) * np.float32(rng.uniform(1.5, 12)))


def _marble(rng: np.random.Generator, size: int) -> np.ndarray:
    x, _ = _warped(rng, size)
    noise = _noise(rng, size, int(rng.integers(2, 6)))
    frequency, bend = rng.uniform((1, 0.5), (8, 3)).astype(np.float32)
    veins = np.abs(np.sin(frequency * x + bend * noise))
    return veins ** np.float32(rng.uniform(0.3, 1.5))


def _gradient(rng: np.random.Generator, size: int) -> np.ndarray:
    x, y = _warped(rng, size)
    return np.clip(0.5 + 0.35 * (x if rng.random() < 0.6 else np.hypot(x, y) * 1.4 - 1), 0, 1)


def _voronoi(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return Voronoi cells of random points: flat, domed, or separated by joints."""
    points = rng.uniform(-1.1, 1.1, (int(rng.integers(6, 28)), 2)).astype(np.float32)
    x, y = _warped(rng, size)
    nearest = np.full((size, size), 9, np.float32)
    second, owner = nearest.copy(), np.zeros((size, size), np.uint8)
    for k, (a, b) in enumerate(points):
        d = (x - a) ** 2 + (y - b) ** 2
        owner[d < nearest] = k
        second = np.minimum(second, np.maximum(nearest, d))
        nearest = np.minimum(nearest, d)
    kind = rng.choice(3)
    if kind == 0:
        return rng.random(len(points), np.float32)[owner]
    if kind == 1:
        return np.minimum(np.sqrt(nearest) * np.float32(np.sqrt(len(points)) / 2), 1)
    return np.clip((np.sqrt(second) - np.sqrt(nearest)) * np.float32(rng.uniform(3, 20)), 0, 1)


def _clutter(rng: np.random.Generator, size: int) -> np.ndarray:
    """Return boxes and discs on top of one another, out of focus."""
    coarse = int(np.exp(rng.uniform(np.log(24), np.log(128))))
    x, y = _coordinates(coarse)
    scene = np.full((coarse, coarse), rng.random(), np.float32)
    for _ in range(rng.integers(8, 40)):
        a, b = rng.uniform(-1.1, 1.1, 2)
        w, h = np.exp(rng.uniform(np.log(0.05), np.log(0.6), 2))
        u, v = np.abs(x - np.float32(a)) / np.float32(w), np.abs(y - np.float32(b)) / np.float32(h)
        scene[np.maximum(u, v) < 1 if rng.random() < 0.6 else u * u + v * v < 1] = rng.random()
    return np.clip(_spread(scene, size), 0, 1)


PATTERNS = (
    *(_clouds, _clutter, _clutter),  # clutter twice: photographs often have it in the background
    *(_stripes, _checks, _rings, _marble, _gradient, _voronoi),
)
