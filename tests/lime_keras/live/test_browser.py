"""The page in a real browser: what it shows, says and gives, with the server behind it."""

import contextlib
import io
import json
import re
import socket
import subprocess
import sys
import threading

import chromium
import numpy as np
import pytest
from live_scenes import ball, write_clip
from PIL import Image

from lime_keras import Estimator
from lime_keras.live.server import LiveServer
from lime_keras.optics import colour, compositing, shading, studio_light

playwright = pytest.importorskip("playwright.sync_api", reason="there is no playwright")
pytestmark = pytest.mark.slow
LONG = chromium.LONG

FRAME = ball(240, 320)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    steps = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    frames = [ball(240, 320, place=(0.2 * np.cos(t), 0.1 * np.sin(t))) for t in steps]
    write_clip(folder / "clip.y4m", frames)
    with chromium.browser(folder, *chromium.camera(folder / "clip.y4m")) as running:
        yield running


@pytest.fixture(scope="module")
def estimator():
    return Estimator("live")


@contextlib.contextmanager
def serving(estimator, port=0, kind=None, source=None):
    with LiveServer(estimator, port, kind, source) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def server(estimator):
    with serving(estimator) as running:
        yield running


@contextlib.contextmanager
def opened(browser, url, before=""):
    """The page, ready; `before` is a script that runs before its own."""
    with chromium.tab(browser) as page:
        if before:
            page.add_init_script(before)
        chromium.ready(page, url)
        yield page


@pytest.fixture
def page(browser, server):
    with opened(browser, server.url) as ready:
        yield ready


def png(image):
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", compress_level=1)
    return file.getvalue()


def give(page, content, name="ball.png", kind="image/png"):
    page.set_input_files("#file", {"name": name, "mimeType": kind, "buffer": content})


GIVE = """
async ([way, bytes]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([Uint8Array.from(bytes)], "given.png", { type: "image/png" }));
  const how = { bubbles: true, cancelable: true };
  if (way === "paste") {
    document.dispatchEvent(new ClipboardEvent(way, { clipboardData: transfer, ...how }));
    return;
  }
  for (const type of ["dragenter", "dragover", "drop"]) {
    document.dispatchEvent(new DragEvent(type, { dataTransfer: transfer, ...how }));
  }
}
"""


def seen(page, selector):
    return playwright.expect(page.locator(selector))


def shown(page):
    """Wait for an answer to the picture and return its numbers, from the file that is offered."""
    seen(page, "#coverage").not_to_have_text("–", timeout=LONG)
    seen(page, "#save-json").to_be_enabled(timeout=LONG)
    return json.loads(chromium.taken(page, "#save-json"))


def answered(page):
    """Give the ball and return what is shown of it."""
    give(page, png(FRAME))
    return shown(page)


def fill(page, **values):
    for name, value in values.items():
        page.locator(f"#{name}").fill(str(value))


def test_a_photos_numbers_are_those_of_the_estimator(page, estimator):
    found, expected = answered(page), estimator.estimate(FRAME).to_json()
    assert found["picture"] == "ball.png"
    for name in ("diffuse_albedo", "specular_albedo", "exponent", "exponent_bin_probabilities"):
        assert found[name] == pytest.approx(expected[name], rel=1e-4), name
    assert found["square"] == expected["square"]
    heights = [bar.get_attribute("style") for bar in page.locator("#bins b").all()]
    assert len(heights) == 8 and len(set(heights)) > 1
    seen(page, "#message").to_be_hidden()


def test_the_welcome_vanishes_before_the_first_answer(page):
    seen(page, "#welcome").to_be_visible()
    held = []
    page.route("**/estimate", lambda route: held.append(route))
    with page.expect_request("**/estimate", timeout=LONG):
        give(page, png(FRAME))
    seen(page, "#welcome").to_be_hidden()
    assert page.inner_text("#coverage") == "–"
    held[0].continue_()
    shown(page)


