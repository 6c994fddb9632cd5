"""The colour space of a picture, by every way in which a file may tell it: right values."""

import functools
import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pillow_heif
import pytest
from hdr_curves import hlg, pq
from icc_profiles import FORMULA, GAMMA, LINEAR, TABLE, TO_BT2020, TO_P3, TO_XYZ_D50, profile
from PIL import Image
from written_pictures import write

from lime_keras.io import colour_space, photo
from tests.stability.srgb_standard import encoded as srgb

# A chart of linear Rec. 709, inside the gamut of every space below.
PATCHES = np.array(
    [
        *([0.50, 0.10, 0.05], [0.05, 0.40, 0.10], [0.05, 0.08, 0.45], [0.18, 0.18, 0.18]),
        *([0.60, 0.45, 0.20], [0.01, 0.02, 0.015], [0.80, 0.80, 0.75], [0.30, 0.05, 0.30]),
    ]
)
SIDE = 16
# From linear Rec. 709 to more linear spaces, as their publications print the matrices, rounded.
TO_ADOBE = np.array([[0.71513, 0.28487, 0], [0, 1, 0], [0, 0.04117, 0.95883]])
TO_AP1 = np.array([[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0135], [0.0206, 0.1096, 0.8698]])
TO_AP0 = np.array([[0.4397, 0.3830, 0.1773], [0.0898, 0.8134, 0.0968], [0.0175, 0.1115, 0.8709]])
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


exr = functools.partial(write, kind=oiio.HALF)


def chart(values):
    """A picture of patches in two rows, `(2 SIDE, 4 SIDE, C)`."""
    rows = np.asarray(values).reshape(2, 4, -1)
    return rows.repeat(SIDE, 0).repeat(SIDE, 1)


def patches(image):
    return image.reshape(2, SIDE, 4, SIDE, -1)[:, 4:-4, :, 4:-4].mean((1, 3)).reshape(8, -1)


def levels(values, kind=np.uint8):
    most = np.iinfo(kind).max
    return np.round(np.clip(values, 0, 1) * most).astype(kind)


def png(path, pixels, **chunks):
    """Write a PNG by hand, of 8 or 16 bits, with chunks before its pixels."""
    height, width, channels = pixels.shape
    head = struct.pack(
        ">IIBBBBB", width, height, 8 * pixels.itemsize, {1: 0, 3: 2}[channels], 0, 0, 0
    )
    rows = pixels.astype(f">u{pixels.itemsize}").reshape(height, -1)
    data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    out = b"\x89PNG\r\n\x1a\n"
    for name, content in {"IHDR": head, **chunks, "IDAT": data, "IEND": b""}.items():
        body = name.encode() + content
        out += struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))
    path.write_bytes(out)
    return path


def icc(content):
    return {"iCCP": b"p\0\0" + zlib.compress(content)}


