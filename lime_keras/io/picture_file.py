"""Opens picture files by their content, checks them, and finds the picture among their channels."""

import mmap
import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import colour_space
from lime_keras.io.colour_space import Conversion, Tags
from lime_keras.material import Caution

if TYPE_CHECKING:
    from PIL import Image

FORMATS = (
    *("bmp", "gif", "hdr", "jpeg", "jpeg2000", "jpegxl", "openexr"),
    *("png", "pnm", "targa", "tiff", "webp"),
)
"""The formats that are read through OpenImageIO, by its names: those that `make fuzz` has damaged.

`open_picture` reads others by Pillow. A decoder that crashes takes the process with it, and all
photos of a folder.
"""
_OF_PILLOW = ("bmp", "gif", "jpeg", "jpeg2000", "png", "tiff", "webp")
"""Formats whose tags Pillow knows better: EXIF, XMP, and PNG's chromaticities."""
_STRAIGHT = ("bmp", "gif", "jpeg2000", "jpegxl")
"""Formats whose colours are not multiplied by alpha, and of which OpenImageIO does not say so."""
_LINEAR = ("openexr", "hdr")
_FTYP, _HEIF = b"ftyp", (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
_AVIF = (b"avif", b"avis")  # brands of HEIF files by codec: HEVC (phones) and AV1
_MARKER = re.compile(rb"\xff[^\x00\x01\xd0-\xd7\xff]", re.DOTALL)
"""A marker of a JPEG that begins a segment or ends the picture; escaped bytes are none."""
_END_OF_IMAGE = 0xD9
_HEAD = 2**16  # number of bytes of which a header is read
_SQUARE = 0.01  # part by which pixels may be wider than high to count as squares
_PICTURES = ("", "composite.combined", "rgba", "rgb", "combined", "beauty")
"""Ends of the name of the layer that shows the whole picture, the first one first."""
_ORIENTATION, _EXIF, _INTEROPERABILITY = 0x0112, 0x8769, 0xA005
_COLOUR_SPACE, _WHITE_POINT, _PRIMARIES = 0xA001, 0x013E, 0x013F
_UNCALIBRATED = 0xFFFF  # tag numbers of EXIF, and its value for a colour space of no name
_PHOTOMETRIC = {
    **{0: "", 1: "", 2: "", 3: "", 5: "CMYK", 6: "", 8: "CIELab"},
    **{4: "a mask", 9: "ICCLab", 10: "ITULab"},
    **{32803: "raw", 34892: "raw", 32844: "LogL", 32845: "LogLuv"},
}
"""Names of TIFF's photometric interpretations; those without a name are grey or RGB."""


@dataclass(frozen=True)
class Picture:
    """An opened picture, upright, in the numbers of its file.

    Attributes:
        height: height in pixels.
        width: width in pixels.
        rows: `rows(top, bottom)` returns float32 values `(bottom - top, W, C)`, 1 for the largest
            integer.
        colours: indices of the channels of colour, one or three.
        alpha: index of the alpha channel; None without one.
        most: largest integer of the file; 0 for floats.
        is_radiance: whether the file holds radiance, as OpenEXR does.
        is_multiplied: whether the colours are multiplied by alpha already.
        conversion: conversion of the colours to sRGB.
        cautions: what may be wrong with it.
    """

    height: int
    width: int
    rows: Callable[[int, int], np.ndarray]
    colours: Sequence[int]
    alpha: int | None
    most: int
    is_radiance: bool
    is_multiplied: bool
    conversion: Conversion
    cautions: tuple[Caution, ...] = ()


CheckSize = Callable[[int, int, int], None]
"""A check of a picture's width, height and channels before it is decoded; it raises ValueError."""


def open_picture(path: Path, check_size: CheckSize) -> Picture:
    """Open and decode a picture of any size and kind.

    Raises:
        ValueError: if it is no picture that can be read; the message may have the reason alone.
    """
    with path.open("rb") as file:
        head = file.read(64)
    if head[:2] == b"BM" and head[28:31] != b"\x20\0\0":  # 32 bits, of which some may be alpha
        return _open_by_pillow(path, check_size, "BMP")
    if head[4:8] == _FTYP:
        brands = {head[at : at + 4] for at in (8, *range(16, 64, 4))}
        if brands.intersection(_AVIF):
            return _open_by_pillow(path, check_size, "AVIF")
        if brands.intersection(_HEIF):
            return _open_heif(path, check_size)
    return _open(path, check_size)


def open_image(path: Path, *, subimage: int = 0, straight: bool = False) -> oiio.ImageBuf:
    """Return a picture of OpenImageIO, of which the header alone was read.

    Args:
        path: path of the file.
        subimage: number of the part of the file.
        straight: whether colours with unassociated alpha are kept so, not multiplied by alpha.

    Raises:
        ValueError: if the library cannot read it, its format is none of `FORMATS`, or it holds
            deep pixels, a volume or a cube map; the message has the reason alone.
    """
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", int(straight))
    config.attribute("pnm:pfmflip", 1)  # a PFM begins with its lowest row
    image = oiio.ImageBuf(str(path), subimage, 0, config)
    if image.has_error:
        raise ValueError(f"{image.geterror().strip()}; check the path, or export it anew")
    spec = image.spec()
    if image.file_format_name not in FORMATS:
        raise ValueError(f"it is {image.file_format_name.upper()}: save it as PNG, TIFF or OpenEXR")
    if spec.deep:
        raise ValueError("its pixels are deep, with samples at many distances: flatten it")
    if spec.depth > 1:
        raise ValueError(f"it is a volume of {spec.depth} slices: save one as a picture")
    if "cube" in spec.get_string_attribute("textureformat").lower():
        raise ValueError("it is a cube map: convert it to one picture, a panorama say")
    return image


# ---- OpenImageIO -----------------------------------------------------------------------------


def _open(path: Path, check_size: CheckSize) -> Picture:
    # Check before decoding: the header says what cannot be read.
    image = _whole_page(path, open_image(path, straight=True))
    kind = image.file_format_name
    colours, alpha = _by_place(image.spec())
    if kind == "openexr":
        image, colours, alpha = by_name(path, image)
    spec = image.spec()
    window = image.roi_full if kind == "openexr" else image.roi
    if window.width * window.height == 0:
        raise ValueError("it holds no pixels")
    for area in (image.roi, window):
        check_size(area.width, area.height, spec.nchannels)
    shown = oiio.intersection(image.roi, window)
    if min(shown.width, shown.height) <= 0:
        raise ValueError("its display window holds no data: save it whole")
    if kind == "jpeg":
        _check_end(path)
    if kind == "targa" or (kind == "tiff" and _is_lab(spec)):
        return _open_by_pillow(path, check_size, "TIFF" if kind == "tiff" else "TGA")
    tags, turned = _tags(path, image), orientation(path, image)
    most = _largest_integer(spec)
    conversion = colour_space.decide(tags, len(colours), deep=most != 255)
    cautions = conversion.cautions
    # Decode, in the file's own numbers, which take a quarter of the memory of floats.
    if not image.read(image.subimage, force=True):
        raise ValueError(f"{image.geterror().strip()}; export it anew, as PNG say")
    # What lies outside of the display window is not turned with it.
    if kind == "openexr" and (turned > 1 or not image.roi.contains(window)):
        image = oiio.ImageBufAlgo.crop(image, roi=window)
    if turned > 1:
        image.orientation = turned
        image = oiio.ImageBufAlgo.reorient(image)
        window = image.roi
    # OpenImageIO inverts 8 bits of which 0 is white, and no others.
    is_negative = most > 255 and spec.get_int_attribute("tiff:PhotometricInterpretation", 1) == 0
    aspect = spec.get_float_attribute("PixelAspectRatio", 1.0)
    if kind == "openexr" and abs(aspect - 1) > _SQUARE:
        cautions += (
            Caution(
                "oblong-pixels",
                f"its pixels are {aspect:.3g} times as wide as high, and are read as squares: "
                "resize it so that they are",
            ),
        )

    def rows(top: int, bottom: int) -> np.ndarray:
        across = (window.xbegin, window.xend, window.ybegin + top, window.ybegin + bottom)
        values = image.get_pixels(oiio.FLOAT, oiio.ROI(*across))
        if values is None:
            raise ValueError(image.geterror())
        values = values.reshape(bottom - top, window.width, -1)
        if is_negative:
            values[..., 0] = 1 - values[..., 0]
        return values

    return Picture(
        window.height,
        window.width,
        rows,
        colours,
        alpha,
        most,
        is_radiance=kind in _LINEAR,
        is_multiplied=not spec.get_int_attribute("oiio:UnassociatedAlpha")
        and kind not in _STRAIGHT,
        conversion=conversion,
        cautions=cautions,
    )


def _whole_page(path: Path, image: oiio.ImageBuf) -> oiio.ImageBuf:
    """Return the first page that is no thumbnail; raise ValueError if there is none, as in raw."""
    page = 0
    while image.spec().get_int_attribute("tiff:subfiletype") & 1:
        page += 1
        try:
            image = open_image(path, subimage=page, straight=True)
        except ValueError as error:
            raise ValueError(
                "it shows a thumbnail alone, as raw files do: develop it, and save it as TIFF"
            ) from error
    return image


def _largest_integer(spec: oiio.ImageSpec) -> int:
    integers = {oiio.UINT8: 255, oiio.UINT16: 65535, oiio.UINT32: 2**32 - 1}
    return integers.get(spec.format.basetype, 0)


def _by_place(spec: oiio.ImageSpec) -> tuple[list[int], int | None]:
    """Return the indices of the channels of colour and of alpha, in formats that have an order."""
    alpha = spec.alpha_channel
    if not 0 < alpha < spec.nchannels:
        alpha = spec.channelnames.index("A") if "A" in spec.channelnames else 0  # of a GIF
    return [0, 1, 2] if spec.nchannels >= 3 else [0], alpha or None


def by_name(path: Path, image: oiio.ImageBuf) -> tuple[oiio.ImageBuf, list[int], int | None]:
    """Return the part of an OpenEXR that shows the picture, and its channels of colour and alpha.

    Raises:
        ValueError: if there are several layers, and none is called as the picture.
    """
    layers: dict[str, tuple[int, dict[str, int]]] = {}
    for part in range(max(image.nsubimages, 1)):
        spec = (image if part == 0 else open_image(path, subimage=part)).spec()
        name = spec.get_string_attribute("oiio:subimagename")
        for index, channel in enumerate(spec.channelnames):
            layer, _, last = channel.rpartition(".")
            whole = ".".join(filter(None, (name, layer)))
            layers.setdefault(whole, (part, {}))[1][last.upper()] = index
    pictures = {
        name: place
        for name, place in layers.items()
        if {*"RGB"} <= place[1].keys() and "crypto" not in name.casefold()
    }
    ends = (f".{called}" for called in _PICTURES)
    groups = ([name for name in pictures if f".{name}".casefold().endswith(end)] for end in ends)
    chosen = next(filter(None, groups), list(pictures))
    if len(chosen) > 1:
        raise ValueError(
            f"it holds the layers {', '.join(sorted(chosen))}, and not one alone is called "
            "Combined or RGBA: save the picture alone"
        )
    if chosen:
        part, channels = pictures[chosen[0]]
        colours = [channels[letter] for letter in "RGB"]
    else:
        part, channels = next(iter(layers.values()))
        if channels.keys() & {"RY", "BY"}:
            raise ValueError("it holds luminance and chroma: save it as R, G and B")
        grey = [index for letter, index in channels.items() if letter != "A"]
        if len(layers) > 1 or len(grey) != 1:
            names = ", ".join(image.spec().channelnames)
            raise ValueError(f"it has the channels {names}: name those of the picture R, G and B")
        colours = grey
    image = image if part == 0 else open_image(path, subimage=part)
    return image, colours, channels.get("A")


# ---- what the file says of itself ------------------------------------------------------------


def _tags(path: Path, image: oiio.ImageBuf) -> Tags:
    """Return what a file says of its colours."""
    kind, spec = image.file_format_name, image.spec()
    space = spec.get_string_attribute("oiio:ColorSpace")
    if kind == "openexr" and space and oiio.ColorConfig().equivalent(space, "sRGB"):
        return Tags()  # converted from a photo, and not made linear
    if kind in _LINEAR:
        return Tags(chromaticities=chromaticities(path, image), curve=colour_space.linear)
    if kind == "pnm" and not _largest_integer(spec):
        return Tags(curve=colour_space.linear)
    profile, points = spec.getattribute("ICCProfile"), spec.getattribute("CICP")
    profile = None if profile is None else bytes(profile)
    tags = Tags(profile=profile, code_points=points and (int(points[0]), int(points[1])))
    if kind in _OF_PILLOW:
        tags = _by_pillow(path, lambda opened: of_pillow(opened, path)) or tags
        # Pillow reads no profile of a JPEG 2000, and knows the first page of a TIFF alone.
        if profile is not None and (kind == "jpeg2000" or image.subimage > 0):
            tags = replace(tags, profile=profile)
    if kind == "tiff" and not _largest_integer(spec) and tags == Tags():
        raise ValueError(
            "its numbers are floats or signed, and it does not say whether they are linear: "
            "save it as OpenEXR if they are, else in 16 bits, or with a colour profile"
        )
    return tags


def orientation(path: Path, image: oiio.ImageBuf) -> int:
    """Return the orientation by EXIF, or else by XMP, 1 to 8."""
    orientation = image.orientation
    if orientation == 1 and image.file_format_name in _OF_PILLOW:
        orientation = _by_pillow(path, lambda opened: opened.getexif().get(_ORIENTATION, 1))
    return orientation if orientation in range(1, 9) else 1  # some cameras write 0


def _by_pillow(path: Path, ask: "Callable[[Image.Image], Any]") -> Any:
    """Return what Pillow says of a file's header; None if it cannot read it."""
    from PIL import Image

    try:
        with Image.open(path) as opened:
            return ask(opened)
    except Exception:  # of damaged tags, whose pixels may be sound
        return None


def chromaticities(path: Path, image: oiio.ImageBuf) -> tuple[float, ...] | None:
    """Return the chromaticities, as `colour_space.REC709`, of a file of radiance, or None."""
    is_exr = image.file_format_name == "openexr"
    return _of_exr(image.spec()) if is_exr else _of_radiance(path)


def of_pillow(image: "Image.Image", path: Path | None = None) -> Tags:
    """Return what a PIL image says of its colours.

    Args:
        image: image, of which its file's header is read.
        path: its file; by default the one that it names, if it is there.
    """
    info, file = image.info, path or Path(getattr(image, "filename", ""))
    points, is_narrow, profile = None, False, None
    if "icc_profile" in info:
        profile = info["icc_profile"] or b"broken"  # Pillow has None where it could not read one
    if image.format == "PNG" and file.is_file():
        points, is_narrow = _png_code_points(file)
    elif image.format == "AVIF" and file.is_file() and not profile:
        points = _nclx(file)
    elif image.format == "HEIF" and not profile and (nclx := info.get("nclx_profile")):
        points = int(nclx["color_primaries"]), int(nclx["transfer_characteristics"])
    elif image.format == "BMP" and file.is_file():
        return _of_bmp(file)
    white_first = info.get("chromaticity")
    exif = image.getexif()
    own, with_others = _part(exif, _EXIF), _part(exif, _INTEROPERABILITY)
    space, exponent, primaries = own.get(_COLOUR_SPACE), info.get("gamma"), None
    if white_first and image.format == "PNG":
        primaries = (*white_first[2:], *white_first[:2])
    elif len(numbers := (*exif.get(_PRIMARIES, ()), *exif.get(_WHITE_POINT, ()))) == 8:
        primaries = tuple(map(float, numbers))
    if space == 2 or (space != 1 and str(with_others.get(1, "")).startswith("R03")):
        # Adobe RGB, as the rules for cameras (DCF 2.0) and their makers mark it.
        primaries, exponent = colour_space.ADOBE, 256 / 563
    return Tags(
        points,
        profile,
        "srgb" in info or space == 1,
        exponent,
        primaries,
        is_unspecified=space == _UNCALIBRATED or image.mode == "CMYK",
        is_narrow=is_narrow,
    )


def _part(exif: "Image.Exif", number: int) -> dict[int, Any]:
    """Return a part of EXIF by its number; nothing if it is missing or damaged."""
    try:
        return exif.get_ifd(number)
    except Exception:  # whatever damaged bytes lead Pillow to
        return {}


def _png_code_points(path: Path) -> tuple[tuple[int, int] | None, bool]:
    """Return the primaries and the curve of a PNG's chunk cICP, and whether its range is narrow."""
    header = oiio.ImageBuf(str(path))
    header.geterror()  # fetched, as it would be printed otherwise
    numbers = header.spec().getattribute("CICP")
    if numbers is None:
        return None, False
    return (int(numbers[0]), int(numbers[1])), not numbers[3]


def _of_bmp(path: Path) -> Tags:
    """Return what the header of a BMP says of its colours; only versions 4 and 5 say anything."""
    with path.open("rb") as file:
        head = file.read(138)
        size, space = int.from_bytes(head[14:18], "little"), head[70:74][::-1]
        if size < 108 or (space == bytes(4) and not any(head[74:110])):
            return Tags()
        if space == b"MBED" and size >= 124:
            offset, length = struct.unpack_from("<II", head, 126)
            file.seek(14 + offset)
            return Tags(profile=file.read(length))
    return Tags(is_unspecified=space not in (b"sRGB", b"Win "))


def _of_exr(spec: oiio.ImageSpec) -> tuple[float, ...] | None:
    """Return the chromaticities of an OpenEXR, given by numbers or by the name of a space."""
    numbers = spec.getattribute("chromaticities")
    if numbers is not None and len(numbers) == 8:
        return tuple(map(float, numbers))
    if spec.get_int_attribute("openexr:ACESImageContainerFile"):
        return colour_space.ACES
    space = spec.get_string_attribute("oiio:ColorSpace")
    config = oiio.ColorConfig()
    if space and config.isColorSpaceLinear(space):
        return tuple(config.get_chromaticities(space) or ()) or None
    return None


def _of_radiance(path: Path) -> tuple[float, ...] | None:
    """Return the chromaticities in the header of a Radiance file."""
    with path.open("rb") as file:
        head = file.read(_HEAD).split(b"\n\n")[0]
    if match := re.search(rb"^PRIMARIES=\s*(.+)$", head, re.MULTILINE):
        numbers = tuple(map(float, match[1].split()))
        # Photoshop writes eight zeros where it knows none.
        return numbers if len(numbers) == 8 and any(numbers) else None
    return None


def _is_lab(spec: oiio.ImageSpec) -> bool:
    """Return whether a TIFF is in CIELab, which OpenImageIO cannot read; raise for other kinds."""
    number = spec.get_int_attribute("tiff:PhotometricInterpretation", 2)
    name = _PHOTOMETRIC.get(number, f"of the kind {number}")
    if name not in ("", "CMYK", "CIELab"):
        raise ValueError(f"its colours are {name}: save it as RGB")
    return name == "CIELab"


def _open_by_pillow(path: Path, check_size: CheckSize, kind: str) -> Picture:
    """Open what Pillow reads rightly and OpenImageIO does not, such as TIFF of CIELab."""
    from PIL import Image, UnidentifiedImageError

    try:
        image = Image.open(path, formats=[kind])
    except UnidentifiedImageError as error:
        raise ValueError(f"it is {kind} of a kind that is not read: save it as PNG") from error
    with image:
        check_size(*image.size, len(image.getbands()))
        return of_image(image, path)


def _check_end(path: Path) -> None:
    """Raise ValueError if a JPEG ends before its end marker; its decoder fills what is missing."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = 2
        while match := _MARKER.search(data, place):
            marker, place = data[match.start() + 1], match.end()
            if marker == _END_OF_IMAGE:
                return
            # A segment begins with its length; the data of a scan lead to the next marker.
            place += int.from_bytes(data[place : place + 2])
    raise ValueError("it is cut short; copy it again")


# ---- HEIF ------------------------------------------------------------------------------------


def _open_heif(path: Path, check_size: CheckSize) -> Picture:
    """Open a phone's HEIC; the wheels of OpenImageIO do not support it."""
    import pillow_heif

    # The image is upright already: the library applies the file's rotation.
    with pillow_heif.HeifImageFile(path) as image:
        check_size(*image.size, 4)
        return of_image(image, path)


def _nclx(path: Path) -> tuple[int, int] | None:
    """Return the primaries and the transfer curve in the head of an AVIF (ISO/IEC 23008-12)."""
    with path.open("rb") as file:
        _, found, numbers = file.read(_HEAD).partition(b"colrnclx")
    return (int.from_bytes(numbers[:2]), int.from_bytes(numbers[2:4])) if found else None


def of_image(image: "Image.Image", path: Path | None = None) -> Picture:
    """Return a PIL image, turned upright, as `open_picture` returns its file.

    Args:
        image: image of 8 bits a channel.
        path: its file, as `of_pillow` takes it.

    Raises:
        OSError: if its file is cut short, or whatever else its decoder raises.
    """
    from PIL import ImageCms, ImageOps

    image.load()
    tags, image = of_pillow(image, path), ImageOps.exif_transpose(image)
    if image.mode == "LAB":
        lab, srgb = ImageCms.createProfile("LAB"), ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(image, lab, srgb, outputMode="RGB")
        return of_levels(np.asarray(converted), Tags())
    mode = image.mode
    if image.has_transparency_data:
        mode = "LA" if mode in ("LA", "La") else "RGBA"
    elif mode != "L":
        mode = "L" if mode == "1" else "RGB"
    return of_levels(np.asarray(image.convert(mode)), tags)


def of_levels(levels: np.ndarray, tags: Tags) -> Picture:
    """Return a picture of integers `(H, W)` or `(H, W, C)`, its colours not multiplied by alpha."""
    levels = levels.reshape(*levels.shape[:2], -1)
    channels, most = levels.shape[-1], int(np.iinfo(levels.dtype).max)
    colours = [0, 1, 2] if channels >= 3 else [0]
    conversion = colour_space.decide(tags, len(colours), deep=most != 255)
    return Picture(
        len(levels),
        levels.shape[1],
        lambda top, bottom: levels[top:bottom] / np.float32(most),
        colours,
        channels - 1 if channels in (2, 4) else None,
        most,
        is_radiance=False,
        is_multiplied=False,
        conversion=conversion,
        cautions=conversion.cautions,
    )