def test_a_transparent_picture_brings_its_mask(page, estimator):
    alpha = np.zeros(FRAME.shape[:2], np.uint8)
    alpha[60:180, 90:230] = 255
    alpha[100, 100] = 77
    whole = np.dstack([FRAME, alpha])
    give(page, png(whole))
    found, expected = shown(page), estimator.estimate(Image.fromarray(whole)).to_json()
    assert found["square"] == expected["square"]
    assert found["exponent"] == pytest.approx(expected["exponent"], rel=1e-3)
    assert found["diffuse_albedo"] == pytest.approx(expected["diffuse_albedo"], abs=1e-3)


@pytest.mark.parametrize("way", ["drop", "paste"])
def test_a_picture_is_dropped_or_pasted(way, page):
    page.evaluate(GIVE, [way, list(png(FRAME))])
    assert shown(page)["picture"] == "given.png"
    seen(page, "#drop").to_be_hidden()


def test_a_picture_that_is_dropped_too_early_waits(browser, server):
    held = []
    with chromium.tab(browser) as page:
        page.route("**/engine.json", lambda route: held.append(route))
        with page.expect_request("**/engine.json"):
            page.goto(server.url)
        seen(page, "#sources").to_have_js_property("inert", True)
        page.evaluate(GIVE, ["drop", list(png(FRAME))])
        assert page.inner_text("#coverage") == "–"
        held[0].continue_()
        assert shown(page)["picture"] == "given.png"


def test_the_sample_is_estimated(page):
    page.click("#sample")
    found = shown(page)
    red, green, blue = found["diffuse_albedo"]
    assert red > 2 * green > 2 * blue  # it is of copper's colour


def test_the_camera_is_followed_frozen_and_taken_up_again(page, estimator):
    page.click("#camera")
    found = shown(page)
    expected = estimator.estimate(FRAME)
    # The clip's chroma has half its resolution, and the ball moves.
    assert found["diffuse_albedo"] == pytest.approx(expected.diffuse_albedo, abs=0.15)
    seen(page, "#speed").to_contain_text("frames/s", timeout=LONG)
    page.click("#seen-title")  # a button that has the focus takes the space for itself
    page.keyboard.press(" ")
    seen(page, "#freeze").to_have_attribute("aria-pressed", "true")
    seen(page, "#status").to_have_text("Frozen")
    page.keyboard.press(" ")
    seen(page, "#freeze").to_have_attribute("aria-pressed", "false")


def test_a_lost_camera_is_told(browser, server):
    keep = """
      const ask = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
      navigator.mediaDevices.getUserMedia = async (wanted) => (window.given = await ask(wanted));
    """
    with opened(browser, server.url, keep) as page:
        page.click("#camera")
        shown(page)
        page.evaluate(
            """() => {
              const [track] = window.given.getTracks();
              track.stop();
              track.dispatchEvent(new Event("ended"));
            }"""
        )
        seen(page, "#message").to_contain_text("camera", timeout=LONG)
        seen(page, "#stage").to_have_class("stage stale")


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        (["--use-fake-device-for-media-stream", "--deny-permission-prompts"], "not allowed"),
        (["--use-fake-ui-for-media-stream"], "No camera was found"),
    ],
)
def test_a_browsers_own_refusal_is_told(flags, told, browser, server, tmp_path):
    with chromium.another(browser, tmp_path, *flags) as other, opened(other, server.url) as page:
        page.click("#camera")
        seen(page, "#message").to_contain_text(told, timeout=LONG)


def test_one_of_two_cameras_is_chosen(browser, server, tmp_path):
    flags = ["--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream=device-count=2"]
    with chromium.another(browser, tmp_path, *flags) as other, opened(other, server.url) as page:
        page.click("#camera")
        seen(page, "#cameras option").to_have_count(2, timeout=LONG)
        first, second = page.locator("#cameras option").all_inner_texts()
        seen(page, "#status").to_have_text(first)
        page.select_option("#cameras", label=second)
        seen(page, "#status").to_have_text(second, timeout=LONG)
        seen(page, "#message").to_be_hidden()


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("NotAllowedError", "not allowed"),
        ("NotFoundError", "No camera was found"),
        ("NotReadableError", "Another program uses the camera"),
        ("TypeError", "cannot be opened"),
        (None, "HTTPS"),
    ],
)
def test_a_camera_that_cannot_be_had_is_told(fault, told, browser, server):
    refuse = f"""
      navigator.mediaDevices.getUserMedia = async () => {{
        throw new DOMException("no", {fault!r});
      }};
    """
    absent = "Object.defineProperty(navigator, 'mediaDevices', { value: undefined });"
    with opened(browser, server.url, refuse if fault else absent) as page:
        page.click("#camera")
        seen(page, "#message").to_contain_text(told, timeout=LONG)
        # And a photo still works.
        answered(page)
        seen(page, "#message").to_be_hidden()


