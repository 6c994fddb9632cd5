"""Reading and writing of pictures, with OpenImageIO."""

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import atomic
from lime_keras.optics import colour

if TYPE_CHECKING:
    from PIL import Image

LARGEST = 50_000_000
"""Largest number of pixels that a photo may have; such a photo takes 6 GB of memory."""
SMALLEST = 16
"""Smallest number of pixels on a photo's shorter side; fewer show no object's shading."""
_HEIF = (".heic", ".heif", ".hif")
_LINEAR_FORMATS = ("openexr", "hdr")
_LINEAR_SPACES = ("lin", "scene_linear")
_BAND = 256
"""Rows of a picture that are converted at a time."""


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Read a photo of any kind, and its alpha channel if a part of the photo is transparent.

    Integer formats count as sRGB; with a colour profile, such as the Display P3 of phones, they are
    converted from it to sRGB. OpenEXR, Radiance and files marked as linear (a PNG with gamma 1) are
    linear: they are clipped at 1 and encoded as sRGB. A grey channel is repeated, palettes and CMYK
    become RGB, EXIF rotation is applied, and of a file with several pages the first is read.
    Transparent pixels are composed over black.

    Returns:
        image: `(H, W, 3)` float32 sRGB in [0, 1].
        alpha: `(H, W, 1)` float32 in [0, 1]; None if nothing is transparent.

    Raises:
        ValueError: if the file is missing, not a picture, empty, or holds NaN or infinity; also if
            it is smaller than `SMALLEST` or larger than `LARGEST`.
    """
    path = Path(path)
    pixels, alpha, is_linear = _read_heif(path) if _is_heif(path) else _read(path)
    if not np.all(np.isfinite(pixels)):
        raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
    if is_linear:
        pixels = colour.linear_to_srgb(np.clip(pixels, 0, 1))
    if alpha is not None:
        alpha = np.clip(alpha, 0, 1) if np.min(alpha) < 1 else None
    return np.clip(pixels, 0, 1).astype(np.float32), alpha


def from_pil(image: "Image.Image") -> tuple[np.ndarray, np.ndarray | None]:
    """Return the pixels of a PIL image as `read` returns those of a file.

    EXIF rotation and a colour profile that the image brings are applied.

    Args:
        image: image of 8 bits a channel, of any mode.

    Raises:
        ValueError: if the image is empty, or has a mode of more bits, whose range is not known.
    """
    from PIL import ImageOps

    if image.mode.startswith(("I", "F")):
        raise ValueError(
            f"a PIL image of mode {image.mode} has no known range: pass its path, or an array of "
            "floats in [0, 1]"
        )
    if 0 in image.size:
        raise ValueError("a PIL image without pixels shows nothing: check how it was made")
    image = ImageOps.exif_transpose(image)
    profile, transparent = image.info.get("icc_profile"), image.has_transparency_data
    levels = np.asarray(image.convert("RGBA" if transparent else "RGB"), np.float32)
    pixels, alpha = levels[..., :3] / np.float32(255), levels[..., 3:] / np.float32(255)
    pixels = _from_profile(pixels, profile)
    if not transparent or np.min(alpha) == 1:
        return pixels, None
    return pixels * alpha, alpha


def read_srgb(path: str | Path) -> np.ndarray:
    """Read a photo as `(H, W, 3)` float32 sRGB in [0, 1], without its alpha channel.

    Raises:
        ValueError: if the photo cannot be read (see `read`).
    """
    return read(path)[0]


def read_mask(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read the mask of an object from a picture that is white where the object is.

    The mask is the mean of the picture's channels, or its alpha channel if it has one.

    Args:
        path: path of the picture.
        height: height of the mask's photo in pixels.
        width: width of the mask's photo in pixels.

    Returns:
        Coverage `(height, width, 1)` float32 in [0, 1].

    Raises:
        ValueError: if the picture cannot be read (see `read`), has another size than the photo, or
            is black.
    """
    image, alpha = read(path)
    mask = image.mean(-1, keepdims=True) if alpha is None else alpha
    if mask.shape[:2] != (height, width):
        raise ValueError(
            f"{path} has {mask.shape[1]}×{mask.shape[0]} pixels and its photo {width}×{height}: "
            "a mask has its photo's size"
        )
    if not np.any(mask >= 0.5):
        raise ValueError(f"{path} is black, so it masks no object: paint the object white")
    return mask


def _read(path: Path) -> tuple[np.ndarray, np.ndarray | None, bool]:
    """Read colour `(H, W, 3)`, alpha `(H, W, 1)` or None, and whether the colour is linear."""
    image = oiio.ImageBuf(str(path))
    if not image.has_error:
        _check_size(path, image.spec().width, image.spec().height)
    if image.has_error or not image.read(force=True, convert=oiio.FLOAT):
        raise ValueError(f"{path} cannot be read as a picture: {image.geterror()}")
    # Take the format's properties now: the image that `reorient` makes has lost them.
    space = image.spec().get_string_attribute("oiio:ColorSpace").lower()
    is_linear = image.file_format_name in _LINEAR_FORMATS or space.startswith(_LINEAR_SPACES)
    profile = image.spec().getattribute("ICCProfile")
    alpha_channel = image.spec().alpha_channel
    image = oiio.ImageBufAlgo.reorient(image)
    pixels = image.get_pixels(oiio.FLOAT)
    if pixels is None or pixels.size == 0:
        raise ValueError(f"{path} holds no pixels: check the file")
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    has_alpha = 0 < alpha_channel < pixels.shape[-1]
    alpha = pixels[..., alpha_channel : alpha_channel + 1] if has_alpha else None
    if pixels.shape[-1] < 3:
        return np.repeat(pixels[..., :1], 3, axis=-1), alpha, is_linear
    pixels = pixels[..., :3]
    if profile is not None and not is_linear:
        pixels = _from_profile(pixels, bytes(profile))
    return pixels, alpha, is_linear