CASES = {
    "cICP, P3": lambda p: png(
        p, levels(srgb(chart(PATCHES @ TO_P3.T))), cICP=bytes([12, 13, 0, 1])
    ),
    "cICP, PQ": lambda p: png(
        p, levels(pq(chart(PATCHES @ TO_BT2020.T)), np.uint16), cICP=bytes([9, 16, 0, 1])
    ),
    "cICP, HLG": lambda p: png(
        p, levels(hlg(chart(PATCHES @ TO_BT2020.T)), np.uint16), cICP=bytes([9, 18, 0, 1])
    ),
    "cICP before ICC": lambda p: png(
        p, levels(chart(PATCHES), np.uint16), cICP=bytes([1, 8, 0, 1]), **icc(profile(GAMMA))
    ),
    "ICC before gamma": lambda p: png(
        p, levels(chart(PATCHES), np.uint16), gAMA=struct.pack(">I", 45_455), **icc(profile(LINEAR))
    ),
    "gamma": lambda p: png(p, levels(chart(PATCHES) ** (1 / 1.8)), gAMA=struct.pack(">I", 55_556)),
    "gamma and chromaticities": lambda p: png(
        p,
        levels(chart(PATCHES @ TO_P3.T) ** (1 / 1.8)),
        gAMA=struct.pack(">I", 55_556),
        cHRM=struct.pack(">8I", 31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000),
    ),
    "sRGB before gamma": lambda p: png(
        p, levels(srgb(chart(PATCHES))), sRGB=b"\0", gAMA=struct.pack(">I", 55_556)
    ),
    "gamma of sRGB": lambda p: png(p, levels(srgb(chart(PATCHES))), gAMA=struct.pack(">I", 45_455)),
    "ICC, gamma": lambda p: png(
        p, levels(chart(PATCHES) ** (1 / 1.8), np.uint16), **icc(profile(GAMMA))
    ),
    "ICC, formula": lambda p: png(
        p,
        levels(srgb(chart(PATCHES @ TO_P3.T)), np.uint16),
        **icc(profile(FORMULA, TO_XYZ_D50 @ np.linalg.inv(TO_P3))),
    ),
    "ICC, table": lambda p: png(p, levels(chart(PATCHES) ** 0.5, np.uint16), **icc(profile(TABLE))),
    "ICC, 8 bits": lambda p: png(p, levels(chart(PATCHES) ** (1 / 1.8)), **icc(profile(GAMMA))),
    "JPEG 2000, ICC": lambda p: jp2(
        p.with_suffix(".jp2"),
        levels(srgb(chart(PATCHES @ TO_P3.T))),
        profile(FORMULA, TO_XYZ_D50 @ np.linalg.inv(TO_P3)),
    ),
    "EXIF, Adobe RGB": lambda p: exif(p.with_suffix(".jpg"), 0xFFFF, "R03"),
    "EXIF, Adobe RGB by number": lambda p: exif(p.with_suffix(".jpg"), 2, None),
    "EXIF of a HEIC, Adobe RGB": lambda p: exif(p.with_suffix(".heic"), 0xFFFF, "R03"),
    "EXR, ACEScg": lambda p: exr(
        p.with_suffix(".exr"),
        chart(PATCHES @ TO_AP1.T),
        chromaticities=(oiio.TypeDesc("float[8]"), AP1),
    ),
    "EXR, ACES container": lambda p: exr(
        p.with_suffix(".exr"),
        chart(PATCHES @ TO_AP0.T),
        chromaticities=(oiio.TypeDesc("float[8]"), colour_space.ACES),
    ),
    "EXR, XYZ": lambda p: exr(
        p.with_suffix(".exr"),
        chart(PATCHES @ TO_XYZ.T),
        chromaticities=(oiio.TypeDesc("float[8]"), (1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3)),
    ),
    "Radiance, primaries": lambda p: radiance(p.with_suffix(".hdr")),
    "PFM": lambda p: pfm(p.with_suffix(".pfm")),
    "TIFF, CIELab": lambda p: lab(p.with_suffix(".tif")),
    "cICP, narrow": lambda p: png(
        p,
        np.round(4096 + 56064 * srgb(chart(PATCHES))).astype(np.uint16),
        cICP=bytes([1, 13, 0, 0]),
    ),
    "AVIF, P3": lambda p: avif(p.with_suffix(".avif"), srgb(chart(PATCHES @ TO_P3.T)), 12, 13),
    "BMP, profile": lambda p: bmp(
        p.with_suffix(".bmp"), chart(PATCHES) ** (1 / 1.8), b"DEBM", profile(GAMMA)
    ),
    "EXR, encoded": lambda p: exr(
        p.with_suffix(".exr"), srgb(chart(PATCHES)), **{"oiio:ColorSpace": ("string", "sRGB")}
    ),
}


