"""The page without Python in Chromium: how long its engine takes for the frames of a stream."""

import base64
import contextlib
import functools
import http.server
import importlib.util
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

_START = """
async ({ frames, width, height, options }) => {
  const { createEngine } = await import("./engine.js");
  const engine = await createEngine(await (await fetch("../engine.json")).json());
  const levels = (text) => Uint8ClampedArray.from(atob(text), (letter) => letter.charCodeAt(0));
  const images = frames.map((text) => new ImageData(levels(text), width, height));
  let number = 0;
  window.answer = async () => {
    const image = images[number++ % images.length];
    const begun = performance.now();
    await engine.estimate({ number, image, mask: null, options });
    return (performance.now() - begun) / 1000;
  };
  await window.answer();
}
"""


def missing() -> str | None:
    """Return what lacks to run the page, in words; None if nothing does."""
    if importlib.util.find_spec("playwright") is None:
        return "playwright is not installed (pip install '.[dev]')"
    return None if _program() else "there is no Chromium (apt-get install chromium)"


@contextlib.contextmanager
def opened(
    site: Path, frames: list[np.ndarray], options: Mapping[str, bool], threads: int
) -> Iterator[Callable[[], float]]:
    """Open the page until it has answered once; yield what answers, and returns its seconds.

    Args:
        site: folder that `static.write` wrote.
        frames: frames `(H, W, 3)`, uint8 sRGB, that are shown in turn.
        options: what is asked for, as in `FrameRequest`.
        threads: number of processors that the page is asked of.
    """
    from playwright.sync_api import sync_playwright

    with _serving(site) as address, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=_program(), args=["--no-sandbox"])
        page = browser.new_page()
        page.add_init_script(
            f"Object.defineProperty(navigator, 'hardwareConcurrency', {{ value: {threads} }})"
        )
        page.goto(f"{address}/browser/")
        opaque = [np.dstack([frame, np.full_like(frame[..., 0], 255)]) for frame in frames]
        asked = {
            "frames": [base64.b64encode(frame.tobytes()).decode() for frame in opaque],
            "width": frames[0].shape[1],
            "height": frames[0].shape[0],
            "options": dict(options),
        }
        page.evaluate(_START, asked)
        yield lambda: page.evaluate("answer()")
        browser.close()


def _program() -> str | None:
    return shutil.which("chromium") or shutil.which("google-chrome")


@contextlib.contextmanager
def _serving(site: Path) -> Iterator[str]:
    """Serve a folder with the headers that give WebAssembly threads; yield its address."""
    headers = (site / "_headers").read_text(encoding="utf-8").splitlines()[1:]

    class Handler(http.server.SimpleHTTPRequestHandler):
        def end_headers(self) -> None:
            for header in headers:
                self.send_header(*header.strip().split(": "))
            super().end_headers()

        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Handler, directory=site)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
