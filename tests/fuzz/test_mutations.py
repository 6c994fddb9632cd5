"""Damage is drawn from its seed, changes what it is given, and gets behind checksums."""

import json
import random
import struct
import zlib

import numpy as np
import pytest
import tensorflow as tf
from PIL import Image

from tests.fuzz import mutations

TEXT = b"v 1.5 -2 3e4\nf 1 2 3\n" * 3
JSON = json.dumps({"a": [1, 2.5, {"b": "x"}], "c": None}).encode()
BYTES = bytes(range(256)) * 4
SAMPLES = {"photo.png": BYTES, "mesh.obj": TEXT, "run.json": JSON, "empty.bin": b"", "a.npy": TEXT}


def drawn(kind, data, count=60):
    return [kind(random.Random(seed), data) for seed in range(count)]


@pytest.mark.parametrize("name", SAMPLES)
def test_a_seed_gives_the_same_bytes_and_another_seed_others(name):
    def made():
        return [mutations.mutated(random.Random(k), SAMPLES[name], name) for k in range(80)]

    first = made()
    assert first == made()
    assert len(set(first)) > (1 if name == "empty.bin" else 40)
    assert sum(one != SAMPLES[name] for one in first) >= (0 if name == "empty.bin" else 70)
    assert max(map(len, first)) <= mutations.MOST_BYTES


@pytest.mark.parametrize("kind", mutations._ANY)
def test_damage_of_bytes_takes_any_file(kind):
    for data in (b"", b"x", BYTES):
        drawn(kind, data)
    assert any(one != BYTES for one in drawn(kind, BYTES))


def test_bits_are_flipped_and_no_byte_comes_or_goes():
    for one in drawn(mutations.flipped, BYTES):
        bits = np.unpackbits(np.frombuffer(one, np.uint8) ^ np.frombuffer(BYTES, np.uint8)).sum()
        assert len(one) == len(BYTES) and bits <= 8


def test_a_cut_file_is_a_beginning_of_it():
    ends = {len(one) for one in drawn(mutations.cut, BYTES) if BYTES.startswith(one)}
    assert 0 in ends and len(ends) > 20 and max(ends) <= len(BYTES)


def test_numbers_in_text_become_extremes():
    told = b"".join(drawn(mutations.renumbered, TEXT, 400))
    for extreme in (b"1e400", b"NaN", b"-1 ", b"4294967296"):
        assert extreme in told
    assert drawn(mutations.renumbered, b"no number", 3) == [b"no number"] * 3


def test_values_of_json_become_others_and_it_stays_json():
    found = [json.loads(one) for one in drawn(mutations.retyped, JSON, 200)]
    kinds = {type(one.get("c", 0)) for one in found if isinstance(one, dict)}
    assert {int, list, dict, str, float, bool, type(None)} <= kinds
    assert drawn(mutations.retyped, b"{", 2) == [b"{"] * 2


def test_a_nesting_is_deeper_than_a_parser_goes():
    for one in drawn(mutations.nested, JSON, 10):
        with pytest.raises((RecursionError, ValueError)):
            json.loads(one)


def test_a_damaged_png_has_checksums_that_fit(tmp_path):
    path = tmp_path / "a.png"
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(path)
    data = bytearray(path.read_bytes())
    assert mutations.png_mended(bytes(data)) == bytes(data)
    data[16:20] = struct.pack(">I", 77)  # the width
    mended = mutations.png_mended(bytes(data))
    assert mended[16:20] == data[16:20] and mended != bytes(data)
    assert struct.unpack(">I", mended[29:33])[0] == zlib.crc32(mended[12:29])
    assert mutations.png_mended(b"no picture") == b"no picture"


def test_a_damaged_record_has_checksums_that_fit(tmp_path):
    path = tmp_path / "a.tfrecord"
    with tf.io.TFRecordWriter(str(path)) as writer:
        writer.write(b"one record")
        writer.write(b"and another")
    data = bytearray(path.read_bytes())
    assert mutations.tfrecord_mended(bytes(data)) == bytes(data)
    data[12:15] = b"ONE"
    path.write_bytes(mutations.tfrecord_mended(bytes(data)))
    found = [record.numpy() for record in tf.data.TFRecordDataset(str(path))]
    assert found == [b"ONE record", b"and another"]


def test_the_json_of_a_glb_is_damaged_and_its_lengths_fit():
    text, rest = b'{"a": [1, 2]} ', b"\x04\0\0\0BIN\0abcd"
    text += b" " * (-len(text) % 4)
    data = struct.pack("<4s4I", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    data += text + rest
    for one in drawn(mutations.framed_json, data):
        total, length = struct.unpack_from("<2I", one, 8)
        assert total == len(one) and one[20 + length :] == rest and length % 4 == 0
