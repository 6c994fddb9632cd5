"""The page without Python in a real browser: its engine gives Python's answers."""

import base64
import json

import chromium
import live_scenes
import numpy as np
import pytest
import static_page
from static_page import HEADERS

from lime_keras.estimate.estimator import Estimator
from lime_keras.live.session import FrameRequest, Session

pytestmark = pytest.mark.slow

ESTIMATE = """
async ({ levels, masks, width, height, options }) => {
  const { createEngine } = await import("./engine.js");
  const config = await (await fetch("../engine.json")).json();
  const told = [];
  const engine = await createEngine({ ...config, progress: (text) => told.push(text) });
  const bytes = (text) => Uint8ClampedArray.from(atob(text), (letter) => letter.charCodeAt(0));
  const answers = [];
  for (const [number, content] of levels.entries()) {
    const image = new ImageData(bytes(content), width, height);
    const mask = masks[number] && Uint8Array.from(bytes(masks[number]));
    answers.push(await engine.estimate({ number, image, mask, options }));
  }
  await engine.compared;
  const plain = (_, value) => (ArrayBuffer.isView(value) ? [...value] : value);
  const all = { answers, told, about: engine.about, next: engine.next?.about };
  return JSON.parse(JSON.stringify(all, plain));
}
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    if not static_page.RUNTIME.is_dir():
        pytest.skip(f"there is no onnxruntime-web: npm install --prefix {static_page.EXAMPLES}")
    return static_page.write(tmp_path_factory.mktemp("static"))


@pytest.fixture(scope="module")
def chrome(tmp_path_factory):
    flags = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader")
    resolved = "--host-resolver-rules=MAP page.test 127.0.0.1"
    folder = tmp_path_factory.mktemp("chromium")
    frames = [live_scenes.ball(place=(0.02 * number, 0)) for number in range(10)]
    live_scenes.write_clip(folder / "clip.y4m", frames)
    camera = chromium.camera(folder / "clip.y4m")
    with chromium.browser(folder, *flags, resolved, *camera) as browser:
        yield browser


@pytest.fixture
def page(chrome):
    with chromium.tab(chrome) as ready:
        yield ready


def frames():
    """A ball that fills the frame, a small one twice, a moved one, a painted one in a new scene."""
    small = live_scenes.ball(radius=0.3, place=(0.5, -0.3))
    moved = live_scenes.ball(radius=0.7, place=(0.1, 0.0))
    other = live_scenes.ball(radius=0.6, colour=(0.1, 0.3, 0.8))[:, :, ::-1] // 2
    painted = np.zeros((120, 160), np.uint8)
    painted[30:90, 40:110] = 255
    return [live_scenes.ball(), small, small, moved, other], [None, None, None, None, painted]


def asked(images, masks):
    encoded = [
        base64.b64encode(np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])).decode()
        for image in images
    ]
    painted = [mask if mask is None else base64.b64encode(mask).decode() for mask in masks]
    options = {"material": True, "layers": True, "light": True, "fusion": True}
    height, width = images[0].shape[:2]
    return {
        "levels": encoded,
        "masks": painted,
        "width": width,
        "height": height,
        "options": options,
    }


def test_the_browser_answers_as_python_does(written, page, within=1e-3):
    """Framing, second look, given mask, material, fusion, cut and light, frame by frame."""
    images, masks = frames()
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        found = page.evaluate(ESTIMATE, asked(images, masks))
    assert found["about"].startswith("WebAssembly")
    assert any("MB" in text for text in found["told"])
    session = Session(Estimator("live"))
    for image, mask, answer in zip(images, masks, found["answers"], strict=True):
        expected = session.process(image, mask, FrameRequest())
        told = expected.numbers
        codes = [[warning["code"] for warning in told["warnings"]] for told in (answer, told)]
        assert codes[0] == codes[1]
        same = ("found", "cut", "size")
        assert [answer[name] for name in same] == [told[name] for name in same]
        assert answer["ms"].keys() == told["ms"].keys()
        assert answer["square"] == pytest.approx(told["square"], abs=160 * within / 10)
        assert answer["mask_coverage"] == pytest.approx(told["mask_coverage"], abs=within / 5)
        for name in ("material", "fused"):
            compare(answer[name], told[name], within)
        for name, value in expected.arrays.items():
            seen = answer["light"]["data"] if name == "light" else answer["layers"][name]
            difference = np.abs(np.reshape(seen, value.shape) - value)
            assert np.mean(difference) <= 2 * within * np.mean(value), name
    sides = [answer["square"][2] for answer in found["answers"]]
    assert sides[0] == 160 and sides[2] < 80  # the second small one is looked at where it was
    assert {answer["cut"] for answer in found["answers"]} == {False, True}


def compare(found, expected, within):
    assert found["diffuse_albedo"] == pytest.approx(expected["diffuse_albedo"], abs=within)
    assert found["specular_albedo"] == pytest.approx(expected["specular_albedo"], abs=within)
    assert np.log10(found["exponent"] / expected["exponent"]) == pytest.approx(0, abs=2 * within)
    for name in expected.keys() - {"diffuse_albedo", "specular_albedo", "exponent"}:
        assert found[name] == pytest.approx(expected[name], abs=5 * within), name


@pytest.mark.parametrize("headers", [HEADERS, ()], ids=["headers", "service worker"])
def test_webassembly_gets_threads(headers, written, page):
    """From the host's headers, or from the service worker where the host sets none."""
    with chromium.serving(written, headers) as port:
        page.goto(f"http://127.0.0.1:{port}/")
        page.wait_for_function("crossOriginIsolated")
        page.wait_for_function("document.getElementById('about').textContent.includes('thread')")
        about = page.text_content("#about")
        cores = page.evaluate("navigator.hardwareConcurrency")
    assert f"{min(cores, 4)} thread" in about


