"""Damage to the bytes of a file, drawn from a generator: the same draws, the same bytes.

Some damage knows its format. It lands where random bytes seldom do: in numbers of text, in values
of JSON, and behind the checksums of PNG and TFRecord files, which are made to fit again.
"""

import json
import random
import re
import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any

Mutation = Callable[[random.Random, bytes], bytes]

MOST_BYTES = 1 << 22  # largest number of bytes of a damaged file; what grows beyond is cut
_HEADER = 160  # bytes at the beginning of a file that are hit as often as all the others together
_INTEGERS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
_LARGE = (10**6, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 10**30)
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_EXTREMES = (
    *(b"0", b"-1", b"1", b"-0.0", b"1e400", b"-1e400", b"1e-400", b"NaN", b"inf", b"1e38"),
    *(b"65536", b"2147483647", b"-2147483648", b"4294967296", b"1" + b"0" * 40, b"9" * 5000),
    *(b"", b"x", b"0x10", b"1_0", "٣".encode(), b"1.5"),
)
_PNG = b"\x89PNG\r\n\x1a\n"
_DEEP = 100_000  # levels of a nesting that is deeper than a parser's stack


def mutated(rng: random.Random, data: bytes, name: str) -> bytes:
    """Return a file's bytes with one to three damages, and its checksums mended half of the time.

    Args:
        rng: source of all draws.
        data: content of a sound file.
        name: name of the file; its suffix tells which damages know its format.
    """
    suffix = name.rpartition(".")[2].lower()
    kinds = (*_ANY, *_OF_FORMAT.get(suffix, ()) * 4)
    for _ in range(rng.choice((1, 1, 2, 3))):
        data = rng.choice(kinds)(rng, data)[:MOST_BYTES]
    mend = _MENDS.get(suffix)
    return mend(data) if mend and rng.random() < 0.5 else data


# ---- any bytes -------------------------------------------------------------------------------


