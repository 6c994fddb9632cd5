"""Sound inputs to damage, made anew at every start: tiny, and the same bytes each time.

A seed is a folder. Most hold one file; those of corpora, models and results hold all files
that a command expects there.
"""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "fixtures"))

HEIGHT, WIDTH = 20, 24  # rows and columns of the pictures in pixels
SIZE = 32  # height and width in pixels of what corpora and models hold
_MAP = (8, 16)  # rows and columns of the environment maps


def make(folder: Path, names: tuple[str, ...]) -> None:
    """Write the seeds of doors into `FOLDER/DOOR/SEED/`; doors may share them."""
    for name in names:
        MAKERS[name](folder / name)


def _levels(channels: int = 3, kind: type = np.uint8) -> np.ndarray:
    """Return a picture of a disc before noise, `(HEIGHT, WIDTH, channels)`."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    disc = np.hypot(x - WIDTH / 2, y - HEIGHT / 2) < 8
    noise = np.random.default_rng(0).random((HEIGHT, WIDTH, channels)) * 0.3
    most = np.iinfo(kind).max if np.issubdtype(kind, np.integer) else 1
    return ((0.6 * disc[..., None] + noise) * most).astype(kind)


def _new(folder: Path, name: str, file: str) -> Path:
    """Return the path of a seed's file, in a new folder of the seed's own."""
    (folder / name).mkdir(parents=True)
    return folder / name / file


# ---- pictures --------------------------------------------------------------------------------


def pictures(folder: Path) -> None:
    """Write a picture in every format that is read, most through Pillow and OpenImageIO."""
    from PIL import Image, ImageCms

    grey, colours, alpha = (_levels(channels) for channels in (1, 3, 4))
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("XYZ")).tobytes()
    exif = Image.Exif()
    exif[0x0112] = 6  # turned
    rgb = Image.fromarray(colours)
    for name, image, file, options in (
        ("png", rgb, "photo.png", {"icc_profile": profile}),
        ("png-alpha", Image.fromarray(alpha), "photo.png", {}),
        ("png-palette", rgb.quantize(8), "photo.png", {}),
        ("jpeg", rgb, "photo.jpg", {"exif": exif, "icc_profile": profile}),
        ("jpeg-progressive", rgb, "photo.jpg", {"progressive": True}),
        ("jpeg-cmyk", rgb.convert("CMYK"), "photo.jpg", {}),
        ("webp", rgb, "photo.webp", {}),
        ("webp-lossless", Image.fromarray(alpha), "photo.webp", {"lossless": True, "exif": exif}),
        ("tiff-deflated", rgb, "photo.tiff", {"compression": "tiff_deflate"}),
        ("tiff-lzw", rgb, "photo.tif", {"compression": "tiff_lzw"}),
        ("gif", rgb.quantize(8), "photo.gif", {}),
        ("bmp", rgb, "photo.bmp", {}),
        ("tga", rgb, "photo.tga", {"compression": "tga_rle"}),
        ("ppm", rgb, "photo.ppm", {}),
        ("avif", rgb, "photo.avif", {"exif": exif}),
        ("tiff-lab", rgb.convert("LAB"), "photo.tif", {}),
        ("jp2", rgb, "photo.jp2", {}),
    ):
        image.save(_new(folder, name, file), **options)
    _heic(_new(folder, "heic", "photo.heic"), rgb)
    for name, file, image, options in (
        ("png-16", "photo.png", _levels(3, np.uint16), {}),
        ("png-grey", "photo.png", grey, {}),
        (
            "tiff-float",
            "photo.tif",
            _levels(3, np.float32),
            {"compression": "zip", "profile": _rgb_profile()},
        ),
        ("tiff-tiled", "photo.tif", colours, {"tile": 16}),
        ("hdr", "photo.hdr", _levels(3, np.float32), {}),
        *(
            (f"exr-{kind}", "photo.exr", _levels(4, np.float16), {"compression": kind})
            for kind in ("zip", "zips", "piz", "rle", "none")
        ),
        ("jxl", "photo.jxl", colours, {}),
        ("pfm", "photo.pfm", _levels(3, np.float32), {}),
        ("png-16-profile", "photo.png", _levels(3, np.uint16), {"profile": _rgb_profile()}),
        (
            "exr-layers",
            "photo.exr",
            _levels(4, np.float16),
            {"names": ("a.Combined.R", "a.Combined.G", "a.Combined.B", "a.Depth.Z")},
        ),
    ):
        _write(_new(folder, name, file), image, **options)


def _rgb_profile() -> bytes:
    """Return a profile of curves and a matrix, those of sRGB in another order."""
    from PIL import ImageCms

    content = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    return content.replace(b"rXYZ", b"????").replace(b"gXYZ", b"rXYZ").replace(b"????", b"gXYZ")


def _heic(path: Path, image: object) -> None:
    import pillow_heif

    pillow_heif.from_pillow(image).save(path, quality=80)


def _write(
    path: Path,
    pixels: np.ndarray,
    *,
    compression: str = "",
    tile: int = 0,
    names: tuple[str, ...] = (),
    profile: bytes = b"",
) -> None:
    """Write a picture `(H, W, C)` with OpenImageIO."""
    import OpenImageIO as oiio

    height, width, channels = pixels.shape
    kinds = {"f2": oiio.HALF, "f4": oiio.FLOAT, "u1": oiio.UINT8, "u2": oiio.UINT16}
    kind = kinds[pixels.dtype.str[1:]]
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("DateTime", "2000:01:01 00:00:00")
    if compression:
        spec.attribute("compression", compression)
    if names:
        spec.channelnames = names
    if profile:
        told = np.frombuffer(profile, np.uint8)
        spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), told)
    buffer = oiio.ImageBuf(spec)
    halves = kind == oiio.HALF  # which it takes as floats only
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32 if halves else None))
    if tile:
        buffer.set_write_tiles(tile, tile)
    if not buffer.write(str(path)):
        raise OSError(f"{path} cannot be written: {buffer.geterror()}")


def backgrounds(folder: Path) -> None:
    """Write the pictures that a background may be: all but those of phones."""
    pictures(folder)
    for name in ("heic", "avif"):
        shutil.rmtree(folder / name)


def masks(folder: Path) -> None:
    """Write masks of the pictures."""
    from PIL import Image

    grey, alpha = _levels(1)[..., 0], _levels(4)
    Image.fromarray(grey).save(_new(folder, "grey", "photo_mask.png"))
    Image.fromarray(grey > 128).save(_new(folder, "bits", "photo_mask.png"))
    Image.fromarray(alpha).save(_new(folder, "alpha", "photo_mask.png"))
    Image.fromarray(grey).save(_new(folder, "jpeg", "photo_mask.jpg"))


def normals(folder: Path) -> None:
    """Write the normals of a half ball, as OpenEXR and as PNG."""
    y, x = (np.mgrid[:HEIGHT, :WIDTH] + 0.5 - np.array([HEIGHT, WIDTH])[:, None, None] / 2) / 9
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    vectors = np.stack([x, -y, z], -1) * (z > 0)[..., None]
    names = ("normal.X", "normal.Y", "normal.Z")
    _write(_new(folder, "exr", "normals.exr"), vectors.astype(np.float32), names=names)
    for kind in (np.uint8, np.uint16):
        coded = (vectors + 1) / 2 * (z > 0)[..., None] * np.iinfo(kind).max
        _write(_new(folder, kind.__name__, "normals.png"), coded.astype(kind))


def environments(folder: Path) -> None:
    """Write environment maps with a lamp, as Radiance and OpenEXR."""
    light = np.full((*_MAP, 3), 0.2, np.float32)
    light[2, 5] = 30.0
    _write(_new(folder, "hdr", "light.hdr"), light)
    for kind in ("zip", "piz", "none"):
        path = _new(folder, f"exr-{kind}", "light.exr")
        _write(path, light.astype(np.float16), compression=kind)
    _write(_new(folder, "exr-grey", "light.exr"), light[..., :1], names=("Y",))


# ---- meshes and clips ------------------------------------------------------------------------


def meshes(folder: Path) -> None:
    """Write a coarse ball in every format of meshes, with normals and without."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1)
    for name, file, options in (
        ("ply", "mesh.ply", {"encoding": "binary"}),
        ("ply-text", "mesh.ply", {"encoding": "ascii"}),
        ("stl", "mesh.stl", {"file_type": "stl"}),
        ("stl-text", "mesh.stl", {"file_type": "stl_ascii"}),
        ("glb", "mesh.glb", {}),
        ("obj", "mesh.obj", {"include_normals": True}),
    ):
        ball.export(_new(folder, name, file), **options)
    table = "".join("v {} {} {}\n".format(*corner) for corner in ball.vertices[:8])
    polygons = "f 1 2 3 4 5\nf -1 -2 -3\nf 1/1/1 2//1 3\n"
    _new(folder, "obj-polygons", "mesh.obj").write_text(f"vn 0 0 1\n{table}{polygons}")


