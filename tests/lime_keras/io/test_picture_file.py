"""Pictures by their content, channels by their names, alpha where it is a mask; no crash."""

import io
import struct

import numpy as np
import OpenImageIO as oiio
import pillow_heif
import pytest
from PIL import Image
from written_pictures import oriented

from lime_keras import Estimator
from lime_keras.io import normal_map, photo, picture_file, scanner
from lime_keras.render.scene import backgrounds, environments
from tests.fuzz import seeds
from tests.stability.srgb_standard import encoded

HEIGHT, WIDTH = 32, 48


def noise(channels=3):
    return np.random.default_rng(0).uniform(size=(HEIGHT, WIDTH, channels)).astype(np.float32)


def exr(path, *layers, window=None, at=(0, 0), part="", append=False, orientation=1):
    """Write an OpenEXR of layers, each `(H, W, C)` and the names of its channels."""
    pixels = np.concatenate([layer for layer, _ in layers], -1)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
    spec.channelnames = [name for _, names in layers for name in names]
    spec.x, spec.y = at
    spec.full_width, spec.full_height = window or pixels.shape[1::-1]
    spec.attribute("Orientation", orientation)
    if part:
        spec.attribute("oiio:subimagename", part)
    image = oiio.ImageBuf(spec)
    image.set_pixels(spec.roi, np.ascontiguousarray(pixels))
    assert image.write(str(path)), image.geterror()
    return path


def parts(path, named):
    """Write an OpenEXR of several parts, by name their `(H, W, C)` and channels."""
    specs = []
    for name, (pixels, channels) in named.items():
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
        spec.channelnames = channels
        spec.attribute("oiio:subimagename", name)
        specs.append(spec)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), specs)
    for index, (pixels, _) in enumerate(named.values()):
        if index:
            assert out.open(str(path), specs[index], "AppendSubimage")
        assert out.write_image(np.ascontiguousarray(pixels))
    out.close()
    return path


def named(layer, letters="RGB"):
    return [f"{layer}.{letter}" for letter in letters]


# Doors.


def deep(path):
    names = list("RGBAZ")
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 5, oiio.FLOAT)
    spec.channelnames, spec.deep = names, True
    data = oiio.DeepData()
    data.init(WIDTH * HEIGHT, 5, [oiio.TypeFloat] * 5, names)
    for pixel in range(WIDTH * HEIGHT):
        data.set_samples(pixel, 1)
        for channel, value in enumerate((0.5, 0.3, 0.2, 1.0, 5.0)):
            data.set_deep_value(pixel, channel, 0, value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_deep_image(data)
    out.close()
    return path


@pytest.mark.parametrize(
    "read",
    [
        photo.read,
        lambda path: photo.read_mask(path, HEIGHT, WIDTH),
        lambda path: photo.read_radiance(path, HEIGHT, WIDTH),
        normal_map.read,
        environments.read,
        backgrounds.read,
    ],
    ids=["photo", "mask", "radiance", "normals", "environment", "background"],
)
def test_deep_pixels_are_refused_at_every_door(read, tmp_path):
    """Decoding them ends the process."""
    with pytest.raises(ValueError, match=r"deep\.exr.*deep.*flatten"):
        read(deep(tmp_path / "deep.exr"))


def test_cube_maps_and_formats_that_were_not_fuzzed_are_refused(tmp_path):
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, oiio.UINT8)
    spec.attribute("textureformat", "CubeFace Environment")
    image = oiio.ImageBuf(spec)
    assert image.write(str(tmp_path / "cube.tif"))
    with pytest.raises(ValueError, match="cube map: convert"):
        photo.read(tmp_path / "cube.tif")
    assert oiio.ImageBuf(noise()).write(str(tmp_path / "a.dpx"))
    with pytest.raises(ValueError, match="it is DPX: save it as PNG"):
        photo.read(tmp_path / "a.dpx")


