"""The bytes between page and server: a length, a JSON header of that length, then plain arrays.

The length is four bytes, little-endian. A request's header says `page`, `number`, `width`,
`height`, `mask` and `options`, and `restart` for the first frame of a stream. The pixels follow,
`width · height` times red, green, blue and a byte that is not read; and, if `mask` is true, as many
bytes of the mask. An answer's header holds its numbers and `arrays`: type, shape and first byte of
each array.
"""

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras.live.session import FrameRequest, FrameResult

LONGEST = 4096
"""Largest width and height of a frame in pixels; the page makes larger photos smaller."""
_HEADER = 4096
LARGEST_BODY = 4 + _HEADER + 5 * LONGEST**2
"""Largest number of bytes of a request: a frame and its mask."""
_LENGTH = struct.Struct("<I")
_OPTIONS = ("material", "layers", "light", "fusion")


@dataclass(frozen=True)
class Request:
    """One frame, as the page sends it.

    Attributes:
        page: name of the page that sends it.
        number: number of the frame, which its answer carries.
        image_srgb: `(H, W, 3)` uint8 sRGB.
        mask: coverage `(H, W)` uint8 that the user painted; None to find the object.
        frame: parts to estimate.
        restart: whether another stream begins with the frame.
    """

    page: str
    number: int
    image_srgb: np.ndarray
    mask: np.ndarray | None
    frame: FrameRequest
    restart: bool


def unpack(body: bytes) -> Request:
    """Return the frame in a request's body.

    Raises:
        ValueError: if the body is not as described above.
    """
    header, content = _split(body)
    number = _integer(header, "number", 0, 2**53)
    width, height = (_integer(header, name, 1, LONGEST) for name in ("width", "height"))
    options, masked = header.get("options", {}), header.get("mask", False)
    if not isinstance(options, dict) or not set(options) <= set(_OPTIONS):
        raise ValueError(f"a frame's options are some of {', '.join(_OPTIONS)}, got {options!r}")
    area = width * height
    expected = area * (5 if masked else 4)
    if len(content) != expected:
        raise ValueError(
            f"a frame of {width}×{height} pixels has {expected} bytes, got {len(content)}"
        )
    levels = np.frombuffer(content, np.uint8)
    pixels = levels[: 4 * area].reshape(height, width, 4)
    image = np.empty((height, width, 3), np.uint8)
    for channel in range(3):  # One copy of all takes three times as long.
        image[..., channel] = pixels[..., channel]
    return Request(
        page=str(header.get("page", "")),
        number=number,
        image_srgb=image,
        mask=levels[4 * area :].reshape(height, width) if masked else None,
        frame=FrameRequest(**{name: bool(value) for name, value in options.items()}),
        restart=bool(header.get("restart", False)),
    )


def pack(result: FrameResult, **further: Any) -> bytes:
    """Return the body of an answer; `further` are further values of its header."""
    layout, parts, first = {}, [], 0
    for name, array in result.arrays.items():
        content = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
        layout[name] = {"type": array.dtype.name, "shape": array.shape, "first": first}
        parts.append(content)
        first += len(content)
    header = json.dumps(result.numbers | further | {"arrays": layout}, allow_nan=False).encode()
    return b"".join([_LENGTH.pack(len(header)), header, *parts])


def _integer(header: dict[str, Any], name: str, least: int, most: int) -> int:
    value = header.get(name)
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"a frame's {name} is a whole number up to {most}, got {value!r}")
    return value


def _split(body: bytes) -> tuple[dict[str, Any], memoryview]:
    """Return a body's header and the rest."""
    if len(body) < _LENGTH.size:
        raise ValueError("a request begins with the length of its header")
    (length,) = _LENGTH.unpack_from(body)
    if length > min(_HEADER, len(body) - _LENGTH.size):
        raise ValueError(f"a request's header is shorter than {_HEADER} bytes, got {length}")
    view = memoryview(body)[_LENGTH.size :]
    try:
        header = json.loads(bytes(view[:length]))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"a request's header is JSON: {error}") from error
    if not isinstance(header, dict):
        raise ValueError(f"a request's header is a JSON object, got {header!r}")
    return header, view[length:]