def clips(folder: Path) -> None:
    """Write short clips in usual containers and codecs."""
    import clips as files

    frames = files.noise(3, (32, 48))
    for name, codec in (
        *(("clip.mp4", "libx264"), ("clip.avi", "mpeg4"), ("clip.webm", "libvpx-vp9")),
        *(("clip.mov", None), ("clip.mkv", None), ("clip.ts", "libx264"), ("clip.m4v", "libx264")),
    ):
        files.write(_new(folder, name.partition(".")[2], name), frames, codec=codec)


# ---- corpora ---------------------------------------------------------------------------------


def corpora(folder: Path) -> None:
    """Write a corpus of spheres with two shards of one record."""
    import sphere_corpus

    sphere_corpus.write_split(folder / "spheres", "train", [range(1), range(1, 2)], size=SIZE)


def records(folder: Path) -> None:
    """Write the shard of a corpus without anything beside it."""
    import sphere_corpus

    (folder / "sphere").mkdir(parents=True)
    sphere_corpus.write_shard(folder / "sphere", 0, [sphere_corpus.example(0, size=SIZE)])
    (folder / "sphere" / "00000.json").unlink()


# ---- models ----------------------------------------------------------------------------------


def weights(folder: Path) -> None:
    """Write the files of untrained tiny models, as `lime-train` does."""
    import keras

    from lime_keras.model import weights as files
    from lime_keras.networks import Architecture, build

    for name, half in (("float32", False), ("float16", True)):
        keras.utils.set_random_seed(0)
        tiny = Architecture(size=32, unet_width=1, unet_depth=1, encoder_width=1, dense_width=1)
        files.save(folder / name, tiny, build(tiny), half=half)