def flipped(rng: random.Random, data: bytes) -> bytes:
    """Flip one to eight bits."""
    out = bytearray(data)
    for _ in range(min(rng.randint(1, 8), 8 * len(out))):
        out[_place(rng, len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def overwritten(rng: random.Random, data: bytes) -> bytes:
    """Replace a block by zeros, by ones, or by anything."""
    first, last = _block(rng, len(data))
    fill = rng.choice((b"\0", b"\xff", None))
    block = rng.randbytes(last - first) if fill is None else fill * (last - first)
    return data[:first] + block + data[last:]


def cut(rng: random.Random, data: bytes) -> bytes:
    """End the file early: anywhere, within its header, or at once."""
    return data[: rng.choice((0, rng.randint(0, min(_HEADER, len(data))), _any(rng, data)))]


def removed(rng: random.Random, data: bytes) -> bytes:
    """Take out a block."""
    first, last = _block(rng, len(data))
    return data[:first] + data[last:]


def repeated(rng: random.Random, data: bytes) -> bytes:
    """Repeat a block, some of the time often."""
    first, last = _block(rng, len(data))
    return data[:last] + data[first:last] * rng.choice((1, 1, 2, 100)) + data[last:]


def exchanged(rng: random.Random, data: bytes) -> bytes:
    """Let the file go on with what stands elsewhere in it."""
    return data[: _any(rng, data)] + data[_any(rng, data) :]


def resized(rng: random.Random, data: bytes) -> bytes:
    """Replace a whole number of 1, 2, 4 or 8 bytes by an extreme, as a lying header does."""
    width, order = rng.choice((1, 2, 4, 4, 8)), rng.choice(("little", "big"))
    value = rng.choice((*_INTEGERS, rng.getrandbits(8 * width))) % (1 << 8 * width)
    place = _place(rng, max(len(data) - width, 1))
    return data[:place] + value.to_bytes(width, order) + data[place + width :]


def _place(rng: random.Random, length: int) -> int:
    """Return a place in a file: half of the time one in its header."""
    return rng.randrange(min(length, _HEADER) if rng.random() < 0.5 else length)


def _any(rng: random.Random, data: bytes) -> int:
    return rng.randint(0, len(data))


def _block(rng: random.Random, length: int) -> tuple[int, int]:
    """Return first and last place of a block, most often a short one."""
    first = _place(rng, length) if length else 0
    return first, min(first + rng.choice((1, 2, 4, 16, 64, 1024, length)), length)


# ---- text ------------------------------------------------------------------------------------


def renumbered(rng: random.Random, data: bytes) -> bytes:
    """Replace a number that is written out by an extreme."""
    found = list(_NUMBER.finditer(data[:1_000_000]))
    if not found:
        return data
    number = rng.choice(found)
    return data[: number.start()] + rng.choice(_EXTREMES) + data[number.end() :]


def reworded(rng: random.Random, data: bytes) -> bytes:
    """Take out, repeat or exchange lines or words."""
    by = rng.choice((b"\n", b" "))
    parts = data.split(by)
    one, other = rng.randrange(len(parts)), rng.randrange(len(parts))
    choice = rng.randrange(3)
    if choice == 0:
        del parts[one]
    elif choice == 1:
        parts[one:one] = [parts[other]] * rng.choice((1, 3, 1000))
    else:
        parts[one], parts[other] = parts[other], parts[one]
    return by.join(parts)


# ---- JSON ------------------------------------------------------------------------------------


def retyped(rng: random.Random, data: bytes) -> bytes:
    """Replace a value of a JSON file by another of any type, or rename, repeat or drop a key."""
    try:
        whole = json.loads(data)
    except (ValueError, RecursionError):
        return data
    places = list(_places(whole))
    if not places:
        return json.dumps(_value(rng)).encode()
    holder, key = rng.choice(places)
    choice = rng.random()
    if choice < 0.75:
        holder[key] = _value(rng)
    elif choice < 0.9:
        del holder[key]
    elif isinstance(holder, dict):
        holder[f"{key}{rng.choice(('x', '', chr(0), '/../..'))}"] = holder.pop(key)
    else:
        holder.insert(key, holder[key])
    return json.dumps(whole).encode()


def nested(rng: random.Random, data: bytes) -> bytes:
    """Put a nesting that is too deep in the place of a value, or of the whole."""
    deep = rng.choice((b"[" * _DEEP + b"]" * _DEEP, b'{"a":' * _DEEP + b"1" + b"}" * _DEEP))
    found = list(_NUMBER.finditer(data))
    if not found or rng.random() < 0.3:
        return deep
    number = rng.choice(found)
    return data[: number.start()] + deep + data[number.end() :]


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return holder and key of every value within a value."""
    inside: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, dict | list):
        inside = value.items() if isinstance(value, dict) else enumerate(value)
    return [place for key, held in inside for place in ((value, key), *_places(held))]


def _value(rng: random.Random) -> Any:
    return rng.choice(
        (
            *(None, True, False, 0, -1, 1, 1.5, 1e308, float("nan"), float("inf"), -0.0),
            *("", "x", "\0", "\ud800", "../../etc/passwd", "NaN", "a" * 10_000),
            *([], {}, [None], {"a": 1}, [[1, 2], [3]], {"": {"": []}}, [0] * 1000, "%s%n{}"),
            *(rng.choice(_LARGE), -rng.choice(_LARGE), rng.randint(-10, 10)),
        )
    )


# ---- formats with checksums ------------------------------------------------------------------


def framed_json(rng: random.Random, data: bytes) -> bytes:
    """Change the JSON inside a GLB file, whose lengths are made to fit."""
    if len(data) < 20:
        return data
    (length,) = struct.unpack_from("<I", data, 12)
    change = rng.choice((retyped, retyped, renumbered, reworded))
    text = change(rng, data[20 : 20 + length])
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = data[:8] + struct.pack("<2I", 20 + len(text) + len(rest), len(text)) + data[16:20]
    return head + text + rest


def png_mended(data: bytes) -> bytes:
    """Return a PNG with the checksum of every chunk as its bytes want it."""
    if not data.startswith(_PNG):
        return data
    out, place = [_PNG], len(_PNG)
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        chunk = data[place + 4 : place + 8 + length]
        if place + 12 + length > len(data):
            break
        out.append(struct.pack(">I", length) + chunk + struct.pack(">I", zlib.crc32(chunk)))
        place += 12 + length
    return b"".join(out) + data[place:]


def tfrecord_mended(data: bytes) -> bytes:
    """Return a TFRecord file with the checksums of every record as its bytes want them."""
    out, place = [], 0
    while place + 16 <= len(data):
        length = data[place : place + 8]
        end = place + 12 + int.from_bytes(length, "little")
        if end + 4 > len(data):
            break
        content = data[place + 12 : end]
        out.append(length + _masked(length) + content + _masked(content))
        place = end + 4
    return b"".join(out) + data[place:]


def _masked(data: bytes) -> bytes:
    """Return the checksum of TFRecord files, CRC-32C turned and shifted."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = _CRC32C[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    crc ^= 0xFFFFFFFF
    return struct.pack("<I", ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF)


def _crc32c_of(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
    return byte


_CRC32C = tuple(map(_crc32c_of, range(256)))
_ANY: tuple[Mutation, ...] = (
    *(flipped, overwritten, cut, removed, repeated, exchanged),
    *(resized, resized, resized),
)
_JSON: tuple[Mutation, ...] = (retyped, retyped, retyped, renumbered, nested)
_TEXT: tuple[Mutation, ...] = (renumbered, renumbered, reworded)
_OF_FORMAT: dict[str, tuple[Mutation, ...]] = {
    "json": _JSON,
    "glb": (framed_json,),
    "npy": (renumbered,),
    "hdr": (renumbered,),
    "ppm": (renumbered,),
    **dict.fromkeys(("obj", "ply", "stl", "csv", "html", "request"), _TEXT),
}
"""Damages that know a format, by the suffix of its files."""
_MENDS: dict[str, Callable[[bytes], bytes]] = {"png": png_mended, "tfrecord": tfrecord_mended}
"""What makes checksums fit again, by the suffix of the files."""