def test_files_that_pillow_does_not_know_are_told_to_be_saved_anew(tmp_path):
    (tmp_path / "a.avif").write_bytes(bytes(4) + b"ftypavif" + bytes(64))
    with pytest.raises(ValueError, match=r"a\.avif.*it is AVIF of a kind that is not read: save"):
        photo.read(tmp_path / "a.avif")


def test_every_format_that_is_read_is_damaged_by_the_fuzzer(tmp_path):
    seeds.pictures(tmp_path)
    files = [next(path.iterdir()) for path in tmp_path.iterdir()]
    assert set(picture_file.FORMATS) <= {oiio.ImageBuf(str(one)).file_format_name for one in files}
    assert {one.suffix for one in files} <= set(scanner.SUFFIXES)


# Channels by name.


def test_the_picture_is_found_among_layers(tmp_path):
    """Before, the first three channels were the picture: ambient occlusion in Blender's files."""
    picture, other = noise(), np.full((HEIGHT, WIDTH, 3), 0.7, np.float32)
    depth = 5 * other[..., :1]
    cases = [
        exr(
            tmp_path / "blender.exr",
            (other, named("ViewLayer.AO")),
            (picture, named("ViewLayer.Combined")),
            (depth, ["ViewLayer.Depth.Z"]),
        ),
        exr(tmp_path / "root.exr", (other, named("diffuse")), (picture, ["R", "G", "B"])),
        exr(tmp_path / "only.exr", (depth, ["depth.Z"]), (picture, named("beauty.main"))),
        exr(
            tmp_path / "small.exr", (other, named("crypto00", "rgb")), (picture, named("x", "rgb"))
        ),
        exr(tmp_path / "order.exr", (picture[..., ::-1], named("RGBA", "BGR"))),
        exr(tmp_path / "ids.exr", (other, named("uCryptoAsset00")), (picture, named("rgba_main"))),
        exr(
            tmp_path / "composite.exr",
            (other, named("ViewLayer.Combined")),
            (picture, named("Composite.Combined")),
        ),
        parts(
            tmp_path / "parts.exr",
            {"depth": (depth, ["Z"]), "rgba": (picture, list("RGB")), "AO": (other, list("RGB"))},
        ),
    ]
    for path in cases:
        found, alpha = photo.read(path)
        np.testing.assert_allclose(found, encoded(picture), atol=1e-5, err_msg=path.name)
        assert alpha is None


def test_alpha_is_that_of_the_layer(tmp_path):
    mask = np.zeros((HEIGHT, WIDTH, 1), np.float32)
    mask[8:24, 8:24] = 1
    path = exr(
        tmp_path / "a.exr",
        (np.ones_like(mask), ["ViewLayer.Mist.A"]),
        (noise() * mask, named("ViewLayer.Combined")),
        (mask, ["ViewLayer.Combined.A"]),
    )
    np.testing.assert_array_equal(photo.read(path)[1], mask)


