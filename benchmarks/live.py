"""Frames a second of the live page with either engine.

    python benchmarks/live.py
    python benchmarks/live.py --browser --static http://localhost:8000/

The server is asked over HTTP, as the page asks it, for frames of 640 × 480 of a moving ball: the
mask alone, the mask and the material, the page's rhythm (layers with every third frame), and the
light as well. The page captures and draws besides; `--browser` runs it in Chromium on a clip of
the same frames, and counts the answers that it shows. So does `--static` with a page of
`lime-live --static`, which is served elsewhere (`python3 -m http.server -d site`).

Each row has, after a second of warming up, the median of the frames' times, the frames a second in
the mean, and the processors' time of a frame, which other programs change less: of a page that of
the server, the browser and what drives it (on Linux). The load of the machine before and after is
printed, for nothing here means much on a busy one.
"""

import argparse
import contextlib
import http.client
import json
import os
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from lime_keras import Estimator
from lime_keras.live.server import LiveServer

_SHAPE = 480, 640
_WARMING = 1.0
_COUNT = """
  window.answered = [];
  const { prototype } = CanvasRenderingContext2D;
  const put = prototype.putImageData;
  prototype.putImageData = function (...given) {
    if (this.canvas.id === "frame") window.answered.push(performance.now());
    return put.apply(this, given);
  };
"""


