"""Compressed G-buffers: what comes back, and how broken ones are told."""

import tracemalloc
import zlib

import bank_files
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lime_keras.optics import octahedral
from lime_keras.synthesis import bank, geometry


def same(found, expected):
    """All of `expected` but the second normals' last bits, which are lost."""
    for ours, theirs in zip(found[:2], expected[:2], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(found[2][0], expected[2][0])
    np.testing.assert_array_equal(found[3], expected[3])
    two = (expected[0] > 0) & (expected[1] < geometry.ONE_SURFACE)
    assert not found[2][1][~two].any()
    assert np.abs(found[2][1].astype(int) - expected[2][1])[two].max(initial=0) <= 8


@settings(max_examples=60)
@given(
    st.integers(0, 2**31),
    st.sampled_from([1, 5, 16, 33]),
    st.sampled_from([0.0, 0.02, 0.5, 1.0]),
    st.sampled_from([0.0, 0.5, 1.0]),
)
def test_every_gbuffer_comes_back(seed, size, covered, parted):
    """No pixel, one pixel, all; one surface, two: sizes that fill no whole byte too."""
    arrays = bank_files.gbuffer(seed, size, covered, parted)
    found = geometry.decode(geometry.encode(*arrays), size)
    assert [a.dtype for a in found] == [a.dtype for a in arrays]
    assert [a.shape for a in found] == [a.shape for a in arrays]
    same(found, arrays)


def test_a_smooth_surface_takes_a_byte_and_a_half_a_pixel():
    """A ball whose normals, coverage and spread are known: predicted, two codes are a byte."""
    size = 128
    y, x = (np.mgrid[:size, :size] + 0.5 - size / 2) / (0.4 * size)
    inside = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    codes = octahedral.encode(np.stack([x, -y, np.where(inside, z, 1)], axis=-1))
    normal = np.stack([np.where(inside[..., None], codes, 0), np.zeros_like(codes)])
    coverage = np.where(inside, 255, 0).astype(np.uint8)
    share = np.full_like(coverage, 255)
    arrays = coverage, share, normal.astype(np.uint16), np.zeros((2, size, size), np.uint8)
    data = geometry.encode(*arrays)
    same(geometry.decode(data, size), arrays)
    assert len(data) < 1.5 * inside.sum()


def test_a_surface_of_one_normal_takes_next_to_nothing():
    size = 64
    flat = np.full((size, size), 255, np.uint8)
    normal = np.zeros((2, size, size, 2), np.uint16)
    normal[0] = 4000, 17
    spread = np.zeros((2, size, size), np.uint8)
    data = geometry.encode(flat, flat, normal, spread)
    assert len(data) < 120
    same(geometry.decode(data, size), (flat, flat, normal, spread))


def test_one_gbuffer_has_one_code():
    arrays = bank_files.gbuffer(3)
    assert geometry.encode(*arrays) == geometry.encode(*arrays)


@pytest.mark.parametrize("kept", [0, 1, 0.5, 0.99])
def test_bytes_cut_off_are_refused(kept):
    data = geometry.encode(*bank_files.gbuffer())
    with pytest.raises(ValueError, match="cannot be decompressed"):
        geometry.decode(data[: int(kept * len(data)) if kept < 1 else 1], 16)


@pytest.mark.parametrize("size", [8, 15, 17, 32])
def test_a_gbuffer_of_another_size_is_refused(size):
    with pytest.raises(ValueError, match=f"no G-buffer of {size}×{size}"):
        geometry.decode(geometry.encode(*bank_files.gbuffer(size=16)), size)


@given(st.binary(max_size=400))
def test_any_other_bytes_are_refused_or_are_a_gbuffer(content):
    compressor = zlib.compressobj(1, zlib.DEFLATED, -15)
    try:
        found = geometry.decode(compressor.compress(content) + compressor.flush(), 4)
    except ValueError:
        return
    assert [a.shape for a in found] == [(4, 4), (4, 4), (2, 4, 4, 2), (2, 4, 4)]


def test_bytes_that_swell_are_refused_before_they_do():
    coder = zlib.compressobj(wbits=-15)
    content = coder.compress(bytes(50_000_000)) + coder.flush()
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="no G-buffer"):
            geometry.decode(content, 16)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_spread_is_coded_by_powers_of_two():
    variance = np.array([0, 1e-30, 2.0**-14 * 0.999, 2.0**-14, 2.0**-13, 0.499, 0.5, 0.999, 1])
    assert geometry.spread_code(variance).tolist() == [0, 0, 0, 1, 2, 13, 14, 14, 15]