DEEP = {
    **dict.fromkeys(("cICP before ICC", "ICC before gamma"), 0.03),
    **dict.fromkeys(("cICP, PQ", "cICP, HLG"), 0.02),
    **dict.fromkeys(("ICC, gamma", "ICC, formula", "ICC, table"), 0.02),
    "cICP, narrow": 0.005,
}
"""Cases of 16 bits, and what 8 of them may differ by."""


def jp2(path, pixels, content):
    """Write a JPEG 2000 without losses, whose header has a profile in place of sRGB's number."""
    Image.fromarray(pixels).save(path)
    data = bytearray(path.read_bytes())
    box = struct.pack(">I4sBBB", 11 + len(content), b"colr", 2, 0, 0) + content
    start, header = data.index(b"colr") - 4, data.index(b"jp2h") - 4
    data[start : start + 15] = box
    (length,) = struct.unpack_from(">I", data, header)
    struct.pack_into(">I", data, header, length + len(box) - 15)
    path.write_bytes(data)
    return path


def exif(path, space, interoperability):
    tags = Image.Exif()
    tags[0x8769] = {0xA001: space}
    if interoperability:
        tags[0x8769][0xA005] = {1: interoperability, 2: b"0100"}
    adobe = levels(chart(PATCHES @ TO_ADOBE.T) ** (256 / 563))
    pillow_heif.register_heif_opener()
    whole = {"chroma": 444, "save_nclx_profile": False}
    whole = whole if path.suffix == ".heic" else {"subsampling": 0}
    Image.fromarray(adobe).save(path, quality=98, exif=tags, **whole)
    return path


def test_dark_greys_of_adobe_rgb_keep_their_curve(tmp_path):
    """Which is a power, far below sRGB's near black."""
    tags = Image.Exif()
    tags[0x8769] = {0xA001: 2}
    encoded = np.array([5, 10, 20, 40, 80, 160], np.uint8)
    pixels = encoded[:, None, None].repeat(16, 0).repeat(16, 1).repeat(3, 2)
    Image.fromarray(pixels).save(path := tmp_path / "greys.jpg", quality=100, exif=tags)
    expected = srgb((encoded / 255) ** (563 / 256))
    found = photo.load(path)[0][8::16, 8]
    assert np.abs(found - expected[:, None]).max() < 1 / 255


def radiance(path):
    mantissa, exponent = np.frexp(chart(PATCHES @ TO_P3.T))
    shared = exponent.max(-1, keepdims=True)
    bytes_ = np.concatenate([mantissa * 2.0 ** (exponent - shared) * 256, shared + 128], -1)
    head = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"
    head += "PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329\n\n"
    # Lines of fewer than 8 pixels are not compressed, so the picture is made of columns.
    head += f"-Y {2 * SIDE} +X {4 * SIDE}\n"
    rows = b""
    for row in bytes_.astype(np.uint8):
        rows += bytes([2, 2, 0, 4 * SIDE])
        for channel in row.T:
            rows += bytes([4 * SIDE]) + channel.tobytes()
    path.write_bytes(head.encode() + rows)
    return path


def pfm(path):
    rows = chart(PATCHES)[::-1].astype("<f4")
    path.write_bytes(f"PF\n{4 * SIDE} {2 * SIDE}\n-1.0\n".encode() + rows.tobytes())
    return path


def lab(path):
    xyz = chart(PATCHES @ TO_XYZ_D50.T) / [0.9642, 1, 0.8251]
    cubes = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    x, y, z = np.moveaxis(cubes, -1, 0)
    star = np.stack([(116 * y - 16) * 2.55, 500 * (x - y), 200 * (y - z)], -1)
    # The standard of TIFF has a* and b* in bytes with a sign.
    Image.fromarray(np.round(star).astype(np.int16).astype(np.uint8), "LAB").save(path)
    return path