def main() -> None:
    """Print the table."""
    arguments = _arguments()
    print(f"load before: {_load()}; {os.cpu_count()} processors\n")
    print("| | ms a frame | frames a second | processors' ms |\n|---|---:|---:|---:|")
    frames = [_ball(0.25 * np.cos(t), 0.1 * np.sin(t)) for t in np.linspace(0, 6.28, 20)]
    with _serving() as server:
        ask = _asker(server, frames)
        rows = {
            "mask alone": lambda _: ask(material=False, layers=False, light=False),
            "mask, material": lambda _: ask(layers=False, light=False),
            "layers with every third": lambda n: ask(layers=n % 3 == 0, light=False),
            "mask, material, light": lambda _: ask(layers=False, light=True),
        }
        for name, one in rows.items():
            times, used = _times(one, arguments.seconds)
            _tell(f"server, {name}", times, f"{1000 * used:.0f}")
    if arguments.browser:
        with _command() as url:
            _tell_of_page("page in Chromium", url, frames, arguments.seconds)
    if arguments.static:
        name = "page without Python in Chromium"
        _tell_of_page(name, arguments.static, frames, arguments.seconds)
    print(f"\nload after: {_load()}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=8.0, help="of each row (default: 8)")
    parser.add_argument("--browser", action="store_true", help="run the page in Chromium, too")
    parser.add_argument("--static", metavar="URL", help="run this page in Chromium, too")
    return parser.parse_args()


def _load() -> str:
    return " ".join(f"{value:.1f}" for value in os.getloadavg())


def _tell(name: str, times: list[float], used: str = "–") -> None:
    """Print a row of times in seconds; every third frame may cost more, so the rate is a mean."""
    median, rate = statistics.median(times), len(times) / sum(times)
    print(f"| {name} | {1000 * median:.0f} | {rate:.1f} | {used} |", flush=True)


def _times(one: Callable[[int], Any], seconds: float) -> tuple[list[float], float]:
    """Return the seconds of each call with its number, and the mean of the processors' seconds.

    The calls of the first second do not count.
    """
    times: list[float] = []
    first, number, used = time.perf_counter(), 0, 0.0
    while (begun := time.perf_counter()) < first + _WARMING + seconds or len(times) < 6:
        before = time.process_time()
        one(number)
        number += 1
        if begun > first + _WARMING:
            times.append(time.perf_counter() - begun)
            used += time.process_time() - before
    return times, used / len(times)


@contextlib.contextmanager
def _serving() -> Iterator[LiveServer]:
    with LiveServer(Estimator("live", streaming=True), 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def _asker(server: LiveServer, frames: list[np.ndarray]) -> Callable[..., None]:
    """Return a function that asks for the next frame, with the options of the page."""
    host = server.url.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(host)
    count = 0

    def ask(**options: bool) -> None:
        nonlocal count
        count += 1
        frame = frames[count % len(frames)]
        pixels = np.dstack([frame, np.full(frame.shape[:2], 255, np.uint8)])
        header = {"number": count, "width": frame.shape[1], "height": frame.shape[0]}
        text = json.dumps(header | {"options": options}).encode()
        body = struct.pack("<I", len(text)) + text + pixels.tobytes()
        connection.request("POST", "/estimate", body, {"Origin": f"http://{host}"})
        answer = connection.getresponse()
        content = answer.read()
        if answer.status != 200:
            raise SystemExit(content.decode())

    return ask


def _tell_of_page(name: str, url: str, frames: list[np.ndarray], seconds: float) -> None:
    """Print the row of a page, and what it says of its engine and of the answers' parts."""
    times, used, told = _in_browser(url, frames, seconds)
    _tell(name, times, f"{1000 * used:.0f}")
    print(f"the page says: {told}", file=sys.stderr)


def _in_browser(
    url: str, frames: list[np.ndarray], seconds: float
) -> tuple[list[float], float, str]:
    """Return the seconds between a page's answers, the processors' for each, and what it says."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise SystemExit("the page is run in Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as scratch:
        clip = Path(scratch) / "clip.y4m"
        _write_clip(clip, frames)
        arguments = [
            *("--no-sandbox", "--use-fake-ui-for-media-stream"),
            *("--use-fake-device-for-media-stream", f"--use-file-for-fake-video-capture={clip}"),
        ]
        script = Path(scratch) / "chromium"
        # As root it would raise its own priority above that of the server.
        limits = "setpriv --bounding-set -sys_nice --inh-caps -sys_nice " if not os.getuid() else ""
        script.write_text(f'#!/bin/sh\nexec {limits}{program} "$@"\n')
        script.chmod(0o755)
        with sync_playwright() as started:
            browser = started.chromium.launch(executable_path=script, args=arguments)
            page = browser.new_page()
            page.add_init_script(_COUNT)
            page.goto(url)
            # A page without headers loads once more, for its threads.
            page.wait_for_function(
                "crossOriginIsolated || !document.querySelector('[src*=preflight]')"
            )
            page.wait_for_selector("body[data-ready]", timeout=120_000)
            page.click("#camera")
            page.wait_for_selector("#speed:visible", timeout=120_000)
            page.wait_for_timeout(1000 * _WARMING)
            page.evaluate("answered.length = 0")
            before = _processor_seconds()
            page.wait_for_timeout(1000 * seconds)
            page.wait_for_function("() => answered.length > 6", timeout=120_000)
            moments = page.evaluate("answered")
            used = (_processor_seconds() - before) / len(moments)
            said = [page.inner_text(f"#{name}") for name in ("about", "speed", "timing")]
            told = ": ".join(said)
            browser.close()
    return list(np.diff(moments) / 1000), used, told


def _processor_seconds() -> float:
    """Return the seconds of the processors that all descendants of this process have taken."""
    parents, ticks = {}, {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            number = int(path.parent.name)
            parents[number], ticks[number] = int(fields[1]), int(fields[11]) + int(fields[12])

    def is_own(number: int) -> bool:
        return number == os.getpid() or (number in parents and is_own(parents[number]))

    own = [number for number in parents if number != os.getpid() and is_own(number)]
    return sum(ticks[number] for number in own) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def _command() -> Iterator[str]:
    """Run `lime-live` as its users do, in a process of its own, and yield the page's address."""
    code = "import sys; from lime_keras.commands.live import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "--no-browser", "--port", "0"]
    served = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield cast("IO[str]", served.stdout).readline().split()[0]
    finally:
        served.terminate()
        served.wait()


def _write_clip(path: Path, frames: list[np.ndarray]) -> None:
    """Write frames as Y4M, which a browser reads with as little work as it takes from a camera."""
    height, width = _SHAPE
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{width} H{height} F30:1 Ip A1:1 C420jpeg\n".encode())
        for frame in frames:
            planes = np.moveaxis(np.asarray(Image.fromarray(frame).convert("YCbCr")), -1, 0)
            halves = (plane[::2, ::2].tobytes() for plane in planes[1:])
            file.write(b"FRAME\n" + planes[0].tobytes() + b"".join(halves))


def _ball(right: float, up: float) -> np.ndarray:
    """Return a frame, uint8 sRGB, of a lit ball before a plain wall."""
    height, width = _SHAPE
    y, x = np.mgrid[:height, :width] + 0.5
    x, y = (2 * x - width) / height - right, 1 - 2 * y / height - up
    square = (x**2 + y**2) / 0.6**2
    z = np.sqrt(np.maximum(1 - square, 0))
    lit = np.maximum((-0.5 * x + 0.6 * y) / 0.6 + 0.62 * z, 0)[..., None]
    shine = np.maximum((-0.28 * x + 0.33 * y) / 0.6 + 0.9 * z, 0)[..., None] ** 60
    ball = np.array([0.5, 0.2, 0.08]) * (lit + 0.2) + 0.6 * shine
    linear = np.where((square < 1)[..., None], ball, 0.3 + 0.1 * y[..., None])
    return np.rint(255 * np.clip(linear, 0, 1) ** (1 / 2.2)).astype(np.uint8)


if __name__ == "__main__":
    main()
