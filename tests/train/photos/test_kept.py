"""Rows in files: as they were written, within their bits, whole, and on a disk with room."""

import errno
import shutil

import numpy as np
import pytest

from lime_keras.train.photos import kept
from lime_keras.train.photos.kept import INPUT_MASK, PREDICTED, Kept, LayerColumn

SIZE, COUNT = 6, 5
FEATURES = (
    "image", "mask", INPUT_MASK, "clipped", "painted", "specular_shading",
    f"{PREDICTED}specular_shading", "environment", "cast", "shininess", "exponent_bin", "seed",
)  # fmt: skip


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)

    def of(name, column):
        shape = (COUNT, *column.shape)
        if isinstance(column, LayerColumn):
            return rng.exponential(10.0, shape).astype(np.float32)
        if column.is_packed:
            return (rng.random(shape) < 0.5).astype(np.float32)
        if column.dtype == np.uint8:
            return rng.random(shape, np.float32)
        return rng.integers(0, 100, shape).astype(column.dtype)

    return {name: of(name, column) for name, column in kept.columns(FEATURES, SIZE).items()}


@pytest.fixture
def photos(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "PART", 2)
    return Kept(tmp_path / "photos" / "key", COUNT, FEATURES, SIZE)


def test_rows_are_read_as_they_were_written(photos, rows):
    parts = photos.begin()
    assert parts == [range(0, 2), range(2, 4), range(4, 5)]
    for part in parts[::-1]:
        photos.write(part.start, {name: value[part] for name, value in rows.items()})
        photos.mark(part)
    picked = np.array([4, 0, 4, 3])
    for name, value in photos.read(picked, FEATURES).items():
        expected = rows[name][picked]
        assert value.shape == expected.shape, name
        step = {"image": 0.51 / 255, "mask": 0.51 / 255, INPUT_MASK: 0.51 / 255}.get(name, 0)
        is_layer = isinstance(kept.columns([name], SIZE)[name], LayerColumn)
        tolerance = {"rtol": 0.02, "atol": 0.15} if is_layer else {"rtol": 0, "atol": step}
        np.testing.assert_allclose(value, expected, **tolerance, err_msg=name)
        if name not in ("exponent_bin", "seed"):
            assert value.dtype == np.float32, name


def test_only_unmarked_parts_are_missing_and_the_record_comes_last(photos, rows):
    first, second, _ = photos.begin()
    photos.write(second.start, {name: value[second] for name, value in rows.items()})
    photos.mark(second)
    again = Kept(photos.folder, COUNT, FEATURES, SIZE)
    assert again.begin() == [first, range(4, 5)]
    assert not again.is_complete and kept.count_in(photos.folder) is None
    again.finish({"recipe": {}})
    assert photos.is_complete and kept.count_in(photos.folder) == COUNT


@pytest.mark.parametrize("is_linear", [True, False])
@pytest.mark.parametrize("highest", [0.0, 1e-30, 1e-3, 1.0, 700.0, 1e38])
def test_layers_are_within_half_a_level_of_their_own_range(is_linear, highest):
    column = LayerColumn((SIZE, SIZE, 1), is_linear)
    shares = np.random.default_rng(0).random((COUNT, *column.shape), np.float32)
    shares[:, 0], shares[:, 1] = 0, 1
    # Each photo has another range; what a network predicts may begin below 0.
    tops = np.float32(highest) * np.linspace(0.1, 1, COUNT, dtype=np.float32)[:, None, None, None]
    layer = shares * tops - (0 if is_linear else 0.1 * tops)
    found = column.decode(column.encode(layer))
    assert found.shape == layer.shape and found.dtype == np.float32 and np.isfinite(found).all()
    if is_linear:
        assert (found[:, 0] == 0).all()
        layer, found = (np.sqrt(np.log1p(one)) for one in (layer, found))
    half = np.ptp(layer, axis=(1, 2, 3), keepdims=True) / 255 / 2
    assert (np.abs(found - layer) <= 1.001 * half + 1e-6 * np.abs(layer) + 1e-15).all()


def test_layers_below_zero_are_black():
    column = LayerColumn((2, 2, 1), is_linear=True)
    layer = np.array([-1, 0, 2, 3], np.float32).reshape(1, 2, 2, 1)
    np.testing.assert_allclose(column.decode(column.encode(layer)).ravel(), [0, 0, 2, 3], rtol=0.01)


def test_too_small_a_disk_says_how_many_photos_fit(photos, monkeypatch):
    free = 2**28 + 3 * photos.bytes_of_a_row
    usage = shutil.disk_usage("/")._replace(free=free)
    monkeypatch.setattr(kept.shutil, "disk_usage", lambda folder: usage)
    with pytest.raises(OSError, match=r"GB for 5 photos.*free: make room.*--photos 3 or fewer"):
        photos.begin()
    assert not photos.folder.exists()


def test_a_disk_that_fills_up_is_named_and_costs_a_part_at_most(photos, rows, monkeypatch):
    photos.begin()
    with monkeypatch.context() as full:

        def refuse(self, *mode, **options):
            raise OSError(errno.ENOSPC, "No space left on device")

        full.setattr("pathlib.Path.open", refuse)
        with pytest.raises(OSError, match=r"image\.npy cannot be written: No space.*make room"):
            photos.write(0, rows)
    assert len(photos.begin()) == 3


def test_what_photos_cannot_hold_is_refused(tmp_path):
    with pytest.raises(ValueError, match="normal is no feature"):
        Kept(tmp_path, 1, ("normal",), SIZE)


def test_a_broken_record_is_named(photos):
    photos.begin()
    (photos.folder / "photos.json").write_text("{}")
    with pytest.raises(
        ValueError, match=r"photos\.json cannot be read as the record of photos.*remove"
    ):
        kept.count_in(photos.folder)
