"""An MP4 file of pictures, by PyAV."""

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import av
import numpy as np

_TICKS = 60_000
"""A second, in the file's clock: a multiple of the usual frame rates, NTSC's with its 1001."""


class Movie:
    """An MP4 file that grows frame by frame and can be played however it ends.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path):
        # Fragments, and nothing held back: what was written is complete even if the program is
        # killed.
        options = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container: Any = av.open(str(path.absolute()), "w", format="mp4", options=options)
        self._stream: Any = None
        self._path, self._last = path, -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._stream is not None:
                self._append(None)
        finally:
            self._container.close()

    def write(self, image_srgb: np.ndarray, seconds: float) -> None:
        """Append `(H, W, 3)` uint8, H and W even; the first image's size is the file's.

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
        # A file's clock must go on, though a camera's may stand still or jump back.
        self._last = max(self._last + 1, round(seconds * _TICKS))
        picture.pts, picture.time_base = self._last, Fraction(1, _TICKS)
        self._append(picture)

    def _append(self, picture: Any) -> None:
        """Encode one more picture, or at last those that the encoder still holds."""
        try:
            self._container.mux(self._stream.encode(picture))
        except av.error.FFmpegError as error:
            self._stream = None  # nothing more is to be written
            raise OSError(f"{self._path} cannot be written: {error.strerror}") from error

    def _opened(self, height: int, width: int) -> Any:
        # Builds of FFmpeg without x264 have at least its forerunner.
        codec = "libx264" if "libx264" in av.codecs_available else "mpeg4"
        options = {"preset": "veryfast", "crf": "20"} if codec == "libx264" else {"b": "4M"}
        # Pictures predicted from later ones would delay all by two, without a word in the file.
        stream: Any = self._container.add_stream(codec, rate=30, options=options | {"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.time_base = Fraction(1, _TICKS)
        stream.codec_context.gop_size = 30
        for matrix in ("colorspace", "color_primaries", "color_trc", "color_range"):
            setattr(stream.codec_context, matrix, 1)  # BT.709, limited range
        return stream
