"""The colour space of a picture, from all that its file says, and the conversion from it to sRGB.

What a file says is decided by its values, never by the name of a profile, in the order of PNG's
standard: coding-independent code points (cICP, ITU-T H.273), an ICC profile, the mark of sRGB, then
gamma and chromaticities. Files that say nothing are sRGB, those of radiance linear Rec. 709.
"""

import io
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lime_keras.material import Caution
from lime_keras.optics import colour

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities x, y of red, green, blue and white, as OpenEXR lists them."""
ADOBE = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290)
ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
_PRIMARIES: Mapping[int, tuple[float, ...]] = {
    1: REC709,
    4: (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316),
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 0.3127, 0.3290),
    6: (0.63, 0.34, 0.31, 0.595, 0.155, 0.07, 0.3127, 0.3290),
    7: (0.63, 0.34, 0.31, 0.595, 0.155, 0.07, 0.3127, 0.3290),
    8: (0.681, 0.319, 0.243, 0.692, 0.145, 0.049, 0.310, 0.316),
    9: (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    10: XYZ,
    11: (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.314, 0.351),
    12: (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.3290),
    22: (0.63, 0.34, 0.295, 0.605, 0.155, 0.077, 0.3127, 0.3290),
}
"""Chromaticities by H.273's number of colour primaries."""
_LIKE_REC709 = (1, 2, 5, 6, 7, 22)
"""Primaries of standard-range video that all players show alike, and the unspecified ones."""
_D50 = (0.3457, 0.3585)
_WHITE = 203.0  # luminance of diffuse white in cd/m² in high dynamic range (ITU-R BT.2408)
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
_NEAR = 2e-3  # largest difference of chromaticities by rounding
_LIKE_SRGB = 0.05
"""Largest relative difference of a gamma from 1 / 2.2 that still means sRGB, as in libpng."""
_LEVELS = 2  # levels of 255 by which profiles of sRGB differ from each other

Curve = Callable[[np.ndarray], np.ndarray]
"""A function from what a file holds, in [0, 1], to linear values, 1 for white."""


@dataclass(frozen=True)
class Tags:
    """What a file says of its colours.

    Attributes:
        code_points: H.273's numbers of primaries and transfer curve.
        profile: ICC profile.
        is_srgb: whether it is marked as sRGB.
        exponent: gamma by which its values were encoded, such as 1 / 2.2.
        chromaticities: as `REC709`.
        curve: decoding of its values; None for sRGB's, or what `exponent` says.
        is_unspecified: whether it says that its colours are not sRGB, and not what they are.
        is_narrow: whether black is 16 of 255 and white 235, as in video.
    """

    code_points: tuple[int, int] | None = None
    profile: bytes | None = None
    is_srgb: bool = False
    exponent: float | None = None
    chromaticities: tuple[float, ...] | None = None
    curve: Curve | None = None
    is_unspecified: bool = False
    is_narrow: bool = False


@dataclass(frozen=True)
class Conversion:
    """The conversion from a file's values to sRGB.

    Attributes:
        convert: function from colours `(h, W, C)`, C being 1 or 3, 1 for the largest integer, to
            sRGB `(h, W, 3)`.
        is_identity: whether it changes nothing but the number of channels.
        cautions: what it cannot do.
    """

    convert: Curve
    is_identity: bool = False
    cautions: tuple[Caution, ...] = ()


def linear(values: np.ndarray) -> np.ndarray:
    """Return linear values as they are."""
    return values


def decide(tags: Tags, channels: int, *, deep: bool) -> Conversion:
    """Return the conversion from the colour space that a file names.

    Args:
        tags: what the file says.
        channels: its number of channels of colour, 1 or 3.
        deep: whether its values have more than 8 bits; the conversion of others has 8, too.
    """
    if tags.is_narrow:
        whole = decide(replace(tags, is_narrow=False), channels, deep=deep)
        levels = 65535 / 256 if deep else 255.0
        return replace(whole, convert=lambda colours: whole.convert((colours * levels - 16) / 219))
    if tags.code_points and tags.code_points != (2, 2):
        primaries, transfer = tags.code_points
        if primaries in (*_PRIMARIES, 2) and transfer in (*_CURVES, 2):
            if transfer in _OF_VIDEO and primaries in _LIKE_REC709:
                return IDENTITY
            return _converting(
                _PRIMARIES.get(primaries, REC709), _CURVES.get(transfer, colour.srgb_to_linear)
            )
        return _unknown(f"it has the code points {primaries}, {transfer}, which are not known here")
    if tags.profile:
        return _of_profile(tags.profile, channels, deep=deep)
    if tags.is_srgb:
        return IDENTITY
    if tags.is_unspecified and not tags.chromaticities:
        return _unknown("it says that they are not, and not what they are")
    curve = tags.curve or colour.srgb_to_linear
    like_srgb = tags.exponent and abs(tags.exponent * 2.2 - 1) <= _LIKE_SRGB
    if tags.exponent and not (like_srgb and tags.chromaticities != ADOBE):
        curve = _power(1 / tags.exponent)
    return _converting(tags.chromaticities or REC709, curve)


