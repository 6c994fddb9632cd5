"""Reading and writing of pictures, with OpenImageIO."""

import dataclasses
import functools
import io
import os
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import atomic, colour_space, picture_file, untrusted
from lime_keras.io.picture_file import Picture
from lime_keras.material import Caution
from lime_keras.optics import colour

if TYPE_CHECKING:
    from PIL import Image

LARGEST = 50_000_000  # largest number of pixels that a photo may have
FULL = 25_000_000
"""Largest number of pixels of a photo that is read at its full size.

An estimate takes some 100 bytes a pixel. A larger photo is read at half its width and height.
"""
SMALLEST = 16  # smallest number of pixels on a photo's shorter side; fewer show no object's shading
_LONGEST = 256
"""Largest ratio of a photo's sides; the networks would see a longer one less than a pixel wide."""
_BAND = 256  # rows of a picture that are converted at a time
_DIM, _FEWEST = 0.8, 16
"""Where alpha is below this part of the object's brightness, in at least so many pixels, colours
show whether they are multiplied by it."""


class PhotoWarning(UserWarning):
    """A warning of what may be wrong with a photo as it was read.

    Attributes:
        caution: what is wrong, with its code (`docs/reference/file-formats.md`).
    """

    def __init__(self, caution: Caution, path: str | Path):
        super().__init__(f"{path}: {caution.message}")
        self.caution = caution


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Read a photo of any kind, and its alpha channel if that masks a part of it.

    A file is what its content says, whatever its name. Its colours are converted to sRGB from what
    the file says about them (`colour_space`): profiles, code points, chromaticities and gamma.
    OpenEXR, Radiance and PFM hold radiance; it is clipped at 1. A grey channel is repeated,
    palettes and CMYK become RGB, the orientation is applied, and of a file with several pages the
    first is read; of an OpenEXR the layer without a name, or called RGBA or Combined, or the only
    one, in its display window. Transparent pixels are composed over black. Alpha that is nowhere
    at least one half, or the same everywhere, masks nothing, and is ignored. A photo of more than
    `FULL` pixels is read at half its width and height, or a smaller whole part of them, averaged in
    linear light. A `PhotoWarning` says what of this may be wrong.

    Returns:
        image: `(H, W, 3)` float32 sRGB in [0, 1].
        alpha: `(H, W, 1)` float32 in [0, 1]; None if it masks nothing.

    Raises:
        ValueError: if the file is missing, not a picture, empty, or holds NaN or infinity; also if
            it is smaller than `SMALLEST` or larger than `LARGEST`, cut short, of layers of which
            none is the picture, or whatever its decoder raises.
        MemoryError: if it does not fit into memory; the message names it, too.
    """
    image, alpha, cautions = load(path)
    for caution in cautions:
        warnings.warn(PhotoWarning(caution, path), stacklevel=2)
    return image, alpha


class Photo(NamedTuple):
    """A photo as it was read: see `read`; what may be wrong is in `cautions`."""

    image: np.ndarray
    alpha: np.ndarray | None
    cautions: tuple[Caution, ...] = ()


def load(path: str | os.PathLike[str]) -> Photo:
    """Read a photo as `read` does, and return what may be wrong instead of warning."""
    path = Path(path)
    picture = _opened(path)
    factor = _factor(picture.height, picture.width)
    image, alpha, cautions = _read(path, picture, factor)
    if factor > 1:
        cautions += (
            Caution(
                "reduced",
                f"it has {picture.width}×{picture.height} pixels, more than the "
                f"{FULL // 10**6} million that are worked on at full size: it is read at "
                f"{image.shape[1]}×{image.shape[0]}, and so are its layers",
            ),
        )
    return Photo(image, alpha, cautions)


def load_pil(image: "Image.Image") -> Photo:
    """Return the pixels of a PIL image as `load` returns those of its file.

    Its orientation and what it brings of its colours are applied. The code points of a PNG are read
    from the file that the image names, as Pillow does not keep them.

    Args:
        image: image of 8 bits a channel, of any mode.

    Raises:
        ValueError: if the image is empty or cut short, or has a mode of more bits, whose range is
            not known.
    """
    if image.mode.startswith(("I", "F")):
        raise ValueError(
            f"a PIL image of mode {image.mode} has no known range: pass its path, or an array of "
            "floats in [0, 1]"
        )
    if 0 in image.size:
        raise ValueError("a PIL image without pixels shows nothing: check how it was made")
    named = Path("a PIL image")
    with untrusted.naming(named, "a picture"):
        picture = picture_file.of_image(image)
    return _read(named, picture, 1)


def read_srgb(path: str | Path) -> np.ndarray:
    """Read a photo as `(H, W, 3)` float32 sRGB in [0, 1], without its alpha channel.

    Raises:
        ValueError: if the photo cannot be read (see `read`).
    """
    return read(path)[0]


def read_mask(path: str | os.PathLike[str], height: int, width: int) -> np.ndarray:
    """Read the mask of an object from a picture that is white where the object is.

    The mask is the mean of the picture's channels, or its alpha channel if it has one; its photo
    has `height` × `width` pixels.

    Returns:
        Coverage `(height, width, 1)` float32 in [0, 1].

    Raises:
        ValueError: if the picture cannot be read (see `read`), has another size than the photo, or
            is nowhere brighter than half.
    """
    mask = read_coverage(path, height, width)
    if not np.any(mask >= 0.5):
        raise ValueError(f"{path} is nowhere white, so it masks no object: paint the object white")
    return mask


def read_coverage(path: str | os.PathLike[str], height: int, width: int) -> np.ndarray:
    """Read a mask as `read_mask` does; a black picture, in which no object was found, is taken.

    Raises:
        ValueError: if the picture cannot be read (see `read`) or has another size than the photo.
    """
    path = Path(path)
    # Coverage is no colour: it has no curve and no profile.
    picture = dataclasses.replace(_opened(path), conversion=colour_space.IDENTITY)
    is_full = (picture.height, picture.width) == (height, width)
    factor = 1 if is_full else _factor(picture.height, picture.width)
    image, alpha, _ = _read(path, picture, factor, is_coverage=True)
    mask = image.mean(-1, keepdims=True) if alpha is None else alpha
    check_fits(path, "a mask", mask.shape, height, width)
    return mask


def check_fits(path: Path, what: str, shape: tuple[int, ...], height: int, width: int) -> None:
    """Raise ValueError if what lies in a file has another height and width than its photo."""
    if shape[:2] != (height, width):
        raise ValueError(
            f"{path} has {shape[1]}×{shape[0]} pixels and its photo {width}×{height}: {what} must "
            "have its photo's size"
        )


def read_radiance(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read a grey layer of linear radiance, of a photo's size, from an OpenEXR of one channel.

    Returns:
        Linear radiance `(height, width, 1)` float32, the numbers of the file: at least 0, without
        an upper limit.

    Raises:
        ValueError: if the file cannot be read (see `read`), is no OpenEXR, has several channels or
            another size than the photo, or holds numbers that are negative or not finite.
    """
    path = Path(path)
    picture = _opened(path)
    if not picture.is_radiance:
        raise ValueError(f"{path} is no OpenEXR: write linear radiance as one")
    check_fits(path, "a layer", (picture.height, picture.width), height, width)
    with untrusted.naming(path, "a picture"):
        values = picture.rows(0, height)
    if values.shape[-1] != 1:
        raise ValueError(f"{path} has {values.shape[-1]} channels: a grey layer has one")
    if not np.isfinite(values).all():
        raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
    if np.min(values) < 0:
        raise ValueError(f"{path} holds {np.min(values):.3g}: radiance is at least 0, so clip it")
    return values