def graphs(folder: Path) -> None:
    """Copy the smallest model of the package, whose weights lie in its graphs alone."""
    from lime_keras.model import folder as model_folder

    shutil.copytree(model_folder.PRETRAINED / "nano", folder / "nano")


def maskers(folder: Path) -> None:
    """Write a network of one convolution and a sigmoid that finds an object in a picture."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    kernel = np.random.default_rng(0).normal(size=(1, 3, 3, 3)).astype(np.float32)
    nodes = [
        helper.make_node("Conv", ["image", "kernel"], ["logits"], pads=[1, 1, 1, 1]),
        helper.make_node("Sigmoid", ["logits"], ["mask"]),
    ]
    graph = helper.make_graph(
        nodes,
        "masker",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, (1, 3, 16, 16))],
        [helper.make_tensor_value_info("mask", TensorProto.FLOAT, (1, 1, 16, 16))],
        [numpy_helper.from_array(kernel, "kernel")],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(made, _new(folder, "masker", "masker.onnx"))


# ---- JSON ------------------------------------------------------------------------------------


def runs(folder: Path) -> None:
    """Write the JSON files that a run of `lime-train` and a rendering leave and read again."""
    import dataclasses

    from lime_keras.networks import PRESETS
    from lime_keras.train.config import Config
    from lime_keras.train.stages import SCHEDULES

    config = Config(
        preset="smoke",
        steps_scale=1.0,
        architecture=PRESETS["smoke"],
        schedule=SCHEDULES["smoke"],
        seed=0,
        corpus_sha256="0" * 64,
    )
    findings = {
        "shapes": [
            {"name": "a.obj", "sha256": "0" * 64, "size": 3, "mtime_ns": 5, "problem": None}
            | {"notes": ["1 of 2 faces dropped"]},
            {"name": "b.obj", "sha256": "", "size": 0, "mtime_ns": 0, "problem": "is no mesh"}
            | {"notes": []},
        ],
        "environments": [],
    }
    for name, content in {
        "config": {"config": dataclasses.asdict(config), "version": "0", "corpora": []},
        "evaluation": {"examples": 4, "measures": {"mask_iou": 0.5, "exponent_exact": None}},
        "inputs": findings,
        "description": {"split": "train", "count": 4, "seed": 0, "size": 64, "shapes": None},
        "sidecar": {"examples": 1, "sha256": "0" * 64, "failures": [], "packages": {"numpy": "2"}},
    }.items():
        path = _new(folder / name, "run", f"{name}.json")
        path.write_text(json.dumps(content, indent=1))


def predictions(folder: Path) -> None:
    """Write the answers of another system for two images."""
    seed = folder / "answers"
    seed.mkdir(parents=True)
    for position in range(2):
        numbers = {
            "diffuse_albedo": [0.1, 0.2, 0.3],
            "specular_albedo": 0.5,
            "exponent": 20.5,
            "exponent_bin_probabilities": [0.125] * 8,
        }
        (seed / f"{position:05d}.json").write_text(json.dumps(numbers))
    rng = np.random.default_rng(0)
    mask = rng.integers(0, 256, (SIZE, SIZE, 1), np.uint8)
    _write(seed / "00000-mask.png", mask)
    for layer in ("specular_shading", "mirror"):
        radiance = rng.random((SIZE, SIZE, 1)).astype(np.float16)
        _write(seed / f"00001-{layer}.exr", radiance, names=("Y",))


def results(folder: Path) -> None:
    """Write a folder of results of `lime-estimate`: a photo's and a video's, table and page."""
    from lime_keras.estimate import gallery
    from lime_keras.io import result_json

    seed = folder / "materials"
    seed.mkdir(parents=True)
    numbers = {
        "diffuse_albedo": [0.1, 0.2, 0.3],
        "specular_albedo": 0.5,
        "exponent": 20.5,
        "exponent_bin_probabilities": [0.125] * 8,
        "exponent_entropy": 3.0,
        "mask_coverage": 0.25,
        "mask_confidence": 0.9,
        "warnings": [{"code": "dark", "message": "it is dark"}],
    }
    made = {"version": "0", "weights": "0", "options": {}, "source": "0"}
    scenes = {"video": "clip.mp4", "scenes": [numbers | {"scene": 1}, numbers | {"scene": 2}]}
    photo = numbers | {"photo": "one.png"}
    files = {"one": ["one.json"], "clip": ["clip.json", "clip-scene-1.mtl"]}
    contents = {
        name: result_json.write(seed / f"{name}.json", values, made, files[name])
        for name, values in (("one", photo), ("clip", scenes))
    }
    gallery.update(seed, contents)


# ---- the live page ---------------------------------------------------------------------------


def requests(folder: Path) -> None:
    """Write requests of the live page as they come over the wire; its port stands for itself."""
    frame = _levels(4).tobytes()
    for name, header, mask in (
        ("frame", {"number": 1, "options": {"material": True, "light": True}}, b""),
        ("mask", {"number": 2, "mask": True, "restart": True}, _levels(1).tobytes()),
    ):
        about = json.dumps(header | {"width": WIDTH, "height": HEIGHT}).encode()
        body = len(about).to_bytes(4, "little") + about + frame + mask
        _new(folder, name, "post.request").write_bytes(_post("/estimate", body))
    pictures(folder / "pictures")
    for name in ("png", "tiff-lzw", "webp", "exr-zip"):
        [picture] = (folder / "pictures" / name).iterdir()
        body = _post("/decode", picture.read_bytes(), f"X-Suffix: {picture.suffix}\r\n")
        _new(folder, name, "post.request").write_bytes(body)
    shutil.rmtree(folder / "pictures")
    for name in ("engine.json", "index.html"):
        get = f"GET /{name}?a=1 HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nConnection: close\r\n\r\n"
        _new(folder, name, "get.request").write_text(get, newline="")


def _post(path: str, body: bytes, more: str = "") -> bytes:
    head = (
        f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: http://127.0.0.1:PORT\r\n"
        f"Connection: close\r\n{more}Content-Length: {len(body)}\r\n\r\n"
    )
    return head.encode() + body


MAKERS: dict[str, Callable[[Path], None]] = {
    made.__name__: made
    for made in (
        *(pictures, backgrounds, masks, normals, environments, meshes, clips, corpora, records),
        *(weights, graphs, maskers, runs, predictions, results, requests),
    )
}
"""Makers of seeds by name."""
