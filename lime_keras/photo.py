"""Pictures from and to files, by OpenImageIO."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras import colour

_LINEAR_FORMATS = ("openexr", "hdr")


def read_srgb(path: Path) -> np.ndarray:
    """Read a picture as `(H, W, 3)` float32 sRGB in [0, 1].

    Integer formats are taken to be sRGB already; OpenEXR and Radiance files to be linear, which are
    clipped at 1 and encoded. Grey is repeated, alpha dropped, EXIF rotation applied.

    Raises:
        ValueError: if the file is missing, no picture, empty, or not finite.
    """
    image = oiio.ImageBuf(str(path))
    if image.has_error or not image.read(force=True, convert=oiio.FLOAT):
        raise ValueError(f"{path} cannot be read as a picture: {image.geterror()}")
    # Reorienting makes a new image, which no longer knows its format.
    is_linear = image.file_format_name in _LINEAR_FORMATS
    image = oiio.ImageBufAlgo.reorient(image)
    pixels = image.get_pixels(oiio.FLOAT)
    if pixels is None or pixels.size == 0:
        raise ValueError(f"{path} holds no pixels: check the file")
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    pixels = pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    if not np.all(np.isfinite(pixels)):
        raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
    if is_linear:
        pixels = colour.linear_to_srgb(np.clip(pixels, 0, 1))
    return np.clip(pixels, 0, 1).astype(np.float32)


def write(path: Path, image: np.ndarray) -> None:
    """Write `(H, W, C)` floats: a `.png` as 8 bits of [0, 1], an `.exr` as half floats.

    Raises:
        OSError: if the file cannot be written.
    """
    height, width, channels = image.shape
    kind = oiio.HALF if path.suffix == ".exr" else oiio.UINT8
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, kind))
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(image, np.float32))
    if not buffer.write(str(path)):
        raise OSError(f"{path} cannot be written: {buffer.geterror()}")


def fit_square(image_srgb: np.ndarray, size: int) -> np.ndarray:
    """Centre a photo `(H, W, 3)`, sRGB, in a square of its longer side and resample to `size`.

    What lies beyond its edges repeats the edge. Made smaller, it is averaged over areas in linear
    light, as the training images are (`pipeline.resize`).
    """
    image = colour.srgb_to_linear(image_srgb)
    height, width, channels = image.shape
    side = max(height, width)
    top, left = (side - height) // 2, (side - width) // 2
    margins = ((top, side - height - top), (left, side - width - left), (0, 0))
    square = np.pad(image, margins, mode="edge")
    if side == size:
        return np.pad(image_srgb, margins, mode="edge")
    source = oiio.ImageBuf(oiio.ImageSpec(side, side, channels, oiio.FLOAT))
    source.set_pixels(oiio.ROI(), np.ascontiguousarray(square, np.float32))
    region = oiio.ROI(0, size, 0, size, 0, 1, 0, channels)
    kernel = "box" if side > size else "triangle"
    resized = oiio.ImageBufAlgo.resize(source, filtername=kernel, roi=region)
    linear = np.asarray(resized.get_pixels(oiio.FLOAT))
    return np.clip(colour.linear_to_srgb(linear), image_srgb.min(), image_srgb.max())