def _opened(path: Path) -> Picture:
    """Open and decode a picture of any size and kind."""
    untrusted.check(path, "a picture")
    with untrusted.naming(path, "a picture"):
        return picture_file.open_picture(path, functools.partial(_check_size, path))


def _read(path: Path, picture: Picture, factor: int, *, is_coverage: bool = False) -> Photo:
    """Return sRGB `(H, W, 3)` in [0, 1], alpha `(H, W, 1)` or None, and what may be wrong.

    The picture is converted in bands of rows, so that its floats are in memory only once. Areas of
    `factor` × `factor` pixels are averaged to a pixel.
    """
    height, width = -(-picture.height // factor), -(-picture.width // factor)
    with untrusted.naming(path, "a picture"):
        is_mask, is_multiplied = _alpha_of(picture)
        image = np.empty((height, width, 3), np.float32)
        alpha = np.empty((height, width, 1), np.float32) if is_mask else None
        for top in range(0, height, _BAND):
            first, last = top * factor, min((top + _BAND) * factor, picture.height)
            values = picture.rows(first, last)
            colours = picture.conversion.convert(values[..., picture.colours])
            opacity = None if picture.alpha is None else values[..., [picture.alpha]]
            if not (np.isfinite(colours).all() and (opacity is None or np.isfinite(opacity).all())):
                raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
            colours = np.clip(colours, 0, 1)
            if alpha is not None and opacity is not None:
                if not is_multiplied:
                    colours = _multiplied(colours, opacity, picture.most)
                alpha[top : top + _BAND] = _averaged(np.clip(opacity, 0, 1), factor)
            if is_coverage:
                colours = _averaged(colours, factor)
            elif factor > 1:
                mean = _averaged(colour.srgb_to_linear(colours), factor)
                colours = np.clip(colour.linear_to_srgb(mean), 0, 1)
            image[top : top + _BAND] = colours
    cautions = picture.cautions
    if picture.alpha is not None and not is_mask and not is_multiplied:
        cautions += (_IGNORED_ALPHA,)
    return Photo(image, alpha, cautions)


_IGNORED_ALPHA = Caution(
    "alpha-ignored",
    "its transparency masks no object, as no part of it is opaque or all of it is alike, and is "
    "ignored: pass a mask if the object should be cut out",
)


def _alpha_of(picture: Picture) -> tuple[bool, bool]:
    """Return whether a picture's alpha masks an object, and whether it is applied already.

    Alpha of which no pixel is opaque by half, or all are alike, is no mask; if all are opaque,
    nothing is transparent, and it counts as applied.
    """
    if picture.alpha is None:
        return False, True
    least, largest, brightness, opaque, is_hidden = np.inf, -np.inf, 0.0, 0, True
    for values, alpha in _with_alpha(picture):
        least, largest = min(least, float(alpha.min())), max(largest, float(alpha.max()))
        whole = alpha >= 1
        opaque += int(np.count_nonzero(whole))
        brightness += float(values.max(-1).sum(where=whole, dtype=np.float64))
        is_hidden &= not values[alpha <= 0].any()
    if not np.isfinite([least, largest]).all() or least >= 1:
        return False, True  # what is not finite is refused elsewhere
    if largest < 0.5 or least == largest:
        return False, False
    if picture.is_multiplied or not (opaque and is_hidden):
        return True, picture.is_multiplied
    # Programs that cut objects out may write colours multiplied by alpha: at the soft edges none is
    # brighter than its alpha, even where the object is.
    dim, brighter = 0, 0
    for values, alpha in _with_alpha(picture):
        edge = (alpha > 0) & (alpha < _DIM * brightness / opaque)
        dim += int(np.count_nonzero(edge))
        brighter += int(np.count_nonzero(values.max(-1)[edge] > alpha[edge] + 1.5 / 255))
    return True, dim >= _FEWEST and brighter == 0


def _with_alpha(picture: Picture) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield bands of a picture's colours `(h, W, C)`, as in its file, and of its alpha `(h, W)`."""
    for top in range(0, picture.height, _BAND):
        values = picture.rows(top, min(top + _BAND, picture.height))
        yield values[..., picture.colours], values[..., picture.alpha]


def _multiplied(colours: np.ndarray, alpha: np.ndarray, most: int) -> np.ndarray:
    """Return sRGB colours times alpha, rounded to a file's integers, of which `most` is largest."""
    product = colours * alpha
    if not most:
        return product
    return np.floor(product * np.float32(most) + np.float32(0.5)) / np.float32(most)


def _averaged(values: np.ndarray, factor: int) -> np.ndarray:
    """Return the means of areas of `factor` × `factor` pixels; the last ones may be smaller."""
    for axis in (0, 1):
        first = np.arange(0, values.shape[axis], factor)
        count = np.diff(np.append(first, values.shape[axis]))
        shape = [1, 1, 1]
        shape[axis] = len(count)
        values = np.add.reduceat(values, first, axis) / count.reshape(shape).astype(np.float32)
    return values


def _factor(height: int, width: int) -> int:
    """Return the least whole number by which a photo is reduced to at most `FULL` pixels."""
    factor = 1
    while -(-height // factor) * -(-width // factor) > FULL:
        factor += 1
    return factor


def _check_size(path: Path, width: int, height: int, channels: int) -> None:
    if min(width, height) < SMALLEST:
        raise ValueError(
            f"{path} has {width}×{height} pixels, too few to see an object in: pass a picture of "
            f"at least {SMALLEST} on each side"
        )
    if max(width, height) > _LONGEST * min(width, height):
        raise ValueError(
            f"{path} has {width}×{height} pixels, more than {_LONGEST} times as many one way as "
            "the other: cut out the object"
        )
    untrusted.check_size(path, width, height, channels, LARGEST)


def write(path: str | Path, image: np.ndarray, *, shared: bool = False) -> None:
    """Write an image `(H, W, C)` of floats, or of uint8, completely or not at all.

    The same image always gives the same bytes.

    Args:
        path: path of the file. A `.exr` holds half floats; any other format holds 8 bits of [0, 1].
        image: values to write as they are, without a change of colour space; NaN becomes 0 in a
            format of 8 bits; uint8 stands for 0 to 1 in steps of 1/255. Of four channels, of
            floats, the last is alpha, by which the others are multiplied, as `read` has them.
        shared: whether several processes may write `path` at once (see `atomic.replacing`).

    Raises:
        OSError: if the file cannot be written.
        ValueError: if the suffix is of no format that can be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".exr":
        _write_exr(path, image, shared)
    else:
        atomic.write(path, encoded(path, image), shared=shared)


def check_written(path: Path, written: Path) -> None:
    """Raise OSError if a picture that OpenImageIO has written cannot be read to its end.

    The library does not see that the last bytes of a file found no room.
    """
    picture = oiio.ImageBuf(str(written))
    if not picture.read(force=True):
        picture.geterror()  # fetched, as it would be printed otherwise
        raise OSError(
            f"{path} cannot be written: it ends too early; make room, or pass another folder"
        )


def encoded(path: Path, image: np.ndarray) -> bytes:
    """Return the content of a file of 8 bits, in the format of the path's suffix."""
    from PIL import Image

    # The usual formats are known at once; all of Pillow's take as long as a network.
    Image.preinit()
    suffix = path.suffix.lower()
    kind = Image.EXTENSION.get(suffix) or Image.registered_extensions().get(suffix)
    if kind is None:
        raise ValueError(f"{path} has no suffix of a picture: call it .png")
    if image.shape[-1] == 4 and image.dtype != np.uint8:
        image = _straight(image)
    levels = image if image.dtype == np.uint8 else _rounded(image)
    out = io.BytesIO()
    # Runs alone take a third of the time of the default, for at most a seventh more bytes.
    options = {"compress_type": zlib.Z_RLE} if kind == "PNG" else {}
    grey = levels.shape[-1] == 1
    picture = Image.fromarray(levels.reshape(levels.shape[:2]) if grey else levels)
    try:
        picture.save(out, kind, **options)
    except OSError as error:  # of an encoder: no disk is written to here
        mend = "close programs if memory is short" + ("" if kind == "PNG" else ", or call it .png")
        raise OSError(f"{path} cannot be written: {error}; {mend}") from error
    return out.getvalue()


def _straight(image: np.ndarray) -> np.ndarray:
    """Return `(H, W, 4)` with colours that are not multiplied by alpha, as a PNG has them."""
    colours, alpha = image[..., :3], image[..., 3:]
    divided = np.divide(colours, alpha, out=np.zeros_like(colours), where=alpha > 0)
    return np.concatenate([divided, alpha], axis=-1)


def _rounded(image: np.ndarray) -> np.ndarray:
    """Return the levels, uint8, of values `(H, W, C)` in [0, 1]; NaN becomes 0."""
    levels = np.empty(image.shape, np.uint8)
    # In bands: floats of the whole picture would take four times its memory.
    for top in range(0, len(image), _BAND):
        band = np.nan_to_num(np.asarray(image[top : top + _BAND], np.float32), nan=0)
        levels[top : top + _BAND] = np.clip(band, 0, 1) * np.float32(255) + np.float32(0.5)
    return levels


def _write_exr(path: Path, image: np.ndarray, shared: bool) -> None:
    height, width, channels = image.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.HALF)
    spec.attribute("DateTime", "")  # else the time of writing is put in
    buffer = oiio.ImageBuf(spec)
    dtype = np.uint8 if image.dtype == np.uint8 else np.float32
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(image, dtype))
    with atomic.replacing(path, shared=shared) as partial:
        if not buffer.write(str(partial)):
            reason = buffer.geterror().replace(str(partial), str(path)) or "no reason is given"
            raise OSError(f"{path} cannot be written: {reason}; make room, or pass another folder")
        check_written(path, partial)