def matrix(chromaticities: tuple[float, ...]) -> np.ndarray:
    """Return the matrix `(3, 3)` from linear RGB to linear Rec. 709, the white points adapted.

    CIE XYZ itself is not adapted: its white is no white of a scene.

    Raises:
        ValueError: if the chromaticities make no colours.
    """
    if np.allclose(chromaticities[:6], XYZ[:6], atol=_NEAR):
        return np.linalg.inv(_to_xyz(REC709))
    try:
        out = _to_rec709(chromaticities[6:]) @ _to_xyz(chromaticities)
    except (np.linalg.LinAlgError, ZeroDivisionError) as error:
        raise ValueError("its chromaticities make no colours") from error
    if not np.isfinite(out).all():
        raise ValueError("its chromaticities make no colours")
    return out


# ---- spaces given by numbers -----------------------------------------------------------------


def _unknown(reason: str) -> Conversion:
    message = f"its colours are read as sRGB, but {reason}: convert it to sRGB"
    return Conversion(_repeated, is_identity=True, cautions=(Caution("colours-unknown", message),))


def _repeated(colours: np.ndarray) -> np.ndarray:
    return np.repeat(colours, 3, axis=-1) if colours.shape[-1] == 1 else colours


IDENTITY = Conversion(_repeated, is_identity=True)
"""The conversion of sRGB, and of numbers that are no colours."""


def _converting(chromaticities: tuple[float, ...], curve: Curve) -> Conversion:
    """Return the conversion from an RGB space of chromaticities and a curve."""
    is_rec709 = np.allclose(chromaticities, REC709, atol=_NEAR)
    if is_rec709 and curve is colour.srgb_to_linear:
        return IDENTITY
    try:
        to_rec709 = None if is_rec709 else matrix(chromaticities).T.astype(np.float32)
    except ValueError as error:
        return _unknown(str(error))

    def convert(colours: np.ndarray) -> np.ndarray:
        values = _repeated(curve(colours))
        if to_rec709 is not None:
            values = values @ to_rec709
        if not np.isfinite(values).all():
            return values  # the caller refuses them
        return colour.linear_to_srgb(np.clip(values, 0, 1))

    return Conversion(convert)


def _to_xyz(chromaticities: tuple[float, ...]) -> np.ndarray:
    """Return the matrix from linear RGB to CIE XYZ, of which white has Y = 1."""
    x, y = np.array(chromaticities[:6], float).reshape(3, 2).T
    columns = np.stack([x, y, 1 - x - y])
    return columns * np.linalg.solve(columns, _white(chromaticities[6:]))


def _to_rec709(white: tuple[float, ...]) -> np.ndarray:
    """Return the matrix from XYZ under a white to linear Rec. 709, adapted by Bradford's method."""
    cones, own = _BRADFORD @ _white(white), _BRADFORD @ _white(REC709[6:])
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(own / cones) @ _BRADFORD
    return np.linalg.inv(_to_xyz(REC709)) @ adapted


def _white(xy: tuple[float, ...]) -> np.ndarray:
    x, y = xy
    return np.array([x / y, 1.0, (1 - x - y) / y])


def _power(exponent: float) -> Curve:
    return lambda values: np.maximum(values, 0) ** np.float32(exponent)


def _pq(values: np.ndarray) -> np.ndarray:
    """Decode the perceptual quantizer of SMPTE ST 2084, whose 1 is 10,000 cd/m²."""
    root = np.clip(values, 0, 1).astype(np.float64) ** (1 / 78.84375)
    light = np.maximum(root - 0.8359375, 0) / (18.8515625 - 18.6875 * root)
    return (light ** (1 / 0.1593017578125) * (10_000 / _WHITE)).astype(np.float32)


def _hlg(values: np.ndarray) -> np.ndarray:
    """Decode hybrid log-gamma as a screen of 1000 cd/m² shows it (ITU-R BT.2100)."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    signal = np.clip(values, 0, 1)
    scene = np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)
    weights = np.array([0.2627, 0.6780, 0.0593]) if scene.shape[-1] == 3 else np.ones(1)
    return (scene * (scene @ weights)[..., None] ** 0.2 * (1000 / _WHITE)).astype(np.float32)


_CURVES: Mapping[int, Curve] = {
    **dict.fromkeys((1, 6, 14, 15), colour.srgb_to_linear),  # as screens show BT.709's camera
    4: _power(2.2),
    5: _power(2.8),
    8: linear,
    13: colour.srgb_to_linear,
    16: _pq,
    18: _hlg,
}
"""Decodings by H.273's number of transfer characteristics."""
_OF_VIDEO = (1, 2, 6, 14, 15)
"""Curves of standard-range video, which are shown as sRGB where its primaries are."""


# ---- ICC profiles ----------------------------------------------------------------------------


