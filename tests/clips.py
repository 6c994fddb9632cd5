"""Small video files for the tests of what reads and writes them."""

from fractions import Fraction

import av
import numpy as np


def noise(count, size=(48, 64), seed=0):
    """Frames `(count, H, W, 3)` uint8 that have nothing in common."""
    return np.random.default_rng(seed).integers(0, 256, (count, *size, 3), dtype=np.uint8)


def write(path, images, times=None, *, codec=None, tags=(), **options):
    """Write frames, by default without loss, at times in seconds, by default 25 a second.

    Args:
        path: its suffix tells the container.
        images: `(T, H, W, 3)` uint8 sRGB.
        times: of the frames.
        codec: one of YUV, such as `libx264`.
        tags: pairs of what the codec's context is to tell, such as `("color_trc", 16)`.
        options: of `VideoFrame.reformat`.
    """
    times = np.arange(len(images)) / 25 if times is None else times
    lossless = ("png", "rgb24") if path.suffix == ".mov" else ("ffv1", "bgr0")
    codec, pixels = (codec, "yuv420p") if codec else lossless
    muxing = {"movflags": "faststart"} if path.suffix == ".mp4" else {}
    with av.open(str(path), "w", options=muxing) as container:
        stream = container.add_stream(codec, rate=25)
        stream.height, stream.width = images.shape[1:3]
        stream.pix_fmt = pixels
        # An AVI file knows no times, only a rate.
        stream.codec_context.time_base = Fraction(1, 25 if path.suffix == ".avi" else 1000)
        for name, value in tags:
            setattr(stream.codec_context, name, value)
        for image, time in zip(images, times, strict=True):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame = frame.reformat(format=pixels, **options)
            frame.pts, frame.time_base = round(1000 * time), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path
