"""Frames out of files and cameras: colours, times, orientation, damage."""

import itertools
import os
import sys
import wave
from fractions import Fraction

import av
import clips
import numpy as np
import pytest
from hdr_curves import hlg, pq
from icc_profiles import TO_BT2020, TO_P3

from lime_keras.io import video_reader
from lime_keras.io.video_reader import Footage, oriented
from tests.stability.srgb_standard import encoded


def read(source):
    """Images `(T, H, W, 3)`, times and remarks."""
    with Footage(str(source)) as footage:
        found = list(footage)
    images = [frame.image_srgb for frame in found]
    return (np.stack(images) if images else []), [f.time for f in found], footage.remarks


@pytest.mark.parametrize("suffix", [".mov", ".mkv", ".avi"])
def test_frames_come_back_as_they_were_written(suffix, tmp_path):
    images = clips.noise(7)
    path = clips.write(tmp_path / f"clip{suffix}", images)
    found, times, remarks = read(path)
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, images)
    np.testing.assert_allclose(times, np.arange(7) / 25, atol=2e-3)
    assert remarks == []
    with Footage(str(path)) as footage:
        assert footage.expected == 7


@pytest.mark.parametrize("start", [0.0, 2.0, 20.0])
def test_a_variable_rate_is_kept_and_time_begins_at_the_first_frame(start, tmp_path):
    """Two frames may have one time, and Matroska's duration counts from its clock's zero."""
    times = np.array([0, 0.04, 0.04, 0.5, 0.51, 1.3])
    path = clips.write(tmp_path / "clip.mkv", clips.noise(6), start + times)
    _, found, remarks = read(path)
    np.testing.assert_allclose(found, times, atol=1e-3)
    assert remarks == []


def test_one_frame_of_one_pixel(tmp_path):
    image = np.full((1, 1, 1, 3), 77, np.uint8)
    found, times, _ = read(clips.write(tmp_path / "dot.mov", image))
    np.testing.assert_array_equal(found, image)
    assert times == [0]


# Orientation.

QUARTERS = {"none": (1, 0, 0, 1), "right": (0, 1, -1, 0), "half": (-1, 0, 0, -1)}
QUARTERS |= {"left": (0, -1, 1, 0)}
MIRRORED = {f"mirrored {name}": (-a, b, -c, d) for name, (a, b, c, d) in QUARTERS.items()}


@pytest.mark.parametrize("turn", (QUARTERS | MIRRORED).values(), ids=QUARTERS | MIRRORED)
def test_every_pixel_goes_where_the_matrix_sends_it(turn):
    a, b, c, d = turn
    image = clips.noise(1, (3, 5))[0]
    turned = oriented(image, np.array([a, b, 0, c, d, 0, 0, 0, 1]) << 16)
    places = {(q, p): (b * p + d * q, a * p + c * q) for q in range(3) for p in range(5)}
    top, left = np.min(list(places.values()), axis=0)
    assert turned.size == image.size and turned.flags.c_contiguous
    for place, (row, column) in places.items():
        np.testing.assert_array_equal(turned[row - top, column - left], image[place])


@pytest.mark.parametrize(
    ("turn", "quarters"), [("right", -1), ("half", 2), ("left", 1)], ids=["right", "half", "left"]
)
def test_a_phones_video_is_turned_upright(turn, quarters, tmp_path):
    images = clips.noise(2)
    path = clips.write(tmp_path / "phone.mov", images)
    data = bytearray(path.read_bytes())
    # A track's header: 40 bytes of other things, then the matrix a, b, u, c, d, v, x, y, w.
    start = data.index(b"tkhd") + 4 + 40
    a, b, c, d = QUARTERS[turn]
    matrix = np.array([a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30], ">i4")
    data[start : start + 36] = matrix.tobytes()
    path.write_bytes(data)
    np.testing.assert_array_equal(read(path)[0], np.rot90(images, quarters, axes=(1, 2)))


# Colour.

RED = np.broadcast_to(np.uint8([255, 40, 0]), (1, 720, 1280, 3))


@pytest.mark.parametrize(
    ("tags", "matrix", "size"),
    [
        ((), "ITU601", 480),
        ((), "ITU709", 720),
        ((("colorspace", 1),), "ITU709", 480),
        ((("colorspace", 6),), "ITU601", 720),
    ],
    ids=["untold, standard", "untold, high", "BT.709, standard", "BT.601, high"],
)
def test_colours_are_decoded_by_the_matrix_they_were_encoded_with(tags, matrix, size, tmp_path):
    path = tmp_path / "red.mp4"
    clips.write(path, RED[:, :size], codec="libx264", tags=tags, dst_colorspace=matrix)
    found = read(path)[0]
    assert found.shape == (1, size, 1280, 3)
    np.testing.assert_allclose(found.astype(float).mean(axis=(0, 1, 2)), [255, 40, 0], atol=4)