def test_the_page_estimates_its_sample(written, page):
    """The click waits until the page takes it: before the engine is there, it would be lost."""
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/")
        page.click("#sample")
        page.wait_for_function("document.getElementById('exponent').textContent.match(/[0-9]/)")


def test_the_page_follows_the_camera(written, page):
    with chromium.serving(written, HEADERS) as port:
        chromium.ready(page, f"http://127.0.0.1:{port}/")
        page.click("#camera")
        page.wait_for_selector("#speed:visible")
        page.wait_for_selector("#save-json:enabled")
        found = json.loads(chromium.taken(page, "#save-json"))
    expected = Estimator("live").estimate(live_scenes.ball())
    # The clip's chroma has half its resolution, and the ball moves.
    assert found["fused"]["diffuse_albedo"] == pytest.approx(expected.diffuse_albedo, abs=0.15)
    assert page.inner_text("#message") == ""


def test_without_isolation_there_is_one_thread(written, page):
    """As on a page that a browser does not isolate: here, one without headers or preflight."""
    with chromium.serving(written) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        found = page.evaluate(ESTIMATE, asked([live_scenes.ball()], [None]))
    assert found["about"] == "WebAssembly, 1 thread"
    assert found["answers"][0]["found"]


GRAPHICS = """
navigator.gpu.requestAdapter = async () => ({ info: { isFallbackAdapter: false } });
"""


@pytest.mark.parametrize("script", ["", GRAPHICS], ids=["imitated", "broken"])
def test_graphics_that_are_no_help_are_not_used(script, written, page):
    """A processor imitated by SwiftShader, 400 times slower; and one that fails at the start."""
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        page.evaluate(f"navigator.gpu && (() => {{ {script} }})()")
        if script:
            page.route("**/*.jspi.*", lambda route: route.abort())
        found = page.evaluate(ESTIMATE, asked([live_scenes.ball()], [None]))
    assert "next" not in found and found["about"].startswith("WebAssembly")


TIMES = """
(faster) => {
  navigator.gpu.requestAdapter = async () => ({ info: { isFallbackAdapter: false } });
  const Real = self.Worker;
  self.Worker = class {
    constructor(address, options) {
      this.real = new Real(address, options);
      this.real.onmessage = (event) => this.onmessage(event);
    }
    postMessage(message) {
      this.time ||= message.load?.backend === "webgpu" ? faster : !faster;
      if (message.load) message.load.backend = "wasm";
      if (!message.time) return this.real.postMessage(message);
      setTimeout(() => {
        this.onmessage({ data: { done: this.time ? 1 : 2 } });
        self.timed = (self.timed ?? 0) + 1;
      });
    }
    terminate() { this.real.terminate(); }
  };
}
"""
"""Both are WebAssembly then, and tell the times that the test gives them."""