@contextlib.contextmanager
def running(port):
    """The command as a process of its own, which can be ended."""
    arguments = ["--no-browser", "--port", str(port)]
    code = f"from lime_keras.commands.live import main; main({arguments})"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline().startswith("http://127.0.0.1")
        yield
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("source", ["photo", "camera"])
def test_the_server_goes_and_comes_back(source, browser):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with contextlib.ExitStack() as stack:
        with running(port):
            page = stack.enter_context(opened(browser, f"http://127.0.0.1:{port}/"))
            if source == "camera":
                page.click("#camera")
                shown(page)
        if source == "photo":
            give(page, png(FRAME))
        seen(page, "#message").to_contain_text("start lime-live again", timeout=LONG)
        seen(page, "#stage").to_have_class("stage stale")
        with running(port):
            seen(page, "#message").to_be_hidden(timeout=LONG)
            seen(page, "#stage").to_have_class("stage")
            shown(page)


def broken(page):
    """Let the server refuse each frame, until `page.unroute_all` is called."""
    refusal = json.dumps({"error": "this one is broken", "kind": "frame"})
    page.route("**/estimate", lambda route: route.fulfill(status=400, body=refusal))


def picture(page):
    """Return what the canvas of the frame holds."""
    return page.evaluate("() => document.getElementById('frame').toDataURL()")


def test_a_frame_that_cannot_be_estimated_greys_the_last_good_one(page):
    page.click("#camera")
    shown(page)
    broken(page)
    seen(page, "#message").to_have_text("this one is broken", timeout=LONG)
    seen(page, "#stage").to_have_class("stage stale")
    good = picture(page)
    page.wait_for_timeout(500)
    assert picture(page) == good
    page.unroute_all()
    seen(page, "#message").to_be_hidden(timeout=LONG)
    seen(page, "#stage").to_have_class("stage")