# Damage.


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
@pytest.mark.parametrize(("suffix", "codec"), [(".mp4", "libx264"), (".mkv", None)])
def test_of_a_file_cut_short_all_that_is_there_is_read(suffix, codec, share, tmp_path):
    path = clips.write(tmp_path / f"whole{suffix}", clips.noise(30), codec=codec)
    whole, times, _ = read(path)
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    found, found_times, remarks = read(cut)
    # The decoder makes something of the frame that the end runs through.
    assert 30 * share - 4 <= len(found) < 30
    np.testing.assert_array_equal(found[:-2], whole[: len(found) - 2])
    assert found_times == times[: len(found)]
    assert share > 0.9 or any("damaged" in told or "cut short" in told for told in remarks)
    assert all(str(cut) in told for told in remarks)


def test_damage_in_the_middle_is_left_out_and_read_past(tmp_path):
    images = clips.noise(20)
    path = clips.write(tmp_path / "clip.mov", images)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 12_000] = bytes(12_000)
    path.write_bytes(data)
    found, times, remarks = read(path)
    assert 15 <= len(found) < 20 and len(remarks) == 1
    assert f"{20 - len(found)} damaged packets were left out" in remarks[0]
    np.testing.assert_array_equal(found[:5], images[:5])
    np.testing.assert_array_equal(found[-5:], images[-5:])
    assert times[-1] == pytest.approx(19 / 25, abs=1e-3)


class Fails:
    """A packet on which a decoder gives up with an error of its own."""

    def __init__(self, error):
        self.error = error

    def decode(self):
        raise self.error


@pytest.mark.parametrize("kind", [av.error.ExternalError, av.error.ArgumentError])
def test_a_packet_that_a_codec_refuses_by_its_own_error_is_left_out(kind, tmp_path, monkeypatch):
    path = clips.write(tmp_path / "clip.mov", clips.noise(4))
    whole = Footage._packets

    def packets(footage):
        yield Fails(kind(1, "gives up"))
        yield from whole(footage)

    monkeypatch.setattr(Footage, "_packets", packets)
    found, _, remarks = read(path)
    assert len(found) == 4 and remarks == [f"{path}: 1 damaged packets were left out"]


def test_frames_that_are_too_large_are_refused(tmp_path, monkeypatch):
    path = clips.write(tmp_path / "clip.mov", clips.noise(2))
    monkeypatch.setattr(video_reader.photo, "LARGEST", 48 * 64 - 1)
    with pytest.raises(ValueError, match=r"clip\.mov has 64×48 pixels, more than"):
        read(path)


# Refusals.


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere\.mp4 cannot be .* \(No such .*\): check"):
        Footage(str(tmp_path / "nowhere.mp4"))
    with pytest.raises(ValueError, match="it is a folder: pass a file"):
        Footage(str(tmp_path))


@pytest.mark.parametrize("content", [b"", b"not a video\n" * 100, bytes(5000)])
def test_a_file_of_another_kind_is_refused(content, tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"clip\.mp4 cannot be read as a video \(.+export it anew"):
        Footage(str(path))


def test_sound_alone_is_refused(tmp_path):
    path = tmp_path / "song.wav"
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 8000, 0, "NONE", ""))
        file.writeframes(bytes(16000))
    with pytest.raises(ValueError, match=r"song\.wav holds no video stream"):
        Footage(str(path))


def test_a_colon_in_a_name_is_no_protocol(tmp_path, monkeypatch):
    path = clips.write(tmp_path / "clip.mov", clips.noise(1))
    path.rename(tmp_path / "http:clip.mov")
    monkeypatch.chdir(tmp_path)
    assert len(read("http:clip.mov")[0]) == 1


# Cameras.


def test_a_camera_has_no_end(monkeypatch):
    # FFmpeg's test picture is opened just as a camera is.
    monkeypatch.setitem(video_reader._DEVICES, sys.platform, "lavfi")
    with Footage("camera:testsrc=size=64x48:rate=20") as footage:
        assert footage.expected is None
        found = list(itertools.islice(footage, 100))
    np.testing.assert_allclose([frame.time for frame in found], np.arange(100) / 20, atol=1e-6)
    assert found[0].image_srgb.shape == (48, 64, 3) and found[0].image_srgb.std() > 10


@pytest.mark.parametrize("system", ["linux", "darwin", "win32", "sunos5"])
def test_a_camera_that_is_not_there_is_refused(system, monkeypatch):
    monkeypatch.setattr(sys, "platform", system)
    with pytest.raises(ValueError, match=r"camera:97 cannot be opened \(.+(plug|there are)"):
        Footage("camera:97")