FASTER = """
async () => {
  const { createEngine } = await import("./engine.js");
  const engine = await createEngine(await (await fetch("../engine.json")).json());
  const first = engine.about;
  const image = new ImageData(20, 20);
  const options = { material: false, light: false, fusion: false };
  const numbers = [];
  const estimate = async (number) => {
    const answer = await engine.estimate({ number, image, mask: null, options });
    numbers.push(answer.number);
  };
  await Promise.all([estimate(0), engine.compared]);
  await estimate(1);
  return [first, engine.about, numbers];
}
"""


@pytest.mark.parametrize("faster", [True, False])
def test_the_faster_backend_is_used(faster, written, page):
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        page.evaluate(TIMES, faster)
        first, then, numbers = page.evaluate(FASTER)
    assert first.startswith("WebAssembly") and numbers == [0, 1]
    assert then == ("WebGPU" if faster else first)


def test_the_page_names_the_backend_that_it_went_over_to(written, page):
    page.add_init_script(f"({TIMES})(true)")
    with chromium.serving(written, HEADERS) as port:
        chromium.ready(page, f"http://127.0.0.1:{port}/")
        assert "WebAssembly" in page.text_content("#about")
        page.wait_for_function("window.timed === 2")
        page.click("#sample")
        page.wait_for_function("document.getElementById('about').textContent.includes('WebGPU')")


LOST = """
async () => {
  const { createEngine } = await import("./engine.js");
  const engine = await createEngine(await (await fetch("../engine.json")).json());
  const options = { material: false, light: false, fusion: false };
  const image = new ImageData(20, 20);
  const frame = { number: 0, image, mask: null, options };
  const told = [];
  const asked = engine.estimate(frame).catch((error) => told.push(error.kind, error.message));
  engine.worker.worker.dispatchEvent(new ErrorEvent("error", { message: "out of memory" }));
  await asked;
  const answer = await engine.estimate(frame);
  return [...told, answer.number];
}
"""


def test_a_lost_worker_is_told_and_started_again(written, page):
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        kind, message, number = page.evaluate(LOST)
    assert kind == "gone" and "out of memory" in message and number == 0


CREATE = """
async (change) => {
  const { createEngine } = await import("./engine.js");
  const config = await (await fetch("../engine.json")).json();
  const graph = config.graphs.mask;
  if (change === "missing") graph.path = "graphs/none.onnx";
  if (change === "longer") graph.bytes += 1;
  if (change === "shorter") graph.bytes -= 1;
  return createEngine(config).then(() => "", (error) => error.message);
}
"""


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("missing", "graphs/none.onnx cannot be loaded (404)"),
        ("longer", "incompletely"),
        ("shorter", "export it again"),
    ],
)
def test_a_file_that_is_not_there_or_not_whole_is_told(change, told, written, page):
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/browser/")
        assert told in page.evaluate(CREATE, change)


def test_a_page_from_a_file_says_what_to_do(written, page):
    page.goto((written / "index.html").as_uri())
    assert "python3 -m http.server" in page.text_content(".preflight")
    assert page.text_content("#status") == "Not ready"


def test_a_page_over_http_asks_for_https(written, page):
    with chromium.serving(written, HEADERS) as port:
        chromium.ready(page, f"http://page.test:{port}/")
        assert f"https://page.test:{port}/" in page.text_content(".preflight")
        page.click("#camera")
        page.wait_for_selector("#message:visible")
        assert "HTTPS" in page.text_content("#message")


def test_a_browser_without_simd_is_told(written, page):
    page.add_init_script("WebAssembly.validate = () => false;")
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/")
        assert "SIMD" in page.text_content(".preflight")


def test_a_browser_that_can_all_is_told_nothing(written, page):
    with chromium.serving(written, HEADERS) as port:
        page.goto(f"http://127.0.0.1:{port}/")
        assert page.query_selector(".preflight") is None