@pytest.mark.parametrize(
    ("layers", "words"),
    [
        ([(noise(), named("left")), (noise(), named("right"))], "layers left, right"),
        (
            [(noise(), named("Front.Combined")), (noise(), named("Back.Combined"))],
            "layers Back.Combined, Front.Combined, and not one alone",
        ),
        ([(noise(), ["Y", "RY", "BY"])], "luminance and chroma"),
        (
            [(noise(), ["normal.X", "normal.Y", "normal.Z"])],
            "channels normal.X, normal.Y, normal.Z",
        ),
    ],
)
def test_layers_of_which_none_is_the_picture_are_named(layers, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        photo.read(exr(tmp_path / "a.exr", *layers))


def test_floats_that_may_be_linear_or_not_are_refused(tmp_path):
    assert oiio.ImageBuf(noise()).write(str(tmp_path / "a.tif"))
    with pytest.raises(
        ValueError, match="does not say whether they are linear: save it as OpenEXR"
    ):
        photo.read(tmp_path / "a.tif")


def test_the_display_window_is_the_picture(tmp_path):
    """Its data may lie inside it, or reach beyond."""
    pixels = 0.1 + 0.9 * noise()
    path = exr(
        tmp_path / "in.exr", (pixels, list("RGB")), window=(WIDTH + 8, HEIGHT + 6), at=(5, 2)
    )
    found, _ = photo.read(path)
    expected = np.zeros((HEIGHT + 6, WIDTH + 8, 3), np.float32)
    expected[2 : 2 + HEIGHT, 5 : 5 + WIDTH] = encoded(pixels)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    path = exr(tmp_path / "out.exr", (pixels, list("RGB")), window=(30, 20), at=(-4, -3))
    np.testing.assert_allclose(photo.read(path)[0], encoded(pixels[3:23, 4:34]), atol=1e-5)
    path = exr(path, (pixels, list("RGB")), window=(30, 20), at=(-4, -3), orientation=6)
    expected = np.rot90(encoded(pixels[3:23, 4:34]), -1)
    np.testing.assert_allclose(photo.read(path)[0], expected, atol=1e-5)
    path = exr(tmp_path / "off.exr", (pixels, list("RGB")), window=(30, 20), at=(40, 0))
    with pytest.raises(ValueError, match="window holds no data: save it whole"):
        photo.read(path)


# TIFF, BMP and TGA.


def tiff(path, *pages):
    """Write a TIFF of pages, each `(H, W, C)` and the attributes of OpenImageIO."""
    specs = []
    for pixels, attributes in pages:
        kind = {1: oiio.UINT8, 2: oiio.UINT16, 4: oiio.UINT32}[pixels.itemsize]
        specs.append(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind))
        for name, value in attributes.items():
            specs[-1].attribute(name, value)
    out = oiio.ImageOutput.create(str(path))
    for index, (pixels, _) in enumerate(pages):
        assert out.open(str(path), specs[index], *(["AppendSubimage"] if index else []))
        assert out.write_image(np.ascontiguousarray(pixels))
    out.close()
    return path


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_of_negatives_white_is_white(kind, tmp_path):
    """OpenImageIO inverts those of 8 bits alone."""
    grey = noise(1)
    pixels = np.round(grey.astype(np.float64) * np.iinfo(kind).max).astype(kind)
    path = tiff(tmp_path / "a.tif", (np.iinfo(kind).max - pixels, {}))
    content = path.read_bytes()
    # PhotometricInterpretation (262), a short: 1 is black at 0, and 0 is white at 0.
    assert content.count(struct.pack("<HHIH", 262, 3, 1, 1)) == 1
    path.write_bytes(
        content.replace(struct.pack("<HHIH", 262, 3, 1, 1), struct.pack("<HHIH", 262, 3, 1, 0))
    )
    np.testing.assert_allclose(photo.read(path)[0], grey.repeat(3, -1), atol=0.6 / 255)


def test_a_thumbnail_is_not_the_picture(tmp_path):
    """Raw files begin with one, and hold their picture in another place."""
    levels = (noise() * 255).astype(np.uint8)
    thumbnail = levels[::2, ::2], {"tiff:subfiletype": 1}
    path = tiff(tmp_path / "a.tif", thumbnail, (levels[:16, :16], thumbnail[1]), (levels, {}))
    np.testing.assert_allclose(photo.read(path)[0], levels / 255, atol=1e-6)
    with pytest.raises(ValueError, match=r"a\.dng.*thumbnail alone.*develop it"):
        photo.read(tiff(tmp_path / "b.tif", thumbnail).rename(tmp_path / "a.dng"))