def _of_profile(profile: bytes, channels: int, *, deep: bool) -> Conversion:
    """Return the conversion from an ICC profile.

    8 bits are converted by LittleCMS. Of more, which Pillow does not give to LittleCMS, the
    curves and the matrix of the profile itself are computed; profiles of tables lose bits.
    """
    from PIL import Image, ImageCms

    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        space = source.profile.xcolor_space.strip()
    except (OSError, ValueError, ImageCms.PyCMSError):
        return _unknown("its profile is broken")
    if space not in ("RGB", "GRAY") or (space == "GRAY" and channels != 1):
        return _unknown(f"its profile is for {space}")
    mode, count = ("L", 1) if space == "GRAY" else ("RGB", 3)
    try:
        transform = ImageCms.buildTransform(source, ImageCms.createProfile("sRGB"), mode, "RGB")
    except (OSError, ImageCms.PyCMSError):
        return _unknown("its profile is broken")

    def convert(colours: np.ndarray) -> np.ndarray:
        levels = (np.clip(colours, 0, 1) * 255 + 0.5).astype(np.uint8)
        if count == 1:
            levels = levels[..., 0]
        elif levels.shape[-1] == 1:
            levels = np.repeat(levels, 3, axis=-1)
        image = ImageCms.applyTransform(Image.fromarray(levels), transform)
        return np.asarray(image) / np.float32(255)

    asked = _samples(count)
    if np.abs(convert(asked) - _repeated(asked)).max() * 255 <= _LEVELS + 0.5:
        return IDENTITY
    if not deep:
        return Conversion(convert)
    precise = _computed(profile, source.profile, count)
    if precise is not None:
        return precise
    message = "its profile is a table, through which 8 of its bits remain: convert it to sRGB first"
    return Conversion(convert, cautions=(Caution("colours-8-bit", message),))


def _samples(count: int) -> np.ndarray:
    """Return levels `(N, 1, count)` all over the cube, and all greys, in [0, 1]."""
    greys = np.arange(256)[:, None].repeat(count, 1)
    cube = np.stack(np.meshgrid(*[np.arange(0, 256, 51)] * count), -1).reshape(-1, count)
    return np.concatenate([greys, cube]).astype(np.float32)[:, None] / np.float32(255)


def _computed(profile: bytes, header: Any, count: int) -> Conversion | None:
    """Return the conversion by a profile's curves and matrix, in floats; None if it has none."""
    tags = _profile_tags(profile)
    try:
        if count == 1 and header.connection_space.strip() == "XYZ":
            return _converting(REC709, _curve(tags[b"kTRC"]))
        if {b"A2B0", b"A2B1"} & tags.keys():
            return None
        curves = [_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC")]
        columns = [header.red_colorant, header.green_colorant, header.blue_colorant]
        to_rec709 = _to_rec709(_D50) @ np.array([column[0] for column in columns]).T
    except (ArithmeticError, KeyError, TypeError, ValueError, struct.error):
        return None
    weights = to_rec709.T.astype(np.float32)

    def convert(colours: np.ndarray) -> np.ndarray:
        channels = _repeated(np.clip(colours, 0, 1))
        values = np.stack([curve(channels[..., k]) for k, curve in enumerate(curves)], -1)
        return colour.linear_to_srgb(np.clip(values @ weights, 0, 1))

    return Conversion(convert)


def _profile_tags(profile: bytes) -> dict[bytes, bytes]:
    """Return the elements of an ICC profile by signature (ICC.1, section 7.3)."""
    (count,) = struct.unpack_from(">I", profile, 128)
    entries = struct.iter_unpack(">4sII", profile[132 : 132 + 12 * min(count, 100)])
    return {name: profile[start : start + size] for name, start, size in entries}


def _curve(element: bytes) -> Curve:
    """Return the curve of an element of the type `curv` or `para` (ICC.1, sections 10.6, 10.18).

    It raises ValueError for another type, and struct.error if it is cut short.
    """
    if element[:4] == b"curv":
        (count,) = struct.unpack_from(">I", element, 8)
        if count == 0:
            return linear
        table = np.array(struct.unpack_from(f">{count}H", element, 12), np.float32)
        if count == 1:
            return _power(float(table[0]) / 256)
        places = np.linspace(0, 1, count, dtype=np.float32)
        return lambda values: np.interp(values, places, table / 65535).astype(np.float32)
    if element[:4] != b"para":
        raise ValueError("neither a table nor a formula")
    (kind,) = struct.unpack_from(">H", element, 8)
    if kind > 4:
        raise ValueError("a formula that is not known")
    count = (1, 3, 4, 5, 7)[kind]
    g, *others = (number / 65536 for number in struct.unpack_from(f">{count}i", element, 12))
    others += [1.0, 0.0, 0.0, 0.0, 0.0, 0.0][len(others) :]
    a, b, c, d, e, f = others
    if kind in (1, 2):  # c is added, and below −b / a there is nothing else
        c, d, e, f = 0.0, -b / a, c, c
    return lambda values: np.where(
        values >= d, np.maximum(a * values + b, 0) ** g + e, c * values + f
    ).astype(np.float32)