def _is_heif(path: Path) -> bool:
    return path.suffix.lower() in _HEIF and path.is_file()


def _read_heif(path: Path) -> tuple[np.ndarray, np.ndarray | None, bool]:
    """Read a phone's HEIC as `_read` does; the wheels of OpenImageIO do not support HEIC."""
    import pillow_heif

    with _naming(path):
        # The image is upright already: the library applies the file's rotation.
        image = pillow_heif.open_heif(path)
    _check_size(path, *image.size)
    with _naming(path):
        pixels = np.asarray(image)
    pixels = pixels.reshape(*pixels.shape[:2], -1) / np.float32(np.iinfo(pixels.dtype).max)
    if pixels.shape[-1] < 3:
        return np.repeat(pixels[..., :1], 3, axis=-1), None, False
    alpha = pixels[..., 3:] if pixels.shape[-1] == 4 else None
    pixels = _from_profile(pixels[..., :3], image.info.get("icc_profile"))
    return pixels if alpha is None else pixels * alpha, alpha, False


def _from_profile(pixels: np.ndarray, profile: bytes | None) -> np.ndarray:
    """Convert pixels `(H, W, 3)` in [0, 1] from an ICC profile to sRGB, with 8 bits.

    The pixels stay unchanged if the profile is broken, is not for RGB (OpenImageIO has converted
    CMYK to RGB already), or is sRGB itself.
    """
    if not profile:
        return pixels
    from PIL import Image, ImageCms

    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        is_srgb = "srgb" in ImageCms.getProfileDescription(source).lower()
        if is_srgb or source.profile.xcolor_space.strip() != "RGB":
            return pixels
        transform = ImageCms.buildTransform(source, ImageCms.createProfile("sRGB"), "RGB", "RGB")
    except (OSError, ImageCms.PyCMSError):
        return pixels
    levels = (np.clip(pixels, 0, 1) * 255 + 0.5).astype(np.uint8)
    image = ImageCms.applyTransform(Image.fromarray(levels), transform)
    return np.asarray(image) / np.float32(255)


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Turn a decoder's errors into a ValueError that names the file."""
    try:
        yield
    except (OSError, RuntimeError, SyntaxError, ValueError) as error:
        raise ValueError(f"{path} cannot be read as a picture: {error}") from error


def _check_size(path: Path, width: int, height: int) -> None:
    if min(width, height) < SMALLEST:
        raise ValueError(
            f"{path} has {width}×{height} pixels, too few to see an object in: pass a picture of "
            f"at least {SMALLEST} on each side"
        )
    if width * height > LARGEST:
        raise ValueError(
            f"{path} has {width}×{height} pixels, more than the {LARGEST // 10**6} million that "
            "are taken: make it smaller first; the networks look at far fewer"
        )


def write(path: str | Path, image: np.ndarray, *, shared: bool = False) -> None:
    """Write an image `(H, W, C)` of floats, completely or not at all.

    The same image always gives the same bytes.

    Args:
        path: path of the file. A `.exr` holds half floats; any other format holds 8 bits of [0, 1].
        image: values to write as they are, without a change of colour space; NaN becomes 0 in a
            format of 8 bits.
        shared: whether several processes may write `path` at once (see `atomic.replacing`).

    Raises:
        OSError: if the file cannot be written.
        ValueError: if the suffix is of no format that can be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".exr":
        _write_exr(path, image, shared)
    else:
        atomic.write(path, _encoded(path, image), shared=shared)


def check_written(path: Path, written: Path) -> None:
    """Raise OSError if a picture that OpenImageIO has written cannot be read to its end.

    The library does not see that the last bytes of a file found no room.

    Args:
        path: path of the picture, for the message.
        written: path where it was written.
    """
    picture = oiio.ImageBuf(str(written))
    if not picture.read(force=True):
        picture.geterror()  # fetched, as it would be printed otherwise
        raise OSError(
            f"{path} cannot be written: it ends too early; make room, or pass another folder"
        )


def _encoded(path: Path, image: np.ndarray) -> bytes:
    """Return the content of a file of 8 bits, in the format of the path's suffix."""
    from PIL import Image

    kind = Image.registered_extensions().get(path.suffix.lower())
    if kind is None:
        raise ValueError(f"{path} has no suffix of a picture: call it .png")
    # Rounded in bands: floats of the whole picture would take four times its memory.
    levels = np.empty(image.shape, np.uint8)
    for top in range(0, len(image), _BAND):
        band = np.nan_to_num(np.asarray(image[top : top + _BAND], np.float32), nan=0)
        levels[top : top + _BAND] = np.clip(band, 0, 1) * np.float32(255) + np.float32(0.5)
    out = io.BytesIO()
    # Level 4 takes half the time of the default level, for a tenth more bytes.
    options = {"compress_level": 4} if kind == "PNG" else {}
    Image.fromarray(levels[..., 0] if levels.shape[-1] == 1 else levels).save(out, kind, **options)
    return out.getvalue()


def _write_exr(path: Path, image: np.ndarray, shared: bool) -> None:
    height, width, channels = image.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.HALF)
    spec.attribute("DateTime", "")  # else the time of writing is put in
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(image, np.float32))
    with atomic.replacing(path, shared=shared) as partial:
        if not buffer.write(str(partial)):
            reason = buffer.geterror().replace(str(partial), str(path))
            raise OSError(f"{path} cannot be written: {reason}; make room, or pass another folder")
        check_written(path, partial)