@pytest.mark.parametrize(
    ("system", "name", "expected"),
    [
        ("linux", "0", ("/dev/video0", "v4l2", {})),
        ("linux", "/dev/video2", ("/dev/video2", "v4l2", {})),
        ("darwin", "0", ("0", "avfoundation", {"framerate": "30"})),
        ("win32", "My Webcam", ("video=My Webcam", "dshow", {})),
    ],
)
def test_every_system_has_its_own_names(system, name, expected, monkeypatch):
    asked = []

    def opened(address, format, options):
        asked.append((address, format, options))
        raise ValueError("no such camera")

    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(av, "open", opened)
    with pytest.raises(ValueError, match="no such camera"):
        Footage(f"camera:{name}")
    assert asked == [expected]


def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "clip.mp4")
    with pytest.raises(ValueError, match=r"clip\.mp4 cannot be read as a video, it is a pipe"):
        Footage(str(tmp_path / "clip.mp4"))


# Clocks, pixels and colours as recorders leave them.


def test_joined_recordings_go_on_in_time(tmp_path):
    """Two MPEG-TS put together: the second begins its clock anew."""
    part = clips.write(tmp_path / "a.ts", clips.noise(5), codec="libx264")
    (tmp_path / "b.ts").write_bytes(2 * part.read_bytes())
    _, times, remarks = read(tmp_path / "b.ts")
    np.testing.assert_allclose(times, np.arange(10) / 25, atol=1e-3)
    assert len(remarks) == 1 and "clock starts anew after 0.16 s" in remarks[0]


@pytest.mark.parametrize(("suffix", "codec"), [("avi", "libx264"), ("mpg", "mpeg1video")])
def test_frames_out_of_order_are_no_joint(suffix, codec, tmp_path):
    """AVI has no times, and both have frames that refer to later ones."""
    tags = [("max_b_frames", 2), ("gop_size", 12)]
    path = clips.write(tmp_path / f"a.{suffix}", clips.noise(30), codec=codec, tags=tags)
    _, times, remarks = read(path)
    assert remarks == [] and (np.diff(times) > 0).all()
    np.testing.assert_allclose(times, np.arange(30) / 25, atol=0.09)


@pytest.mark.parametrize(("aspect", "shape"), [((2, 1), (48, 128)), ((1, 2), (96, 64))])
def test_oblong_pixels_become_square(aspect, shape, tmp_path):
    """A ramp across the picture stays one, from one side to the other."""
    ramp = np.linspace(20, 235, 64).astype(np.uint8)[None, None, :, None]
    images = np.broadcast_to(ramp, (2, 48, 64, 3))
    tags = [("sample_aspect_ratio", Fraction(*aspect))]
    path = clips.write(tmp_path / "wide.mp4", images, codec="libx264", tags=tags)
    found, _, remarks = read(path)
    assert found.shape == (2, *shape, 3) and remarks == []
    expected = np.interp(
        np.arange(shape[1]) + 0.5, (np.arange(64) + 0.5) * shape[1] / 64, ramp.ravel()
    )
    np.testing.assert_allclose(found[0, 10, :, 1], expected, atol=6)


def test_interlaced_frames_and_several_videos_are_remarked(tmp_path):
    path = tmp_path / "fields.mp4"
    with av.open(str(path), "w") as container:
        options = {"x264-params": "interlaced=1"}
        streams = [container.add_stream("libx264", rate=25, options=options) for _ in range(2)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        for image in clips.noise(3, (64, 64)):
            for stream in streams:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        for stream in streams:
            container.mux(stream.encode())
    _, _, remarks = read(path)
    assert "2 videos (64×64, 64×64 pixels), and the first" in remarks[0]
    assert sum("is interlaced" in remark for remark in remarks) == 1


@pytest.mark.parametrize(
    ("numbers", "matrix", "encode"),
    [
        ((12, 13), TO_P3, encoded),
        ((12, 2), TO_P3, encoded),
        ((9, 14), TO_BT2020, encoded),
        ((9, 1), TO_BT2020, encoded),
        ((1, 4), np.eye(3), lambda linear: linear ** (1 / 2.2)),
        ((1, 8), np.eye(3), lambda linear: linear),
        ((9, 16), TO_BT2020, pq),
        ((9, 18), TO_BT2020, hlg),
    ],
)
def test_primaries_and_curves_beyond_srgb_are_converted(numbers, matrix, encode, tmp_path):
    """The curves of BT.709's camera are shown as sRGB's, whatever the primaries."""
    linear = np.array([0.5, 0.2, 0.1])
    image = np.round(255 * encode(matrix @ linear)) * np.ones((2, 64, 64, 1))
    names = ("color_primaries", "color_trc", "colorspace", "color_range")
    tags = list(zip(names, (*numbers, 1, 1), strict=True))
    colours = {"dst_colorspace": "ITU709", "dst_color_range": "MPEG"}
    path = clips.write(
        tmp_path / "a.mp4", image.astype(np.uint8), codec="libx264", tags=tags, **colours
    )
    found, _, remarks = read(path)
    step = 0.04 if encode in (pq, hlg) else 0.02  # of 8 bits
    np.testing.assert_allclose(found[0, 32, 32] / 255, encoded(linear), atol=step)
    assert remarks == []