def avif(path, pixels, primaries, transfer):
    Image.fromarray(levels(pixels)).save(path, quality=98, subsampling="4:4:4")
    head, mark, rest = path.read_bytes().partition(b"colrnclx")
    path.write_bytes(head + mark + struct.pack(">HH", primaries, transfer) + rest[4:])
    return path


def bmp(path, pixels, space, content=b""):
    """Write a BMP of version 5 whose header names a colour space, and its profile at the end."""
    rows = levels(pixels)[::-1, :, ::-1]
    size = rows.nbytes
    head = struct.pack("<IiiHHIIiiII", 124, *rows.shape[1::-1], 1, 24, 0, size, 0, 0, 0, 0)
    head += bytes(16) + space + bytes(35) + b"\1" + bytes(12)
    head += struct.pack("<IIII", 4, 124 + size, len(content), 0)
    path.write_bytes(
        b"BM" + struct.pack("<IHHI", 138 + size, 0, 0, 138) + head + rows.tobytes() + content
    )
    return path


@pytest.mark.parametrize("case", CASES)
def test_a_space_is_converted_from(case, tmp_path):
    """The values are those of the same chart in sRGB; JPEG and CIELab's bytes are coarse."""
    path = CASES[case](tmp_path / "chart.png")
    found = patches(photo.read_srgb(path))
    coarse = {".jpg": 0.025, ".tif": 0.03, ".hdr": 0.01, ".avif": 0.03, ".heic": 0.025}.get(
        path.suffix, 0.006
    )
    np.testing.assert_allclose(found, srgb(PATCHES), atol=coarse)


@pytest.mark.parametrize("case", CASES)
def test_a_pil_image_gives_the_numbers_of_its_file(case, tmp_path):
    path = CASES[case](tmp_path / "chart.png")
    if path.suffix in (".exr", ".hdr", ".pfm", ".jp2"):
        pytest.skip("a PIL image has 8 bits a channel, and of a JPEG 2000 no profile")
    with Image.open(path) as image:
        found = photo.load_pil(image).image
    np.testing.assert_allclose(found, photo.read_srgb(path), atol=DEEP.get(case, 1e-6))


@pytest.mark.parametrize("content", [LINEAR, GAMMA, FORMULA, TABLE])
def test_a_profile_keeps_16_bits(content, tmp_path):
    """A dark ramp keeps all of its levels, and grey of the same curve has the same numbers."""
    ramp = np.linspace(0.0002, 0.02, 512).repeat(16).reshape(512, 16, 1)
    ramp = levels(ramp, np.uint16)
    found = photo.read_srgb(
        png(tmp_path / "a.png", ramp.repeat(3, -1), **icc(profile(content, TO_XYZ_D50 * 0.9)))
    )
    assert len(np.unique(found[..., 1])) > 400
    grey = photo.read_srgb(png(tmp_path / "g.png", ramp, **icc(profile(content, grey=True))))
    assert len(np.unique(grey[..., 1])) > 400
    expected = {
        LINEAR: lambda v: v,
        GAMMA: lambda v: v ** (461 / 256),
        FORMULA: lambda v: np.where(v < 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4),
        TABLE: lambda v: v**2,
    }[content](ramp / 65535)
    np.testing.assert_allclose(grey, srgb(expected).repeat(3, -1), atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "numbers", "expected"),
    [
        (0, (2.0,), lambda x: x**2),
        (1, (2.0, 1.25, -0.25), lambda x: np.where(x >= 0.2, (1.25 * x - 0.25) ** 2, 0)),
        (2, (2.0, 1.25, -0.25, 0.5), lambda x: np.where(x >= 0.2, (1.25 * x - 0.25) ** 2, 0) + 0.5),
    ],
)
def test_formulas_of_a_profile_are_those_of_icc_1(kind, numbers, expected):
    """Section 10.18; the curves of sRGB and of cameras are tried with whole profiles."""
    fixed = [round(number * 65536) for number in numbers]
    element = b"para" + bytes(4) + struct.pack(f">HH{len(fixed)}i", kind, 0, *fixed)
    values = np.linspace(0, 1, 41, dtype=np.float32)
    found = colour_space._curve(element)(values)
    np.testing.assert_allclose(found, expected(values), atol=2e-5)


