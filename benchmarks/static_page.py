"""Size and speed of the page without Python.

    lime-live --static site
    python benchmarks/static_page.py site

The first table has the files' sizes, and what a host's compression leaves of them. The second has
the page's engine in Chromium, asked for frames of 640 × 480 of the page's sample, which moves: the
mask alone, the mask and the material, and the page's rhythm on a slow machine (the material with
every third frame). Each row is the median of the frames' times, and the frames a second of all. The
load of the machine is printed, for nothing here means much on a busy one.
"""

import argparse
import contextlib
import functools
import gzip
import http.server
import os
import shutil
import statistics
import threading
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import sync_playwright

_ROWS = {"mask alone": "false", "mask, material": "true", "every third": "number % 3 === 0"}
_MEASURED = """
async (seconds) => {{
  const {{ createEngine }} = await import("./engine.js");
  const engine = await createEngine(await (await fetch("../engine.json")).json());
  const sample = await createImageBitmap(await (await fetch("../sample.jpg")).blob());
  const canvas = new OffscreenCanvas(640, 480).getContext("2d", {{ willReadFrequently: true }});
  const images = Array.from({{ length: 8 }}, (_, at) => {{
    canvas.drawImage(sample, 10 * at - 40, 0, 640, 480);
    return canvas.getImageData(0, 0, 640, 480);
  }});
  const times = [];
  const first = performance.now();
  for (let number = 0; performance.now() < first + 1000 * (seconds + 2); number++) {{
    const options = {{ material: {material}, light: false, fusion: true }};
    const begun = performance.now();
    await engine.estimate({{ number, image: images[number % 8], mask: null, options }});
    if (begun > first + 2000) times.push(performance.now() - begun);
  }}
  return [engine.about, times];
}}
"""


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("site", type=Path, help="folder that lime-live --static has written")
    parser.add_argument("--seconds", type=float, default=8.0, help="of each row (default: 8)")
    arguments = parser.parse_args()
    print("| | MB | compressed |\n|---|---:|---:|")
    for path in sorted([*arguments.site.glob("runtime/*.wasm"), *arguments.site.glob("graphs/*")]):
        content = path.read_bytes()
        packed = len(gzip.compress(content, 6))
        print(f"| {path.name} | {len(content) / 1e6:.1f} | {packed / 1e6:.1f} |")
    print(f"\nload: {os.getloadavg()}\n\n| | | ms a frame | frames a second |\n|---|---|---:|---:|")
    _tell_speed(arguments.site, arguments.seconds)
    print(f"\nload: {os.getloadavg()}")


def _tell_speed(site: Path, seconds: float) -> None:
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise SystemExit("the speed is measured in Chromium: apt-get install chromium")
    with _serving(site) as port, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for name, material in _ROWS.items():
            page = browser.new_page()
            page.goto(f"http://127.0.0.1:{port}/browser/")
            about, times = page.evaluate(_MEASURED.format(material=material), seconds)
            rate = 1000 * len(times) / sum(times)
            print(f"| {about} | {name} | {statistics.median(times):.0f} | {rate:.1f} |")
            page.close()
        browser.close()


@contextlib.contextmanager
def _serving(site: Path) -> Iterator[int]:
    """Serve a folder with the headers that give WebAssembly threads; yield the port."""

    class Handler(http.server.SimpleHTTPRequestHandler):
        def end_headers(self) -> None:
            self.send_header("Cross-Origin-Opener-Policy", "same-origin")
            self.send_header("Cross-Origin-Embedder-Policy", "require-corp")
            super().end_headers()

        def log_message(self, *_: object) -> None:
            pass

    made = functools.partial(Handler, directory=site)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), made) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


if __name__ == "__main__":
    main()
