"""The reader of frames from a video file or a camera, upright and in order, with PyAV."""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import av
import numpy as np
from av import device

from lime_keras.io import colour_space, photo, untrusted
from lime_keras.io.colour_space import Tags
from lime_keras.io.scanner import CAMERA, is_camera

_DEVICES = {"linux": "v4l2", "darwin": "avfoundation", "win32": "dshow"}
"""Name of FFmpeg's camera interface, by `sys.platform`."""
_UNSPECIFIED, _REC709, _HIGH_DEFINITION = 2, 1, 720
_CHANNELS = 3  # channels of every frame as it is returned
_SQUARE = 0.01
"""Part by which pixels may be wider than high, or higher than wide, to count as squares."""
_DISORDER = 0.5  # seconds by which a frame may come too late in a recording of one piece
_WHOLE = 0.9  # share of the announced duration that the frames of a complete file fill at least


@dataclass(frozen=True)
class Frame:
    """One frame of a video, upright.

    Attributes:
        image_srgb: `(H, W, 3)` uint8 sRGB.
        time: seconds since the first frame, from the file's timestamps, so a variable frame rate is
            kept.
    """

    image_srgb: np.ndarray
    time: float


class Footage:
    """An opened video that can be read once: `with Footage(name) as footage: for frame in …`.

    Args:
        source: path of a file, or `CAMERA` and the name of a camera. The name is a number or a
            device file on Linux, and the system's name for the camera elsewhere.

    Attributes:
        expected: number of frames that the file announces; None if it announces none.
        remarks: messages for the user, complete once the last frame was read: damaged parts, which
            are skipped, a file that is cut short, colours that are not sRGB.

    Raises:
        ValueError: if the source is missing, not a video, or has no video stream.
    """

    def __init__(self, source: str):
        self._source = source
        self._container: Any = _camera(source) if is_camera(source) else _file(source)
        try:
            with untrusted.naming(Path(source), "a video"):
                self._begin()
        except BaseException:
            self._container.close()
            raise

    def _begin(self) -> None:
        """Find the video stream, and what the container announces of it."""
        source = self._source
        # The cover picture of a song is a video stream, too.
        videos = self._container.streams.video
        streams = [one for one in videos if not one.disposition & one.disposition.attached_pic]
        if not streams:
            raise ValueError(f"{source} holds no video stream: pass a file with moving pictures")
        self._stream = streams[0]
        self.remarks: list[str] = []
        if len(streams) > 1:
            sizes = ", ".join(f"{stream.width}×{stream.height}" for stream in streams)
            self.remarks.append(
                f"{source} holds {len(streams)} videos ({sizes} pixels), and the first is read"
            )
        self._aspect = float(self._stream.sample_aspect_ratio or 1)
        self._is_joined = self._has_fields = False
        self._rate = float(self._stream.average_rate or self._stream.guessed_rate or 25)
        announced = (self._container.duration or 0) / av.time_base
        self._announced = 0.0 if is_camera(source) else announced
        self.expected: int | None = (
            self._stream.frames or round(self._announced * self._rate) or None
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._container.close()

    def __iter__(self) -> Iterator[Frame]:
        count, now, damaged, seconds, offset, step = 0, 0.0, 0, 0.0, None, 1 / self._rate
        has_order_alone = self._container.format.name == "avi"  # AVI stores no times
        for packet in self._packets():
            try:
                decoded = [(picture, self._pixels(picture)) for picture in packet.decode()]
            except MemoryError:
                raise  # with the file's name
            except av.error.FFmpegError:
                # Codecs tell of what they cannot decode as of invalid data, or as their own error.
                damaged += 1
                continue
            for picture, pixels in decoded:
                stamp = picture.dts if has_order_alone else picture.pts
                seconds += step if count else 0.0
                if stamp is not None:
                    seconds = float(stamp * picture.time_base)
                offset = seconds if offset is None else offset
                back = now - (seconds - offset)
                if count and back > 0 and not is_camera(self._source):
                    if back > _DISORDER or seconds - offset < step / 2:
                        # Joined recordings begin their clocks anew: the time goes on.
                        offset = seconds - now - step
                        self._remark_joint(now)
                    else:  # of MPEG-1, say, with frames that refer to later ones
                        seconds = offset + now + step / 2
                now, count = seconds - offset, count + 1
                if picture.interlaced_frame and not self._has_fields:
                    self._has_fields = True
                    self.remarks.append(
                        f"{self._source} is interlaced: its frames show two moments in alternate "
                        "rows, which differ where something moves; deinterlace it, with `ffmpeg "
                        "-vf bwdif` say"
                    )
                yield Frame(pixels, now)
        if damaged:
            self.remarks.append(f"{self._source}: {damaged} damaged packets were left out")
        spacing = now / (count - 1) if count > 1 else step
        # Matroska announces when the last frame ends by its own clock, which may begin late.
        if max(now, seconds) + spacing < _WHOLE * self._announced:
            self.remarks.append(
                f"{self._source} announces {self._announced:.2f} s, but its pictures end after "
                f"{now:.2f} s: it seems cut short; what there is was read"
            )

    def _remark_joint(self, seconds: float) -> None:
        if not self._is_joined:
            self._is_joined = True
            self.remarks.append(
                f"{self._source}: the clock starts anew after {seconds:.2f} s, as in recordings "
                "that were joined; the times go on from there"
            )

    def _pixels(self, picture: Any) -> np.ndarray:
        """Return the pixels of a decoded picture (see `_upright`), unless it is too large."""
        path = Path(self._source)
        width, height = picture.width, picture.height
        if self._aspect > 1 + _SQUARE:
            width = round(width * self._aspect)
        elif self._aspect < 1 - _SQUARE:
            height = round(height / self._aspect)
        untrusted.check_size(path, width, height, _CHANNELS, photo.LARGEST)
        with untrusted.naming(path, "a video"):
            return _upright(picture, width, height)

    def _packets(self) -> Iterator[Any]:
        """Yield compressed packets and last an empty packet, which flushes the decoder."""
        while True:
            try:
                yield from self._container.demux(self._stream)
                return
            except av.error.BlockingIOError:
                time.sleep(0.002)  # on a Mac: the camera has no picture yet
            except av.error.FFmpegError as error:
                self.remarks.append(f"{self._source} ends early: {error.strerror}")
                return


def _file(source: str) -> Any:
    """Open a file by its absolute path, because FFmpeg would take `a:b.mp4` for a protocol."""
    path = Path(source)
    untrusted.check(path, "a video")
    try:
        return av.open(str(path.absolute()))
    except MemoryError:
        raise
    except Exception as error:  # beside FFmpeg's errors, those of tags that are no text
        raise ValueError(
            f"{source} cannot be read as a video ({getattr(error, 'strerror', None) or error}): it "
            "is damaged, cut short or of another kind; export it anew, as MP4 say"
        ) from error


def _camera(source: str) -> Any:
    """Open a camera; raise ValueError, with the names of the cameras found, if that fails."""
    kind, name = _DEVICES.get(sys.platform, "v4l2"), source.removeprefix(CAMERA)
    address = {"v4l2": f"/dev/video{name}" if name.isdigit() else name, "dshow": f"video={name}"}
    # AVFoundation asks for NTSC's 29.97 frames a second, which few of its cameras have.
    options = {"framerate": "30"} if kind == "avfoundation" else {}
    try:
        return av.open(address.get(kind, name), format=kind, options=options)
    except (av.error.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"{source} cannot be opened ({reason}): {_known(kind)}") from error


def _known(kind: str) -> str:
    """Return the available cameras in words, for an error message."""
    try:
        cameras = [d for d in device.enumerate_input_devices(kind) if "audio" not in d.media_types]
    except (av.error.FFmpegError, ValueError):
        cameras = []
    if not cameras:
        return "no camera was found; plug one in and allow this program to use it"
    return "there are " + ", ".join(f"{CAMERA}{d.name} ({d.description})" for d in cameras)


def _upright(picture: Any, width: int, height: int) -> np.ndarray:
    """Return the pixels `(H, W, 3)`, uint8 sRGB, of PyAV's picture, turned upright.

    `width` and `height` are those in square pixels before it is turned.
    """
    unspecified = picture.colorspace == _UNSPECIFIED
    high = min(picture.width, picture.height) >= _HIGH_DEFINITION
    # If the file names no colour matrix, FFmpeg takes BT.601 even for high definition.
    matrix = "ITU709" if unspecified and high else None
    size: dict[str, Any] = {}
    if (width, height) != (picture.width, picture.height):
        size = {"width": width, "height": height, "interpolation": "BICUBIC"}
    pixels = picture.to_ndarray(format="rgb24", src_colorspace=matrix, **size)
    primaries, transfer = picture.color_primaries, picture.color_trc
    # An unspecified curve is that of all video in standard range.
    points = primaries, transfer if transfer != _UNSPECIFIED else _REC709
    conversion = colour_space.decide(Tags(code_points=points), _CHANNELS, deep=False)
    if not conversion.is_identity:
        pixels = np.round(conversion.convert(pixels / np.float32(255)) * 255).astype(np.uint8)
    matrix_bytes = picture.side_data.get("DISPLAYMATRIX")
    return (
        pixels
        if matrix_bytes is None
        else oriented(pixels, np.frombuffer(bytes(matrix_bytes), np.int32))
    )


def oriented(pixels: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Turn and mirror an image by a display matrix, to the nearest quarter turn.

    Args:
        pixels: `(H, W, C)`.
        matrix: display matrix `(9,)` of a, b, u, c, d, v, x, y, w. It moves the point (p, q), q
            downwards, to (a p + c q, b p + d q).
    """
    a, b, _, c, d = matrix[:5].astype(np.int64)
    if abs(a) + abs(d) < abs(b) + abs(c):
        pixels, a, d = pixels.transpose(1, 0, 2), c, b
    rows, columns = slice(None, None, -1 if d < 0 else 1), slice(None, None, -1 if a < 0 else 1)
    return np.ascontiguousarray(pixels[rows, columns])
