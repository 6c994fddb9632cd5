"""The reader of normal maps, which a user's scanner or renderer made for the shape in a photo."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import photo, picture_file, untrusted

_LEAST_LENGTH = 0.5
"""Length below which a vector is background; files use black or mid-grey for background."""
_UNIT_WITHIN = 0.1
"""Deviation from length 1 allowed for a unit normal.

Only half of the pixels have to keep it: where surfaces meet, averaged normals are shorter.
"""
_NAMES = (("normal.X", "normal.Y", "normal.Z"), ("X", "Y", "Z"), ("R", "G", "B"))
"""Names of the channels to look for, in this order; `lime-render layers` writes the first."""


def read(path: str | Path) -> np.ndarray:
    """Read unit normals in camera space (x right, y up, z towards the camera).

    An OpenEXR file holds n itself, in channels normal.X, normal.Y, normal.Z, or X, Y, Z, or R, G,
    B. A PNG of 8 or 16 bits holds v = (n + 1) / 2, as colours without a gamma. Vectors shorter than
    one half, black pixels of a PNG and pixels of alpha 0 are background. An orientation that the
    file names turns its grid, not its vectors.

    Returns:
        Normals `(H, W, 3)` float32, of length 1, or 0 in the background.

    Raises:
        ValueError: if the file is missing or neither EXR nor PNG, lacks the three channels, holds
            NaN or infinity, or holds no normal at all; if it has more than `photo.FULL` pixels, as
            a photo of that size is read smaller; also if most of its vectors do not have length 1,
            or point away from the camera.
    """
    path = Path(path)
    untrusted.check(path, "normals")
    with untrusted.naming(path, "normals"):
        return _read(path)


def _read(path: Path) -> np.ndarray:
    image = picture_file.open_image(path, straight=True)
    kind, names = image.file_format_name, image.spec().channelnames
    for area in (image.roi, image.roi_full):
        untrusted.check_size(path, area.width, area.height, len(names), largest=photo.FULL)
    if kind not in ("openexr", "png"):
        raise ValueError(f"{path} is {kind.upper()}: save normals as OpenEXR or PNG")
    if not image.read(force=True):
        raise ValueError(f"{path} cannot be read: {image.geterror()}; export it anew")
    orientation = picture_file.orientation(path, image)
    if orientation > 1:
        # The grid is turned as a photo's and a mask's; the vectors are those of the upright photo.
        image.orientation = orientation
        image = oiio.ImageBufAlgo.reorient(image)
    # The display window is the photo's; where it holds no data there is no normal.
    pixels = np.asarray(image.get_pixels(oiio.FLOAT, image.roi_full))
    vectors = pixels[..., _channels(path, names)]
    if not np.all(np.isfinite(vectors)):
        count = np.sum(~np.isfinite(vectors).all(axis=-1))
        raise ValueError(f"{path} holds {count} pixels of NaN or infinity: write 0 there")
    if kind == "png":
        black = ~vectors.any(axis=-1, keepdims=True)
        vectors = np.where(black, 0, 2 * vectors - 1)
    if "A" in names:
        vectors = np.where(pixels[..., names.index("A"), None] > 0, vectors, 0)
    return _normals(path, vectors.astype(np.float32))


def _channels(path: Path, names: tuple[str, ...]) -> list[int]:
    """Return the indices of the channels that hold x, y and z; raise ValueError without them."""
    for wanted in _NAMES:
        if set(wanted) <= set(names):
            return [names.index(name) for name in wanted]
    raise ValueError(
        f"{path} has the channels {', '.join(names)}: name those of the normals X, Y, Z or R, G, B"
    )


def _normals(path: Path, vectors: np.ndarray) -> np.ndarray:
    """Return vectors `(H, W, 3)` made unit, the background 0; raise ValueError if not normals."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    known = length[..., 0] >= _LEAST_LENGTH
    if not known.any():
        raise ValueError(f"{path} holds no normal: all vectors are shorter than {_LEAST_LENGTH}")
    share = float(np.mean(np.abs(length[known] - 1) < _UNIT_WITHIN))
    if share < 0.5:
        raise ValueError(
            f"{path}: {share:.0%} of the vectors have length 1, the median is "
            f"{np.median(length[known]):.3g}: an EXR holds n itself, a PNG (n + 1) / 2 without a "
            "gamma"
        )
    away = float(np.mean(vectors[known][:, 2] < 0))
    if away > 0.5:
        raise ValueError(
            f"{path}: {away:.0%} of the normals point away from the camera: z points towards the "
            "camera here, flip z, or rotate world-space normals into camera space"
        )
    return np.where(known[..., None], vectors / np.maximum(length, _LEAST_LENGTH), 0)
