"""Films can always be played, and keep pictures and times."""

import av
import full_disk
import numpy as np
import pytest

from lime_keras.io.video_reader import Footage
from lime_keras.io.video_writer import Movie


def decoded(path):
    with Footage(str(path)) as footage:
        return list(footage), footage.remarks


def test_the_file_keeps_pictures_and_times(tmp_path):
    images = np.stack([np.full((64, 96, 3), level, np.uint8) for level in (30, 90, 200)])
    images[:, :32] = (220, 40, 30)
    times = [0.0, 0.1, 0.75]
    with Movie(tmp_path / "o.mp4") as file:
        for image, seconds in zip(images, times, strict=True):
            file.write(image, seconds)
    found, remarks = decoded(tmp_path / "o.mp4")
    np.testing.assert_allclose([frame.time for frame in found], times, atol=1e-3)
    for frame, image in zip(found, images, strict=True):
        for part in (slice(4, 28), slice(36, 60)):
            seen, written = (a[part].astype(float) for a in (frame.image_srgb, image))
            assert np.abs(seen - written).mean() < 4
    assert not [told for told in remarks if "cut short" not in told]


def test_a_clock_that_stands_still_or_jumps_back_is_pushed_on(tmp_path):
    image = np.zeros((32, 32, 3), np.uint8)
    with Movie(tmp_path / "o.mp4") as file:
        for seconds in (0.0, 0.0, 0.5, 0.2, 0.2, 0.9):
            file.write(image, seconds)
    times = [frame.time for frame in decoded(tmp_path / "o.mp4")[0]]
    assert len(times) == 6 and (np.diff(times) > 0).all()


def test_a_file_that_was_never_closed_can_be_played(tmp_path):
    path = tmp_path / "o.mp4"
    file = Movie(path)
    image = np.random.default_rng(0).integers(0, 255, (128, 128, 3), dtype=np.uint8)
    for number in range(200):
        file.write(image, number / 25)
    # As it lies there when the program is killed.
    so_far = tmp_path / "copy.mp4"
    so_far.write_bytes(path.read_bytes())
    assert 30 <= len(decoded(so_far)[0]) < 200
    file.__exit__(None, None, None)
    assert len(decoded(path)[0]) == 200


def test_a_later_picture_of_another_size_is_fitted(tmp_path):
    with Movie(tmp_path / "o.mp4") as file:
        for size in ((32, 64), (64, 32)):
            file.write(np.zeros((*size, 3), np.uint8), size[0] / 100)
    assert [f.image_srgb.shape for f in decoded(tmp_path / "o.mp4")[0]] == [(32, 64, 3)] * 2


def test_without_x264_another_codec_serves(tmp_path, monkeypatch):
    monkeypatch.setattr(av, "codecs_available", av.codecs_available - {"libx264"})
    with Movie(tmp_path / "o.mp4") as file:
        for number in range(5):
            file.write(np.full((32, 32, 3), 40 * number, np.uint8), number / 25)
    found = decoded(tmp_path / "o.mp4")[0]
    assert [round(f.image_srgb.mean() / 40) for f in found] == list(range(5))


def test_an_empty_file_is_no_error(tmp_path):
    with Movie(tmp_path / "o.mp4"):
        pass


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    with (
        pytest.raises(OSError, match=r"missing.o\.mp4 cannot be written"),
        Movie(tmp_path / "missing/o.mp4") as o,
    ):
        o.write(np.zeros((32, 32, 3), np.uint8), 0.0)


@pytest.mark.parametrize("count", [0, 100, 2000])
def test_a_full_disk_is_told(count, tmp_path):
    images = np.random.default_rng(0).integers(0, 256, (20, 64, 64, 3), np.uint8)
    with (
        pytest.raises(OSError, match=r"full\.mp4 cannot be written: .*; make room"),
        full_disk.files_end_after(count),
        Movie(tmp_path / "full.mp4") as movie,
    ):
        for number, image in enumerate(images):
            movie.write(image, number / 30)
