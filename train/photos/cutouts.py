"""Cut-outs: photographs of real things before photographed places, in linear light.

It is for SegmentationNet alone, whose encoder forgets photographs where it learns from renders
alone (docs/lab/masks.md). A cut-out is a picture of one thing whose alpha channel is
the thing's coverage. Nothing need be known of its material.
"""

import hashlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from OpenImageIO import ImageBufAlgo

from lime_keras.io import photo, scanner, untrusted
from lime_keras.optics import colour

from . import paint

_SUFFIXES = ".png", ".webp"  # ends of the pictures' names
_LEAST_SIDE, _LEAST_COLOURS = 64, 250
"""Least pixels along the longer side of a thing, and least colours: fewer are letters and signs."""
_COLOUR_STEP = 8  # steps of 255 that count as one colour
_OPAQUE = 0.97
"""Largest share of a picture that a thing covers; a picture without alpha is no cut-out."""
_EXTENT = 0.35, 1.05  # least and largest length of a thing's longer side, of the image's
_TURN = 0.35  # standard deviation of a thing's turn, in radians
_OFF_CENTRE = 0.1  # standard deviation of a thing's place, of the image's side
_PAPER = 0.2  # share of the things before white, black or grey paper
_SHADED = 0.5  # share of the things that cast a shadow on what is behind them
_BRIGHTNESS = 0.66
"""Standard deviation of the logarithm of a picture's gain of light: 0.3 of sRGB values."""