def test_bytes_of_a_bmp_and_a_tga_lie_where_their_heads_say(tmp_path):
    levels = np.dstack([(noise() * 255).astype(np.uint8), np.full((HEIGHT, WIDTH), 255, np.uint8)])
    levels[:, :20] = 0
    expected = levels[..., :3] / 255
    head = struct.pack("<IiiHHIIiiII", 108, WIDTH, HEIGHT, 1, 32, 3, levels.size, 0, 0, 0, 0)
    head += struct.pack("<IIII", 0xFF, 0xFF00, 0xFF0000, 0xFF000000) + b"BGRs".ljust(52, b"\0")
    head = b"BM" + struct.pack("<IHHI", 122 + levels.size, 0, 0, 122) + head
    (tmp_path / "a.bmp").write_bytes(head + levels[::-1].tobytes())
    grey = np.dstack([levels[..., 0], levels[..., 3]])
    head = struct.pack("<BBBHHBHHHHBB", 0, 0, 3, 0, 0, 0, 0, 0, WIDTH, HEIGHT, 16, 0x28)
    (tmp_path / "a.tga").write_bytes(head + grey.tobytes())
    for name, pixels in (("a.bmp", expected), ("a.tga", expected[..., :1].repeat(3, -1))):
        image, alpha = photo.read(tmp_path / name)
        np.testing.assert_allclose(image, pixels, atol=1e-6, err_msg=name)
        np.testing.assert_allclose(alpha, levels[..., 3:] / 255, err_msg=name)


# Content, not suffix.


def test_a_file_is_what_its_content_says(tmp_path):
    pillow_heif.register_heif_opener()
    image = Image.fromarray((noise() * 60 + 90).astype(np.uint8)).resize((96, 64))
    expected = np.asarray(image) / 255
    for kind, name, options in (
        ("JPEG", "a.HEIC", {"quality": 98, "subsampling": 0}),
        ("HEIF", "b.JPG", {"quality": -1, "chroma": 444}),
        ("AVIF", "c.png", {"quality": 98, "subsampling": "4:4:4"}),
        ("PNG", "d.jpg", {}),
        ("WEBP", "e.tif", {"lossless": True}),
    ):
        image.save(tmp_path / name, kind, **options)
        found = photo.read_srgb(tmp_path / name)
        np.testing.assert_allclose(found, expected, atol=8 / 255, err_msg=name)
        np.testing.assert_allclose(
            photo.load_pil(Image.open(tmp_path / name)).image, found, atol=1e-6, err_msg=name
        )


@pytest.mark.parametrize("suffix", ["jpg", "png", "avif", "webp", "tif"])
def test_an_orientation_turns_files_and_pil_images_alike(suffix, tmp_path):
    path = tmp_path / f"a.{suffix}"
    Image.fromarray((noise() * 255).astype(np.uint8)).save(path, exif=oriented(6))
    found = photo.read_srgb(path)
    assert found.shape == (WIDTH, HEIGHT, 3)
    np.testing.assert_allclose(photo.load_pil(Image.open(path)).image, found, atol=1e-6)


def test_an_orientation_that_xmp_alone_tells_is_applied(tmp_path):
    xmp = (
        b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-'
        b'syntax-ns#"><rdf:Description rdf:about="" xmlns:tiff="http://ns.adobe.com/tiff/1.0/" '
        b'tiff:Orientation="6"/></rdf:RDF></x:xmpmeta>'
    )
    path = tmp_path / "a.jpg"
    Image.fromarray((noise() * 255).astype(np.uint8)).save(path, xmp=xmp)
    assert photo.read_srgb(path).shape == (WIDTH, HEIGHT, 3)


def test_a_pil_image_cut_short_is_a_value_error():
    content = io.BytesIO()
    Image.fromarray((noise() * 255).astype(np.uint8)).save(content, "JPEG")
    with pytest.raises(ValueError, match="a PIL image cannot be read"):
        photo.load_pil(Image.open(io.BytesIO(content.getvalue()[:-400])))


# Alpha that is none, or is applied already.


def bmp(path, levels):
    """A BMP of 32 bits whose fourth byte is not used, as its header of version 3 has it."""
    height, width = levels.shape[:2]
    body = np.dstack([levels[::-1, :, ::-1], np.zeros((height, width), np.uint8)]).tobytes()
    head = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 32, 0, len(body), 2835, 2835, 0, 0)
    path.write_bytes(b"BM" + struct.pack("<IHHI", 54 + len(body), 0, 0, 54) + head + body)