def test_a_variance_comes_back_within_the_root_of_its_step():
    variance = np.geomspace(2.0**-14, 1, 1000)
    ratio = geometry.variance_of(geometry.spread_code(variance)) / variance
    assert 2**-0.501 < ratio.min() and ratio.max() < 2**0.501
    assert geometry.variance_of(np.array([0, 15])).tolist() == [0, 1]


# ---- banks on disk ---------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path):
    bank_files.write(tmp_path / "bank")
    return tmp_path / "bank"


def test_entries_are_read_in_the_order_asked_for(tmp_path):
    held = bank_files.write(tmp_path)
    read = geometry.GeometryBank(tmp_path)
    assert len(read) == 5 and read.size == 16 and read.shape_names == ["first", "second"]
    assert read.shape.tolist() == [0, 1, 0, 0, 1]
    order = np.array([4, 0, 3, 4])
    batch = read.read(order)
    assert batch["camera"][:, 0].tolist() == [54, 50, 53, 54]
    for place, index in enumerate(order):
        names = ("coverage", "share", "normal", "spread")
        same([batch[name][place] for name in names], held[index])
    assert read.read(np.array([], int))["normal"].shape == (0, 2, 16, 16, 2)


@pytest.mark.parametrize("index", [-1, 5, 2**40])
def test_an_index_that_points_outside_is_refused(folder, index):
    with pytest.raises(IndexError, match=f"0 to 4, so none of {index}"):
        geometry.GeometryBank(folder).read(np.array([0, index]))


@pytest.mark.parametrize("name", ["geometry/00001.bin", "geometry/00001.npy"])
def test_a_missing_file_is_told_by_name(folder, name):
    (folder / name).unlink()
    with pytest.raises(FileNotFoundError, match=rf"{name} is missing: .*lime-render bank"):
        geometry.GeometryBank(folder)


@pytest.mark.parametrize("name", ["geometry/00001.bin", "geometry/00001.npy"])
@pytest.mark.parametrize("kept", [0, -1])
def test_a_file_cut_off_is_told_by_name(folder, name, kept):
    (folder / name).write_bytes((folder / name).read_bytes()[:kept])
    with pytest.raises(ValueError, match=rf"{name} .*cut off.*lime-render bank"):
        geometry.GeometryBank(folder)


def change_index(folder, field, value):
    path = folder / "geometry/00000.npy"
    table = np.load(path)
    table[field][1] = value
    np.save(path, table)


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("offset", 10**9, r"00000\.bin has .* bytes, and its index tells of more"),
        ("offset", 2**64 - 8, r"00000\.bin has .* bytes, and its index tells of more"),
        ("length", 2**32 - 1, r"00000\.bin has .* bytes"),
        ("shape", 2, r"00000\.npy names shape 2, and bank\.json lists 2"),
        ("camera", np.nan, r"00000\.npy has a camera that is none"),
        ("camera", (0, 50, 8, 8), r"00000\.npy has a camera that is none"),
    ],
)
def test_an_index_that_cannot_be_is_refused_by_name(folder, field, value, told):
    change_index(folder, field, value)
    with pytest.raises(ValueError, match=told):
        geometry.GeometryBank(folder)


def test_another_array_is_no_index(folder):
    np.save(folder / "geometry/00000.npy", np.zeros((3, 2)))
    with pytest.raises(ValueError, match=r"00000\.npy is no index of a shard"):
        geometry.GeometryBank(folder)


def test_a_bank_with_another_count_is_refused(folder):
    bank_files.change_manifest(folder, count=6)
    with pytest.raises(ValueError, match=r"holds 5 entries, and bank\.json tells of 6"):
        geometry.GeometryBank(folder)


def test_a_bank_without_entries_is_refused(folder):
    bank_files.change_manifest(folder, count=0, files={})
    with pytest.raises(ValueError, match="holds 0 entries"):
        geometry.GeometryBank(folder)


def test_an_entry_with_a_flipped_byte_is_told_by_name(folder):
    path = folder / "geometry/00001.bin"
    data = bytearray(path.read_bytes())
    data[:8] = b"\xff" * 8
    path.write_bytes(bytes(data))
    read = geometry.GeometryBank(folder)
    read.read(np.arange(3))  # the other entries are sound
    with pytest.raises(ValueError, match=r"00001\.bin, entry 0: .*; delete the file and run"):
        read.read(np.array([3]))


def test_a_bank_of_another_version_is_refused(folder):
    bank_files.change_manifest(folder, version=bank.VERSION + 1)
    with pytest.raises(ValueError, match=r"bank\.json is of version 2"):
        geometry.GeometryBank(folder)
