"""The picture and the clip of the live page: a photographed object, seen by a page that runs.

live.png shows the photo, opened. In live.webp its object is cut out by the mask and moved before
its own blurred surroundings, as the camera, with a second object of its material in the picture;
then the light is turned, then the shininess changed. The clip plays as fast as the page ran.
"""

import base64
import io
import json
import os
import shutil
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageFilter
from playwright.sync_api import Page, sync_playwright

SIZE = 640, 480
STEPS = 90
"""Frames of the camera's clip, 15 a second."""
SECONDS = {"camera": 5.0, "turn": 2.5, "logs": 2.0}
"""Length of the clip's parts: what is moved in each."""
SHOWN = 960
"""Width of the clip in pixels."""
LONG = 120_000


def main(url: str, photo: Path, mask: Path, folder: Path) -> None:
    """Write live.png and live.webp into a folder.

    Args:
        url: address of a page of `lime-live`; one of `lime-live --static` runs the browser's own
            engine.
        photo: photo of one object.
        mask: its mask, white where the object is.
        folder: folder of the two files.
    """
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise SystemExit("the page is shown in Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as scratch:
        clip, script = Path(scratch) / "clip.y4m", Path(scratch) / "chromium"
        _write(clip, _moved(Image.open(photo).convert("RGB"), Image.open(mask).convert("L")))
        # The page shows the camera's name, which is the clip's path: a name without folders.
        # As root it would raise its own priority above that of all else.
        limits = "setpriv --bounding-set -sys_nice --inh-caps -sys_nice " * (os.geteuid() == 0)
        script.write_text(f'#!/bin/sh\ncd "{scratch}" && exec {limits}{program} "$@"\n')
        script.chmod(0o755)
        arguments = [
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--use-fake-ui-for-media-stream",
            "--use-fake-device-for-media-stream",
            f"--use-file-for-fake-video-capture={clip.name}",
        ]
        with sync_playwright() as started:
            browser = started.chromium.launch(executable_path=script, args=arguments)
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.set_default_timeout(LONG)
            page.goto(url)
            page.wait_for_selector("body[data-ready]")
            page.set_input_files("#file", photo)
            page.wait_for_selector("#save-json:enabled")
            page.wait_for_selector("body[data-lit]")
            page.wait_for_timeout(1000)
            page.screenshot(path=folder / "live.png")
            print("photo:", _numbers(page))
            _film(page, folder / "live.webp")
            print("moved:", page.inner_text("#speed"), "|", page.inner_text("#timing"))
            print("moved:", _numbers(page))
            print(page.inner_text("#about"))
            browser.close()


def _film(page: Page, path: Path) -> None:
    page.click("#camera")
    page.locator("#speed", has_text="frames/s").wait_for()
    page.click("#clone")
    page.wait_for_timeout(3000)
    pictures, times = [], []
    screen = page.context.new_cdp_session(page)

    def keep(seen: dict[str, Any]) -> None:
        screen.send("Page.screencastFrameAck", {"sessionId": seen["sessionId"]})
        pictures.append(Image.open(io.BytesIO(base64.b64decode(seen["data"]))))
        times.append(seen["metadata"]["timestamp"])

    screen.on("Page.screencastFrame", keep)
    limits = {"maxWidth": SHOWN, "maxHeight": SHOWN}
    screen.send("Page.startScreencast", {"format": "jpeg", "quality": 95, **limits})
    for part, length in SECONDS.items():
        begun = time.monotonic()
        while (share := (time.monotonic() - begun) / length) < 1:
            if part == "turn":
                page.fill("#turn", str(round(150 * np.sin(np.pi * share))))
            elif part == "logs":
                page.fill("#logs", f"{1 + 1.8 * share:.2f}")
            page.wait_for_timeout(100)
    screen.send("Page.stopScreencast")
    # A picture may come after a later one, and some come at once.
    order = [int(at) for at in np.argsort(times)]
    order = [at for at, after in pairwise(order) if times[after] - times[at] > 0.03] + order[-1:]
    pictures = [pictures[at] for at in order]
    ends = [*(times[at] for at in order), times[order[-1]] + 1.0]
    spans = np.diff(np.rint(1000 * np.array(ends)).astype(int)).tolist()
    pictures[0].save(
        path,
        save_all=True,
        append_images=pictures[1:],
        duration=spans,
        loop=0,
        quality=70,
        method=4,
    )
    print(f"{path.name}: {len(pictures)} pictures, {sum(spans) / 1000:.1f} s")


def _numbers(page: Page) -> str:
    with page.expect_download() as download:
        page.click("#save-json")
    told = json.loads(download.value.path().read_text())
    names = ("diffuse_albedo", "specular_albedo", "exponent")
    return str({name: np.round(told[name], 3).tolist() for name in names})


def _moved(photo: Image.Image, mask: Image.Image) -> list[np.ndarray]:
    width, height = SIZE
    ground = photo.resize((width, width), Image.Resampling.BICUBIC)
    ground = ground.filter(ImageFilter.GaussianBlur(60))
    ground = ground.crop((0, (width - height) // 2, width, (width + height) // 2))
    # The mask ends a pixel early and softly, so that no rim of the old surroundings moves along.
    mask = mask.filter(ImageFilter.MinFilter(3)).filter(ImageFilter.GaussianBlur(0.7))
    box = mask.point(lambda level: 255 * (level > 127)).getbbox()
    if box is None:
        raise SystemExit("the mask is empty")
    left, top, right, bottom = box
    middle = (left + right) / 2, (top + bottom) / 2
    frames = []
    for angle in np.linspace(0, 2 * np.pi, STEPS, endpoint=False):
        size = 0.66 * height / (bottom - top) * (1 + 0.08 * np.sin(angle))
        place = width * (0.5 + 0.14 * np.sin(angle)), height * (0.5 + 0.05 * np.cos(angle))
        tilt = 0.12 * np.sin(angle)
        cos, sin = np.cos(tilt) / size, np.sin(tilt) / size
        # From a frame's pixel to the photo's.
        back = (
            *(cos, sin, middle[0] - cos * place[0] - sin * place[1]),
            *(-sin, cos, middle[1] + sin * place[0] - cos * place[1]),
        )
        moved, cut = (
            layer.transform(SIZE, Image.Transform.AFFINE, back, Image.Resampling.BICUBIC)
            for layer in (photo, mask)
        )
        frames.append(np.asarray(Image.composite(moved, ground, cut)))
    return frames


def _write(path: Path, frames: list[np.ndarray]) -> None:
    """Write a Y4M file: what Chromium takes for a camera without shifting colours (BT.601)."""
    width, height = SIZE
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{width} H{height} F15:1 Ip A1:1 C420mpeg2\n".encode())
        for frame in frames:
            luma, *chroma = np.moveaxis(np.asarray(Image.fromarray(frame).convert("YCbCr")), 2, 0)
            halves = [
                128 + (plane.reshape(height // 2, 2, width // 2, 2).mean((1, 3)) - 128) * 224 / 255
                for plane in chroma
            ]
            planes = [16 + luma * (219 / 255), *halves]
            file.write(b"FRAME\n" + b"".join(np.rint(p).astype(np.uint8).tobytes() for p in planes))