def tga(path, levels):
    """A TGA of 32 bits that says it has no bits of alpha."""
    height, width = levels.shape[:2]
    head = struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, width, height, 32, 0x20)
    path.write_bytes(
        head + np.dstack([levels[..., ::-1], np.zeros((height, width), np.uint8)]).tobytes()
    )


def clear_png(path, levels):
    Image.fromarray(np.dstack([levels, np.zeros(levels.shape[:2], np.uint8)])).save(path)


def half_png(path, levels):
    Image.fromarray(np.dstack([levels, np.full(levels.shape[:2], 200, np.uint8)])).save(path)


@pytest.mark.parametrize("write", [bmp, tga, clear_png, half_png])
def test_alpha_that_masks_nothing_is_ignored_and_told(write, tmp_path):
    levels = (noise() * 255).astype(np.uint8)
    path = tmp_path / f"a.{ {bmp: 'bmp', tga: 'tga'}.get(write, 'png') }"
    write(path, levels)
    found = photo.load(path)
    np.testing.assert_allclose(found.image, levels / 255, atol=1e-6)
    assert found.alpha is None
    assert [caution.code for caution in found.cautions] == ["alpha-ignored"]
    pil = photo.load_pil(Image.open(path))
    np.testing.assert_allclose(pil.image, found.image, atol=1e-6)
    assert pil.alpha is None


def test_radiance_with_alpha_zero_everywhere_is_read(tmp_path):
    path = exr(
        tmp_path / "a.exr",
        (noise(), list("RGB")),
        (np.zeros((HEIGHT, WIDTH, 1), np.float32), ["A"]),
    )
    found = photo.load(path)
    np.testing.assert_allclose(found.image, encoded(noise()), atol=1e-5)
    assert found.alpha is None and found.cautions[0].code == "alpha-ignored"


def cut_out(brightness):
    """A disc with a soft edge, `(H, W, 4)` in [0, 1], its colours not multiplied by alpha."""
    y, x = np.mgrid[:64, :64] - 31.5
    alpha = np.clip((24 - np.hypot(x, y)) / 6 + 0.5, 0, 1)
    colours = np.where(alpha[..., None] > 0, [brightness, 0.8 * brightness, 0.5 * brightness], 0)
    return np.concatenate([colours, alpha[..., None]], -1)


@pytest.mark.parametrize("brightness", [0.15, 0.5, 0.9])
def test_colours_multiplied_by_alpha_are_not_multiplied_again(brightness, tmp_path):
    """Programs that cut objects out write either; composed over black, both are the same photo."""
    straight = cut_out(brightness)
    multiplied = straight.copy()
    multiplied[..., :3] *= straight[..., 3:]
    images = []
    for name, pixels in (("straight", straight), ("multiplied", multiplied)):
        path = tmp_path / f"{name}.png"
        Image.fromarray(np.round(pixels * 255).astype(np.uint8)).save(path)
        image, alpha = photo.read(path)
        np.testing.assert_allclose(alpha, straight[..., 3:], atol=0.5 / 255)
        np.testing.assert_allclose(photo.load_pil(Image.open(path)).image, image, atol=1e-6)
        images.append(image)
    np.testing.assert_allclose(images[0], multiplied[..., :3], atol=1.5 / 255)
    np.testing.assert_allclose(images[1], images[0], atol=1.5 / 255)


def test_what_a_reader_warns_of_is_told_with_the_material(tiny_model, tmp_path):
    clear_png(tmp_path / "a.png", (noise() * 255).astype(np.uint8))
    estimator = Estimator(tiny_model, only=["albedo"])
    material = estimator.estimate(tmp_path / "a.png")
    assert "alpha-ignored" in [caution.code for caution in material.warnings]
    # Its advice is to pass a mask.
    mask = np.ones(Image.open(tmp_path / "a.png").size[::-1], bool)
    material = estimator.estimate(tmp_path / "a.png", mask)
    assert "alpha-ignored" not in [caution.code for caution in material.warnings]
