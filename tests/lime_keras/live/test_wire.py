"""Bytes between page and server: what goes in comes out, and nothing else is taken."""

import json
import struct

import numpy as np
import pytest

from lime_keras.live import wire
from lime_keras.live.session import FrameRequest, FrameResult


def body(pixels, **header):
    text = json.dumps(header).encode()
    return struct.pack("<I", len(text)) + text + pixels


def test_a_frame_comes_out_as_it_went_in():
    rng = np.random.default_rng(0)
    pixels, mask = rng.integers(0, 256, (3, 5, 4), np.uint8), rng.integers(0, 256, (3, 5), np.uint8)
    header = {"number": 7, "width": 5, "height": 3, "mask": True, "options": {"light": False}}
    found = wire.unpack(body(pixels.tobytes() + mask.tobytes(), **header, page="a", restart=True))
    assert found.number == 7 and found.restart and found.page == "a"
    assert found.frame == FrameRequest(material=True, light=False, fusion=True)
    assert np.array_equal(found.image_srgb, pixels[..., :3])
    assert found.mask is not None and np.array_equal(found.mask, mask)
    bare = wire.unpack(body(pixels.tobytes(), number=0, width=5, height=3))
    assert bare.mask is None and not bare.restart and bare.frame == FrameRequest()


def test_an_answers_arrays_lie_where_its_header_says():
    arrays = {
        "mask": np.arange(9, dtype=np.uint8).reshape(3, 3),
        "mirror": np.arange(4, dtype=np.float32).reshape(2, 2) / 3,
    }
    packed = wire.pack(FrameResult({"found": True}, arrays), number=5)
    (length,) = struct.unpack_from("<I", packed)
    header, content = json.loads(packed[4 : 4 + length]), packed[4 + length :]
    assert header["found"] is True and header["number"] == 5
    for name, array in arrays.items():
        told = header["arrays"][name]
        count = int(np.prod(told["shape"]))
        read = np.frombuffer(content, told["type"], count, told["first"]).reshape(told["shape"])
        assert np.array_equal(read, array)


FRAME = {"number": 1, "width": 2, "height": 2}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (b"", "length of its header"),
        (b"\x00\x00\x00\x00", "JSON"),
        (struct.pack("<I", 2**31) + b"{}", "shorter than"),
        (struct.pack("<I", 3) + b"{]}", "JSON"),
        (struct.pack("<I", 2) + b"[]", "JSON object"),
        (struct.pack("<I", 4096) + b"[" * 4096, "JSON: .*recursion"),
        (body(b"", width=2, height=2), "number"),
        (body(b"\0" * 15, **FRAME), "16 bytes, got 15"),
        (body(b"\0" * 17, **FRAME), "16 bytes, got 17"),
        (body(b"\0" * 16, **FRAME, mask=True), "20 bytes"),
        (body(b"", **FRAME | {"width": 0}), "width"),
        (body(b"", **FRAME | {"width": -4}), "width"),
        (body(b"\0" * 16, **FRAME | {"height": 2.0}), "height"),
        (body(b"\0" * 16, **FRAME | {"height": True}), "height"),
        (body(b"", **FRAME | {"width": wire.LONGEST + 1}), "width"),
        (body(b"\0" * 16, **FRAME, options=[1]), "options"),
        (body(b"\0" * 16, **FRAME, options={"files": "/"}), "options"),
    ],
)
def test_what_is_no_frame_is_refused(given, told):
    with pytest.raises(ValueError, match=told):
        wire.unpack(given)
