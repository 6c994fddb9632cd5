"""The server: its own page alone, the page's files alone, one frame at a time."""

import http.client
import io
import json
import re
import struct
import threading

import numpy as np
import pytest
from live_scenes import ball
from PIL import Image

from lime_keras import Estimator
from lime_keras.io.scanner import SUFFIXES
from lime_keras.live import wire
from lime_keras.live.server import PAGE, LiveServer

FRAME = ball()


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    video = tmp_path_factory.mktemp("source") / "a clip.mp4"
    video.write_bytes(b"not really a clip" * 1000)
    with LiveServer(Estimator("live"), 0, "video", video) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def ask(server, method, path, body=b"", **headers):
    port = server.server_address[1]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    own = {"Host": f"127.0.0.1:{port}"}
    if method == "POST":
        own["Origin"] = f"http://127.0.0.1:{port}"
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    given = {name: value for name, value in (own | named).items() if value is not None}
    connection.putrequest(method, path, skip_host=True)
    for name, value in ({"Content-Length": str(len(body))} | given).items():
        connection.putheader(name, value)
    connection.endheaders()
    try:
        connection.send(body)
    except OSError:
        pass  # refused before it was read
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def frame(image, number=1, **header):
    height, width, _ = image.shape
    pixels = np.concatenate([image, np.full((height, width, 1), 255, np.uint8)], axis=-1)
    text = json.dumps({"number": number, "width": width, "height": height} | header).encode()
    return struct.pack("<I", len(text)) + text + pixels.tobytes()


def read(content):
    (length,) = struct.unpack_from("<I", content)
    return json.loads(content[4 : 4 + length])


def test_it_listens_on_this_computer_alone(server):
    assert server.server_address[0] == "127.0.0.1"


def test_the_page_and_its_files_are_there_and_nothing_else(server):
    answer, content = ask(server, "GET", "/")
    assert answer.status == 200 and b"<title>LIME live" in content
    assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    for name in ("main.js", "style.css", "shading_worker.js", "icon.svg", "sample.jpg"):
        answer, content = ask(server, "GET", f"/{name}")
        assert answer.status == 200 and content == (PAGE / name).read_bytes()
    assert ask(server, "GET", "/main.js")[0].headers["Content-Type"].startswith("text/javascript")
    for path in (
        *("/../server.py", "/..%2fserver.py", "/%2e%2e/server.py", "//etc/passwd", "/etc/passwd"),
        *("/page/main.js", "/browser", "/.", "/main.js/", "/source/", "/nothing"),
    ):
        assert ask(server, "GET", path)[0].status == 404, path


def test_the_page_offers_the_suffixes_that_the_server_reads():
    page = (PAGE / "index.html").read_text(encoding="utf-8")
    offered = re.search(r'id="file" type="file" accept="(.+?)"', page)[1].split(",")
    of_browsers = {".jpg", ".jpeg", ".jpe", ".jfif", ".png", ".webp", ".bmp", ".gif"}  # `image/*`
    assert set(offered) - {"image/*", "video/*"} == set(SUFFIXES) - of_browsers


def test_the_page_is_small():
    """What the wheel carries of it, at most a megabyte."""
    assert sum(path.stat().st_size for path in PAGE.rglob("*") if path.is_file()) < 1e6


def test_the_page_is_told_what_it_begins_with_and_can_fetch_it(server):
    told = json.loads(ask(server, "GET", "/engine.json")[1])
    assert told["engine"] == "server" and told["size"] == 128
    assert told["start"] == {"kind": "video", "name": "a clip.mp4"}
    answer, content = ask(server, "GET", "/source")
    assert content == server.source.read_bytes()
    assert answer.headers["Content-Type"] == "video/mp4"


def test_without_a_source_there_is_none():
    with LiveServer(Estimator("live", only=["mask"]), 0) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        assert json.loads(ask(running, "GET", "/engine.json")[1])["start"] is None
        assert ask(running, "GET", "/source")[0].status == 404
        running.shutdown()
        thread.join()


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:{port}"},
        {"Host": "127.0.0.1"},
        {"Host": None},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "https://127.0.0.1:{port}"},
        {"Origin": "http://127.0.0.1:{port}.evil.example"},
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_other_pages_are_refused(method, headers, server):
    port = server.server_address[1]
    given = {name: value and value.format(port=port) for name, value in headers.items()}
    path = "/" if method == "GET" else "/estimate"
    answer, content = ask(server, method, path, frame(FRAME), **given)
    assert answer.status == 403
    assert server.url in json.loads(content)["error"]
    assert answer.headers["Access-Control-Allow-Origin"] is None


def test_a_frame_without_an_origin_is_refused(server):
    assert ask(server, "POST", "/estimate", frame(FRAME), Origin=None)[0].status == 403