def test_a_curve_of_another_kind_is_none():
    with pytest.raises(ValueError, match="neither a table nor a formula"):
        colour_space._curve(b"mft2" + bytes(8))
    with pytest.raises(ValueError, match="a formula that is not known"):
        colour_space._curve(b"para" + bytes(4) + struct.pack(">HH", 5, 0))


def test_a_profile_of_tables_is_told_to_cost_bits():
    """One that also has a table counts as one: LittleCMS, which has 8 bits here, converts it."""
    content = profile(GAMMA).replace(b"desc", b"A2B1", 1)
    (caution,) = colour_space.decide(colour_space.Tags(profile=content), 3, deep=True).cautions
    assert caution.code == "colours-8-bit"


@pytest.mark.parametrize(
    ("tags", "words"),
    [
        (colour_space.Tags(code_points=(3, 99)), "code points 3, 99"),
        (colour_space.Tags(is_unspecified=True), "not what they are"),
        (colour_space.Tags(profile=b"broken"), "profile is broken"),
        (colour_space.Tags(chromaticities=(0.3,) * 8), "make no colours"),
        (
            colour_space.Tags(chromaticities=(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0)),
            "no colours",
        ),
        (colour_space.Tags(chromaticities=(float("nan"),) * 8), "make no colours"),
    ],
)
def test_what_cannot_be_converted_is_told_and_read_as_srgb(tags, words):
    conversion = colour_space.decide(tags, 3, deep=False)
    values = np.float32([[[0, 0.5, 1]]])
    np.testing.assert_array_equal(conversion.convert(values), values)
    (caution,) = conversion.cautions
    assert caution.code == "colours-unknown" and words in caution.message


@pytest.mark.parametrize("space", [b"KNIL", bytes(4), b"BGRs"])
def test_a_linked_or_calibrated_space_of_a_bmp_is_told(space, tmp_path):
    found = photo.load(bmp(tmp_path / "a.bmp", srgb(chart(PATCHES)), space))
    np.testing.assert_allclose(patches(found.image), srgb(PATCHES), atol=0.5 / 255)
    codes = [] if space == b"BGRs" else ["colours-unknown"]
    assert [caution.code for caution in found.cautions] == codes


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_a_profile_of_which_a_part_is_missing_is_told(suffix, tmp_path):
    """Decoders pass over it, and so P3 would be read as sRGB."""
    path = tmp_path / f"a.{suffix}"
    if suffix == "png":
        png(path, levels(srgb(chart(PATCHES))), iCCP=b"p\0\0no stream")
    else:
        Image.fromarray(levels(srgb(chart(PATCHES)))).save(path, icc_profile=profile(GAMMA))
        content = path.read_bytes()
        path.write_bytes(content.replace(b"ICC_PROFILE\0\1\1", b"ICC_PROFILE\0\1\2"))
    (caution,) = photo.load(path).cautions
    assert "profile is broken" in caution.message


@pytest.mark.parametrize("number", sorted(colour_space._CURVES))
def test_every_curve_has_black_white_and_grows(number):
    values = colour_space._CURVES[number](np.linspace(0, 1, 101, dtype=np.float32)[:, None, None])
    assert values[0] == pytest.approx(0, abs=1e-6) and np.isfinite(values).all()
    assert (np.diff(values[:, 0, 0]) > 0).all()
    if number not in (16, 18):
        assert values[-1] == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize("name", ["REC709", "ADOBE", "ACES"])
def test_white_stays_white(name):
    matrix = colour_space.matrix(getattr(colour_space, name))
    np.testing.assert_allclose(matrix @ np.ones(3), 1, atol=1e-6)