def test_a_photo_that_cannot_be_estimated_leaves_the_one_before(page):
    before, good = answered(page), picture(page)
    broken(page)
    give(page, png(FRAME[:, ::-1] // 2), "second.png")
    seen(page, "#message").to_have_text("this one is broken", timeout=LONG)
    seen(page, "#stage").to_have_class("stage stale")
    assert picture(page) == good
    assert json.loads(chromium.taken(page, "#save-json")) == before
    seen(page, "#brush").to_be_disabled()


def test_a_picture_without_an_object_has_no_numbers(page, estimator):
    plain = np.zeros((64, 64, 3), np.uint8)
    assert estimator.estimate(plain).mask_coverage == 0
    answered(page)
    give(page, png(plain), "plain.png")
    seen(page, "#coverage").to_have_text("no object", timeout=LONG)
    seen(page, "#exponent").to_have_text("–")
    seen(page, "#save-json").to_be_disabled()
    seen(page, "#warnings").to_contain_text("No object was found")


@pytest.mark.parametrize(
    ("shape", "told"),
    [((1, 1), "1×1 pixels, too few"), ((15, 400), "too few"), ((8100, 6200), "50 million")],
)
def test_pictures_too_small_or_too_large_are_told(shape, told, page):
    give(page, png(np.zeros((*shape, 3), np.uint8)))
    seen(page, "#message").to_contain_text(told, timeout=LONG)


def test_fifty_million_pixels_are_estimated(page, estimator):
    """The page averages them in linear light, as the estimator would."""
    small, large = (
        np.repeat(np.repeat(FRAME[:200], 15 * k, axis=0), 13 * k, axis=1) for k in (1, 2)
    )
    assert 48e6 < large[..., 0].size <= 50e6
    give(page, png(large))
    found, expected = shown(page), estimator.estimate(small)
    assert found["diffuse_albedo"] == pytest.approx(expected.diffuse_albedo, abs=0.05)


@pytest.mark.parametrize(
    ("content", "name", "kind", "told"),
    [
        (b"no picture", "a.png", "image/png", "cannot be read"),
        (b"no picture", "a.exr", "", "cannot be read"),
        (b"no picture", "a.txt", "text/plain", "a.txt|.txt is no picture"),
        (b"no video", "a.mp4", "video/mp4", "cannot be played"),
    ],
)
def test_files_that_are_no_pictures_are_told(content, name, kind, told, page):
    give(page, content, name, kind)
    seen(page, "#message").to_contain_text(re.compile(told), timeout=LONG)


def test_a_picture_that_only_the_server_can_read(page):
    file = io.BytesIO()
    Image.fromarray(FRAME).save(file, "TIFF")
    give(page, file.getvalue(), "ball.tif", "image/tiff")
    assert shown(page)["picture"] == "ball.tif"


def test_the_object_is_shaded_by_the_sums_of_the_library(page):
    """From the sliders through worker and shader to the picture that is saved."""
    answered(page)
    page.click("[data-shape=sphere]")
    page.click("[data-light=studio]")
    fill(page, red=0.6, green=0.3, blue=0.1, ms=0.4, logs=1.5, stops=-1)
    seen(page, "#edited").to_be_visible()
    page.wait_for_selector("body[data-lit]", timeout=LONG)
    content = chromium.taken(page, "#save-png")
    picture = np.asarray(Image.open(io.BytesIO(content)), np.float64) / 255
    height, width, _ = picture.shape
    radius = 0.97 * min(height, width) / 2
    y, x = np.mgrid[:height, :width] + 0.5
    x, y = (x - width / 2) / radius, (height / 2 - y) / radius
    inside = np.hypot(x, y) < 0.97
    assert picture[inside][:, 3].min() == 1 and picture[np.hypot(x, y) > 1.03][:, 3].max() == 0
    some = np.flatnonzero(inside.ravel())[::997]
    x, y = x.ravel()[some], y.ravel()[some]
    n = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)
    texels, energy = shading.texels(studio_light.light() / 2)
    o = np.broadcast_to((0.0, 0.0, 1.0), n.shape)
    linear = compositing.compose(
        np.array([[0.6, 0.3, 0.1]]),
        np.array([0.4]),
        np.zeros(1),
        shading.diffuse(n, texels, energy)[None, :, None, None],
        shading.specular(n, o, 10**1.5, texels, energy)[None, :, None, None],
    )[0, :, 0]
    expected = colour.linear_to_srgb(np.clip(linear, 0, 1))
    found = picture.reshape(-1, 4)[some, :3]
    assert np.abs(found - expected).max() < 0.03


def test_a_slider_that_goes_and_comes_back_leaves_the_object_as_it_was(page):
    """The way back ends while the first table is still summed, and the way's own one waits."""
    page.click("[data-light=studio]")
    page.wait_for_selector("body[data-lit]", timeout=LONG)
    answered(page)
    move = """(values) => {
      const slider = document.getElementById("logs");
      for (const value of values) {
        slider.value = value;
        slider.dispatchEvent(new Event("input"));
      }
    }"""
    pictures = []
    for values in ([2.5], [1.0], [2.5, 0.5, 2.5]):
        page.evaluate(move, values)
        page.wait_for_selector("body[data-lit]", timeout=LONG)
        pictures.append(chromium.taken(page, "#save-png"))
    assert pictures[0] == pictures[2] != pictures[1]


def test_what_is_taken_home_and_given_back(page):
    estimate = answered(page)
    fill(page, ms=0.9)
    found = json.loads(chromium.taken(page, "#save-json"))
    assert found["edited"]["specular_albedo"] == 0.9
    assert found["specular_albedo"] == estimate["specular_albedo"]
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.click("#copy")
    seen(page, "#status").to_contain_text("on the clipboard")
    assert json.loads(page.evaluate("() => navigator.clipboard.readText()")) == found
    document = json.loads(chromium.taken(page, "#save-gltf"))
    assert document["asset"]["version"] == "2.0" and len(document["meshes"]) == 1
    page.click("#before")
    seen(page, "#before-label").to_be_visible()
    page.keyboard.press("r")
    seen(page, "#edited").to_be_hidden()
    assert "edited" not in json.loads(chromium.taken(page, "#save-json"))


def test_a_painted_mask_changes_the_estimate(page):
    before = answered(page)
    # The picture stays as it is after one that cannot be taken.
    give(page, png(np.zeros((1, 1, 3), np.uint8)))
    seen(page, "#stage").to_have_class("stage stale", timeout=LONG)
    page.click("#brush")
    seen(page, "#message").to_be_hidden()
    fill(page, **{"brush-size": 12})
    left, top, width, height = fitted(page, FRAME)
    page.mouse.move(left + 0.04 * width, top + 0.9 * height)
    page.mouse.down()
    page.mouse.move(left + 0.4 * width, top + 0.93 * height, steps=4)
    page.mouse.up()
    playwright.expect(page.locator("#coverage")).not_to_have_text(
        f"{100 * before['mask_coverage']:.0f} %", timeout=LONG
    )
    after = json.loads(chromium.taken(page, "#save-json"))
    assert after["mask_coverage"] > before["mask_coverage"] + 0.02
    page.click("#brush-reset")
    playwright.expect(page.locator("#brush-tools")).to_be_visible()
    page.click("#brush")
    again = json.loads(chromium.taken(page, "#save-json"))
    assert again["mask_coverage"] == pytest.approx(before["mask_coverage"], abs=1e-6)


def fitted(page, image):
    """Where the image is on the page: left, top, width and height; the canvas may be wider."""
    box = page.locator("#overlay").bounding_box()
    scale = min(box["width"] / image.shape[1], box["height"] / image.shape[0])
    width, height = scale * image.shape[1], scale * image.shape[0]
    left = box["x"] + (box["width"] - width) / 2
    return left, box["y"] + (box["height"] - height) / 2, width, height


SLOW = """
  const own = window.fetch;
  window.asked = 0;
  window.fetch = async (...given) => {
    if (given[0] === "estimate") {
      window.asked += 1;
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
    return own(...given);
  };
"""
"""Let each answer take a second more."""


def test_the_times_of_the_parts_follow_a_slow_camera(browser, server):
    """Each frame with a material then has a light, too."""
    with opened(browser, server.url, SLOW) as page:
        answered(page)
        page.click("#camera")
        seen(page, "#speed").to_be_visible(timeout=LONG)
        before = page.inner_text("#timing")
        parts = page.get_attribute("#timing", "title")
        assert re.fullmatch(r"(mask|material|light) \d+ ms, .*light \d+ ms, .*", parts)
        seen(page, "#timing").not_to_have_text(before, timeout=LONG)


def test_of_two_quick_strokes_the_last_answer_has_both(browser, server):
    """The first one's answer comes when the second is on its way already."""
    with opened(browser, server.url, SLOW) as page:
        before = answered(page)["mask_coverage"]
        page.click("#brush")
        fill(page, **{"brush-size": 12})
        left, top, width, height = fitted(page, FRAME)
        for share in (0.06, 0.94):
            page.mouse.move(left + share * width, top + 0.3 * height)
            page.mouse.down()
            page.mouse.move(left + share * width, top + 0.7 * height, steps=2)
            page.mouse.up()
        seen(page, "#coverage").not_to_have_text(f"{100 * before:.0f} %", timeout=LONG)
        page.wait_for_timeout(3000)
        assert page.evaluate("() => window.asked") <= 4
        # A stroke alone covers 5 % and more of the frame.
        after = json.loads(chromium.taken(page, "#save-json"))["mask_coverage"]
        assert after > before + 0.08


def test_keys_do_what_the_buttons_do(page):
    answered(page)
    page.keyboard.press("1")
    seen(page, "[data-shape=sphere]").to_have_attribute("aria-checked", "true")
    empty = """() => { const { width, height } = document.getElementById("overlay");
      const context = document.getElementById("overlay").getContext("2d");
      return context.getImageData(0, 0, width, height).data.every((value) => value === 0); }"""
    assert not page.evaluate(empty)
    page.keyboard.press("m")
    seen(page, "#outline").to_have_attribute("aria-pressed", "false")
    assert page.evaluate(empty)
    page.keyboard.press("3")
    page.wait_for_timeout(500)
    knot = chromium.taken(page, "#save-png")
    page.focus("#object")
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(500)
    assert chromium.taken(page, "#save-png") != knot


def test_a_users_mesh_is_shown_and_a_damaged_one_told(page):
    trimesh = pytest.importorskip("trimesh")
    content = trimesh.creation.icosphere(2).export(file_type="ply")
    mesh = {"name": "mine.ply", "mimeType": ""}
    page.set_input_files("#mesh", mesh | {"buffer": content})
    seen(page, "[data-shape=own]").to_have_attribute("aria-checked", "true")
    page.set_input_files("#mesh", mesh | {"buffer": content[:-50]})
    seen(page, "#object-message").to_contain_text("mine.ply cannot be shown")


def test_everything_that_can_be_used_has_a_name(page):
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, select, input, [role]")]
          .filter((part) => !part.matches("[role=alert], [role=status]"))
          .filter((part) => !part.closest("[aria-hidden=true]"))
          .filter((part) => !(part.getAttribute("aria-label") || part.textContent.trim()
            || part.labels?.[0]?.textContent.trim()
            || document.getElementById(part.getAttribute("aria-labelledby"))))
          .map((part) => part.outerHTML)"""
    )
    assert nameless == []


BEYOND = """
() => [...document.querySelectorAll(".pane, .pane *, header *")].filter((part) => {
  if (part.matches("#edges *")) return false; // as wide as nothing, and centred there
  const box = part.getBoundingClientRect();
  const around = (part.parentElement.closest(".pane") ?? document.body).getBoundingClientRect();
  return box.width && (box.left < around.left - 0.5 || box.right > around.right + 0.5);
}).map((part) => part.outerHTML)
"""


@pytest.mark.parametrize("width", [360, 700, 870, 1024, 1400])
def test_nothing_is_cut_off_at_any_width(width, page):
    page.set_viewport_size({"width": width, "height": 900})
    answered(page)
    page.click("#brush")
    seen(page, "#brush-tools").to_be_visible()
    assert page.evaluate(BEYOND) == []
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    page.click("#brush")
    if width == 1400:
        assert page.evaluate("() => document.documentElement.scrollHeight") <= 900


def test_warnings_come_without_moving_the_page(page):
    below = [page.locator(name).bounding_box() for name in ("#other", "#estimate", "footer")]
    give(page, png(np.zeros((64, 64, 3), np.uint8)))
    seen(page, "#warnings").to_be_visible(timeout=LONG)
    now = [page.locator(name).bounding_box() for name in ("#other", "#estimate", "footer")]
    assert [box["y"] for box in now] == [box["y"] for box in below]


LONGEST = "rather glossy (84 %)"
SIZES = {"phone": (360, 800), "tablet": (768, 1024), "desktop": (1280, 800)}


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_warnings_hide_nothing_of_the_picture(size, page):
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    give(page, png(FRAME // 8))
    seen(page, "#warnings").to_be_visible(timeout=LONG)
    shown(page)
    picture, told = (page.locator(name).bounding_box() for name in ("#stage", "#warnings"))
    assert told["y"] >= picture["y"] + picture["height"]
    assert page.evaluate(BEYOND) == []


def test_nothing_wraps_on_a_small_desktop(page):
    """Each row of numbers, and of buttons, is one line."""
    page.set_viewport_size({"width": 1280, "height": 800})
    answered(page)
    page.evaluate("text => (document.getElementById('gloss').textContent = text)", LONGEST)
    rows = [row.bounding_box()["height"] for row in page.locator(".numbers div").all()]
    assert max(rows) < 32
    for tools in (".tools.take", "#seen > .tools", "#other > .tools", "header .sources"):
        parts = page.locator(f"{tools} > :not(.away):visible").all()
        assert len({round(part.bounding_box()["y"]) for part in parts}) == 1, tools


def test_a_gloss_is_told_in_words_with_its_interval(page, estimator):
    numbers = answered(page)
    material = estimator.estimate(FRAME)
    assert numbers["gloss"] == page.inner_text("#gloss") == material.gloss
    assert numbers["exponent_interval"] == pytest.approx(material.exponent_interval, rel=0.02)
    assert numbers["roughness"] == pytest.approx(material.roughness, rel=0.01)
    assert numbers["diffuse_srgb_hex"] == material.diffuse_srgb_hex


def test_a_sample_is_chosen_or_the_next_one_tried(page):
    page.locator("[data-sample$='hat.jpg']").click()
    shown(page)
    seen(page, "#status").to_have_text("hat.jpg")
    for name in ("sample.jpg", "fox.jpg"):
        page.click("#sample")
        seen(page, "#status").to_have_text(name, timeout=LONG)


def test_every_class_of_shininess_is_labelled(page):
    edges = [float(text) for text in page.locator("#edges span").all_inner_texts()]
    assert edges == pytest.approx(list(10 ** (np.arange(9) * 0.375)), rel=0.03)
    bins = [bin.bounding_box()["x"] for bin in page.locator("#bins > span").all()]
    labels = [label.bounding_box()["x"] for label in page.locator("#edges span").all()]
    assert labels[:8] == pytest.approx(bins, abs=5)


OVERLAY = """
() => {
  const overlay = document.getElementById("overlay");
  const { width, height } = overlay;
  const { data } = overlay.getContext("2d").getImageData(0, 0, width, height);
  const columns = Array(width).fill(0);
  for (let at = 0; at < width * height; at++) columns[at % width] += data[4 * at + 3] > 0;
  return columns;
}
"""


def test_the_material_is_cloned_beside_the_object(page):
    """In the picture itself: a sphere of it, as large as the object, in the frame's pixels."""
    give(page, png(ball(240, 320, radius=0.5, place=(-0.7, 0.0))))
    shown(page)
    page.click("#outline")
    page.click("[data-shape=sphere]")
    assert sum(page.evaluate(OVERLAY)) == 0
    page.keyboard.press("i")
    seen(page, "#clone").to_have_attribute("aria-pressed", "true")
    # The page's own policy lets playwright wait for no script.
    columns = np.zeros(1)
    for _ in range(LONG // 100):
        columns = np.array(page.evaluate(OVERLAY))
        if columns.any():
            break
        page.wait_for_timeout(100)
    inside = np.flatnonzero(columns)
    # The ball ends at column 320 · (1 + 0.75 · (−0.7 + 0.5)) / 2 = 136, and is 120 pixels wide.
    assert inside[0] == pytest.approx(136, abs=8)
    assert np.ptp(inside) == pytest.approx(120, abs=12)
    assert columns.sum() == pytest.approx(np.pi / 4 * np.ptp(inside) ** 2, rel=0.05)
    page.keyboard.press("i")
    seen(page, "#clone").to_have_attribute("aria-pressed", "false")
    assert sum(page.evaluate(OVERLAY)) == 0


def test_without_webgl_the_numbers_still_come(browser, server):
    without = """
      const get = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind === "webgl2" ? null : get.call(this, kind, ...more);
      };
    """
    with opened(browser, server.url, without) as page:
        seen(page, "#object-message").to_contain_text("WebGL 2")
        answered(page)


def test_it_begins_with_the_photo_it_was_started_with(browser, estimator, tmp_path):
    path = tmp_path / "my ball.png"
    path.write_bytes(png(FRAME))
    with (
        serving(estimator, kind="photo", source=path) as server,
        opened(browser, server.url) as page,
    ):
        assert shown(page)["picture"] == "my ball.png"


def test_a_video_is_followed(browser, estimator, tmp_path):
    from lime_keras.io.video_writer import Movie

    with Movie(tmp_path / "clip.mp4") as movie:
        for number in range(10):
            movie.write(ball(240, 320, place=(0.02 * number, 0)), number / 10)
    with (
        serving(estimator, kind="video", source=tmp_path / "clip.mp4") as server,
        opened(browser, server.url) as page,
    ):
        found = shown(page)
        assert found["picture"] == "clip.mp4" and found["fused"]
        page.keyboard.press("f")
        seen(page, "#fusion").to_have_attribute("aria-pressed", "false")
        assert "fused" not in json.loads(chromium.taken(page, "#save-json"))