def test_an_answer_carries_the_number_of_its_frame(server):
    for number in (3, 2**40):
        answer, content = ask(server, "POST", "/estimate", frame(FRAME, number, restart=True))
        told = read(content)
        assert answer.status == 200 and told["number"] == number
        assert (told["width"], told["height"]) == (160, 120) and told["found"]
        assert set(told["arrays"]) == {"mask", "specular_shading", "mirror", "light"}
        assert answer.headers["Access-Control-Allow-Origin"] is None


def test_the_fusion_goes_on_until_a_restart(server):
    def fused(**header):
        return read(ask(server, "POST", "/estimate", frame(FRAME, **header))[1])["fused"]

    nothing = {"options": {"material": False}}
    assert fused(restart=True) == fused(**nothing)
    assert fused(**nothing, restart=True) is None


def test_the_frames_of_two_tabs_are_not_fused(server):
    def fused(page, **header):
        answer = ask(server, "POST", "/estimate", frame(FRAME, page=page, **header))[1]
        return read(answer)["fused"]

    nothing = {"options": {"material": False}}
    assert fused("a", restart=True) == fused("a", **nothing)
    assert fused("b", **nothing) is None


def test_a_body_too_large_or_without_a_length_is_refused_unread(server):
    answer, content = ask(server, "POST", "/estimate", Content_Length=str(wire.LARGEST_BODY + 1))
    assert answer.status == 413 and "make it smaller" in json.loads(content)["error"]
    assert ask(server, "POST", "/estimate", Content_Length="9" * 5000)[0].status == 413
    for length in ("-1", "many", "", "٣"):
        raw = length.encode("utf-8").decode("latin-1")
        assert ask(server, "POST", "/estimate", Content_Length=raw)[0].status == 411


def test_what_is_no_frame_is_told_and_the_server_goes_on(server):
    answer, content = ask(server, "POST", "/estimate", b"nonsense")
    assert answer.status == 400 and json.loads(content)["kind"] == "frame"
    assert ask(server, "POST", "/nowhere", b"")[0].status == 404
    assert ask(server, "DELETE", "/")[0].status == 501
    assert ask(server, "POST", "/estimate", frame(FRAME))[0].status == 200


@pytest.mark.parametrize(
    ("fault", "status", "told", "printed"),
    [
        (RuntimeError("a broken graph"), 500, "RuntimeError", "a broken graph"),
        (MemoryError(), 400, "not enough memory", ""),
    ],
)
def test_a_fault_of_the_estimate_is_told_and_the_server_goes_on(
    fault, status, told, printed, server, monkeypatch, capsys
):
    def broken(*_):
        raise fault

    with monkeypatch.context() as patch:
        patch.setattr(server.session, "process", broken)
        answer, content = ask(server, "POST", "/estimate", frame(FRAME))
        assert answer.status == status and told in json.loads(content)["error"]
    assert printed in capsys.readouterr().err
    assert ask(server, "POST", "/estimate", frame(FRAME))[0].status == 200


def test_a_source_that_went_is_told(server, tmp_path, monkeypatch):
    monkeypatch.setattr(server, "source", tmp_path / "gone.mp4")
    answer, content = ask(server, "GET", "/source")
    assert answer.status == 404 and json.loads(content)["error"].startswith("gone.mp4: No such")


def test_one_frame_is_in_flight(server):
    with server.busy:
        answer, content = ask(server, "POST", "/estimate", frame(FRAME))
        assert answer.status == 503 and json.loads(content)["kind"] == "busy"
        assert ask(server, "GET", "/engine.json")[0].status == 200


def test_pictures_that_browsers_cannot_read_are_decoded(server):
    file = io.BytesIO()
    Image.fromarray(FRAME).save(file, "TIFF")
    answer, content = ask(server, "POST", "/decode", file.getvalue(), X_Suffix=".TIF")
    assert answer.headers["Content-Type"] == "image/png"
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(content))), FRAME)
    alpha = np.zeros((*FRAME.shape[:2], 1), np.uint8)
    alpha[10:30, 20:50] = 255
    file = io.BytesIO()
    Image.fromarray(np.dstack([FRAME, alpha])).save(file, "TIFF")
    _, content = ask(server, "POST", "/decode", file.getvalue(), X_Suffix=".tif")
    decoded = np.asarray(Image.open(io.BytesIO(content)))
    assert np.array_equal(decoded[..., 3:], alpha)
    assert np.array_equal(decoded[10:30, 20:50, :3], FRAME[10:30, 20:50])
    answer, content = ask(server, "POST", "/decode", b"nothing", X_Suffix=".exr")
    told = json.loads(content)["error"]
    assert answer.status == 400 and "the picture" in told and "/tmp" not in told
    for suffix in ("", ".py", "/../x.png", ".mp4"):
        assert ask(server, "POST", "/decode", b"", X_Suffix=suffix)[0].status == 400
