"""The writer of MP4 files, with PyAV."""

from fractions import Fraction
from pathlib import Path
from typing import Any, Self

import av
import numpy as np

_TICKS = 60_000
"""Clock ticks of the file per second: a multiple of the usual frame rates, also NTSC's."""


class Movie:
    """An MP4 file that grows frame by frame and can be played even if the program is killed."""

    def __init__(self, path: Path):
        # The file consists of complete fragments and nothing is buffered, so it can be played even
        # if the program is killed.
        options = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container: Any = av.open(str(path.absolute()), "w", format="mp4", options=options)
        self._stream: Any = None
        self._path, self._last = path, -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if self._stream is not None:
                self._append(None)
        finally:
            try:
                self._container.close()
            except av.error.FFmpegError as failure:
                raise self._failed(failure) from failure

    def write(self, image_srgb: np.ndarray, seconds: float) -> None:
        """Append an image; later images are resized to the size of the first.

        Args:
            image_srgb: `(H, W, 3)` uint8 sRGB, H and W even.
            seconds: time of the image, in seconds since the first image.

        Raises:
            OSError: if the file cannot be written.
        """
        if self._stream is None:
            self._stream = self._opened(*image_srgb.shape[:2])
        picture = av.VideoFrame.from_ndarray(image_srgb, format="rgb24").reformat(
            width=self._stream.width,
            height=self._stream.height,
            format="yuv420p",
            dst_colorspace="ITU709",
            dst_color_range="MPEG",
        )
        # Times in the file must increase, though a camera's clock may stand still or jump back.
        self._last = max(self._last + 1, round(seconds * _TICKS))
        picture.pts, picture.time_base = self._last, Fraction(1, _TICKS)
        self._append(picture)

    def _append(self, picture: Any) -> None:
        """Encode a picture and write the result; None flushes the encoder."""
        try:
            self._container.mux(self._stream.encode(picture))
        except av.error.FFmpegError as error:
            self._stream = None  # nothing more is to be written
            raise self._failed(error) from error

    def _failed(self, error: Any) -> OSError:
        return OSError(
            f"{self._path} cannot be written: {error.strerror}; make room, or pass another folder"
        )

    def _opened(self, height: int, width: int) -> Any:
        # Builds of FFmpeg without x264 have at least the older MPEG-4 encoder.
        codec = "libx264" if "libx264" in av.codecs_available else "mpeg4"
        options = {"preset": "veryfast", "crf": "20"} if codec == "libx264" else {"b": "4M"}
        # No B-frames (bf): they would delay all pictures by two, and the file would not say so.
        stream: Any = self._container.add_stream(codec, rate=30, options=options | {"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.time_base = Fraction(1, _TICKS)
        stream.codec_context.gop_size = 30
        for matrix in ("colorspace", "color_primaries", "color_trc", "color_range"):
            setattr(stream.codec_context, matrix, 1)  # BT.709, limited range
        return stream