class Cutouts:
    """Photographs of things and of places, from which scenes of any number are composed.

    Args:
        things: folder of PNG or WebP pictures with alpha, at any depth. Letters, small pictures
            and those without alpha are left out.
        places: folder of PNG or WebP pictures, such as `lime-render views` takes.
        size: S, height and width of the scenes in pixels.

    Raises:
        FileNotFoundError: if either folder holds nothing of use.
        ValueError: if a picture cannot be read.
    """

    def __init__(self, things: Path, places: Path, size: int):
        self._size = size
        cut = (_thing(path, size) for path in _pictures(things))
        self._things = [thing for thing in cut if thing is not None]
        if not self._things:
            raise FileNotFoundError(
                f"{things} holds no cut-out: pass a folder of photographs of things, PNG or WebP, "
                f"of at least {_LEAST_SIDE} pixels, cut out by their alpha channel"
            )
        self._places = [_place(path, size) for path in _pictures(places)]

    def compose(self, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a scene of a thing, float32; all that is random is drawn from the generator.

        Returns:
            The thing's light, coverage × radiance `(S, S, 3)`; that of what is behind it,
            (1 − coverage) × radiance; and the coverage `(S, S, 1)` in [0, 1].
        """
        behind = self._behind(generator)
        thing = self._placed(generator)
        if generator.random() < _SHADED:
            behind = behind * (1 - _shadow(thing[..., 3:], generator))
        cover = thing[..., 3:]
        return thing[..., :3] * cover, behind * (1 - cover), cover

    def _behind(self, generator: np.random.Generator) -> np.ndarray:
        """Return the radiance of what is behind a thing, `(S, S, 3)`."""
        size = self._size
        if generator.random() < _PAPER:
            return paint.paper(size, generator)
        place = self._places[generator.integers(len(self._places))]
        top, left = generator.integers(0, np.subtract(place.shape[:2], size) + 1)
        out = colour.LEVELS[place[top : top + size, left : left + size]]
        out = out[:, ::-1] if generator.random() < 0.5 else out
        return out * np.float32(np.exp(generator.normal(0, _BRIGHTNESS)))

    def _placed(self, generator: np.random.Generator) -> np.ndarray:
        """Return a thing's radiance and coverage `(S, S, 4)`, turned, scaled, moved at random."""
        thing, size = self._things[generator.integers(len(self._things))], self._size
        height, width = thing.shape[:2]
        scale = generator.uniform(*_EXTENT) * size / max(height, width)
        angle = generator.normal(0, _TURN)
        right = scale * np.array([np.cos(angle), np.sin(angle)]) * generator.choice([-1, 1])
        down = scale * np.array([-np.sin(angle), np.cos(angle)])
        middle = size * (0.5 + generator.normal(0, _OFF_CENTRE, 2))
        corner = middle - right * width / 2 - down * height / 2
        matrix = (*right, 0.0, *down, 0.0, *corner, 1.0)
        warped = ImageBufAlgo.warp(
            oiio.ImageBuf(_light(thing)),
            tuple(float(number) for number in matrix),
            "triangle",
            roi=oiio.ROI(0, size, 0, size),
        )
        out = np.clip(np.asarray(warped.get_pixels(oiio.FLOAT)), 0, 1)
        gain = np.exp(generator.normal(0, _BRIGHTNESS)) / np.maximum(out[..., 3:], 1e-3)
        out[..., :3] *= gain
        return out


def sha256(things: Path, places: Path) -> str:
    """Return a hash of the names and bytes of all pictures of two folders.

    Raises:
        FileNotFoundError: if a folder holds no pictures.
    """
    digest = hashlib.sha256()
    for folder in (things, places):
        for path in _pictures(folder):
            digest.update(f"{path.relative_to(folder)} {untrusted.sha256(path)}\n".encode())
    return digest.hexdigest()


def _pictures(folder: Path) -> list[Path]:
    out = sorted(scanner.walk(folder, _SUFFIXES))
    if not out:
        raise FileNotFoundError(f"{folder} holds no PNG or WebP pictures: check --cutouts")
    return out


def _thing(path: Path, longest: int) -> np.ndarray | None:
    """Return a picture's thing, premultiplied `(H, W, 4)` uint8, or None if it is of no use."""
    spec = oiio.ImageBuf(str(path)).spec()
    if 0 < min(spec.width, spec.height) < photo.SMALLEST:
        return None
    image, alpha, _ = photo.load(path)
    if alpha is None or alpha.mean() > _OPAQUE:
        return None
    rows, columns = (np.flatnonzero((alpha > 0.5).any(axis=(axis, 2))) for axis in (1, 0))
    if not len(rows) or max(np.ptp(rows), np.ptp(columns)) < _LEAST_SIDE:
        return None
    pixels = np.round(255 * np.concatenate([image, alpha], axis=-1)).astype(np.uint8)
    whole = pixels[pixels[..., 3] == 255][:, :3].astype(np.int32) // _COLOUR_STEP
    colours = np.bincount(whole @ [2**10, 2**5, 1])
    if np.count_nonzero(colours) < _LEAST_COLOURS:
        return None
    pixels = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return _resized(pixels, min(1, longest / max(pixels.shape)))


def _place(path: Path, size: int) -> np.ndarray:
    """Return a picture of a place, `(H, W, 3)` uint8, its shorter side 1 to 1.5 times `size`."""
    pixels = np.round(255 * photo.load(path).image).astype(np.uint8)
    short = min(pixels.shape[:2])
    return _resized(pixels, np.clip(short, size, 1.5 * size) / short)


def _resized(pixels: np.ndarray, factor: float) -> np.ndarray:
    """Return a picture `(H, W, C)` uint8 at another size."""
    if factor == 1:
        return pixels
    height, width = (max(1, round(factor * side)) for side in pixels.shape[:2])
    kernel = "box" if factor < 0.5 else "triangle"
    region = oiio.ROI(0, width, 0, height)
    resized = ImageBufAlgo.resize(oiio.ImageBuf(pixels), kernel, roi=region)
    return np.asarray(resized.get_pixels(oiio.UINT8))


def _light(thing: np.ndarray) -> np.ndarray:
    """Return a thing's light, coverage × radiance, and coverage, `(H, W, 4)` float32."""
    cover = thing[..., 3:] / np.float32(255)
    straight = np.minimum(np.round(thing[..., :3] / np.maximum(cover, 1 / 255)), 255)
    return np.concatenate([colour.LEVELS[straight.astype(np.uint8)] * cover, cover], axis=-1)


def _shadow(cover: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return the share of light that a thing's soft shadow takes, `(S, S, 1)`."""
    size = len(cover)
    down, right = (int(n) for n in generator.normal(0, 0.05 * size, 2))
    margin = max(abs(down), abs(right))
    padded = np.pad(cover, ((margin, margin), (margin, margin), (0, 0)))
    moved = padded[margin - abs(down) :, margin - right :][:size, :size]
    soft = paint.blurred(moved, int(generator.integers(1, max(2, size // 12))))
    return soft * np.float32(generator.uniform(0.2, 0.8))
