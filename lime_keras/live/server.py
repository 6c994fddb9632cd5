"""The server of the live page, for browsers on the same computer alone.

It listens on 127.0.0.1 and answers only its own page: it checks `Host` and `Origin`, so that no
other web page can use it. It serves the page's files, which it reads at the start, and the file
that it was started with. One frame is estimated at a time.
"""

import json
import mimetypes
import os
import shutil
import tempfile
import threading
import traceback
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from lime_keras.estimate.estimator import Estimator
from lime_keras.io import photo
from lime_keras.io.scanner import SUFFIXES
from lime_keras.live import wire
from lime_keras.live.session import Session
from lime_keras.version import __version__

PAGE = Path(__file__).parent / "page"  # folder of the page's files
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".jpg": "image/jpeg",
}
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; "
    "media-src 'self' blob:; connect-src 'self' blob:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(self), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_PATIENCE = 30.0  # seconds without a byte after which a connection is closed
_DIGITS = 20  # largest number of digits of a length that is looked at


class LiveServer(ThreadingHTTPServer):
    """The server; `serve_forever` runs it, `server_close` frees the port.

    Args:
        estimator: model that answers.
        port: port on 127.0.0.1; 0 for any free one.
        kind: what the page begins with, `camera`, `photo` or `video`; None to let the user choose.
        source: file of the photo or video.

    Attributes:
        url: address of the page.

    Raises:
        OSError: if the port is taken.
    """

    daemon_threads = True
    # On Windows another program could listen on the same port, too.
    allow_reuse_address = os.name != "nt"

    def __init__(
        self, estimator: Estimator, port: int, kind: str | None = None, source: Path | None = None
    ):
        self.session, self.source = Session(estimator), source
        self.page = ""
        self.busy = threading.Lock()
        # Type and content of each of the page's files, by the path of its address.
        pages = {
            "/" + path.relative_to(PAGE).as_posix(): (_TYPES[path.suffix], path.read_bytes())
            for path in sorted(PAGE.rglob("*"))
            if path.suffix in _TYPES
        }
        self.pages = {"/": pages["/index.html"], **pages}
        self.about: dict[str, Any] = {
            "engine": "server",
            "version": __version__,
            "system": estimator.system,
            "size": estimator.size,
            "gloss": estimator.gloss_calibration._asdict(),
            "about": "on this computer",
            "start": kind and {"kind": kind, "name": source and source.name},
        }
        super().__init__(("127.0.0.1", port), _Handler)
        number = self.server_address[1]
        self.url = f"http://127.0.0.1:{number}/"
        self.hosts = {f"{name}:{number}" for name in ("127.0.0.1", "localhost")}
        if number == 80:
            self.hosts |= {"127.0.0.1", "localhost"}

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Keep silent about browsers that close a connection, which is no error."""


class _Handler(BaseHTTPRequestHandler):
    """The answers to the requests of the page."""

    server: LiveServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = f"lime-live/{__version__}", ""
    timeout = _PATIENCE
    # What is left of an answer goes out at once, not after the browser's delayed acknowledgement.
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        if not self._is_same_origin(origin_needed=False):
            return
        path = self.path.partition("?")[0]
        if path == "/engine.json":
            content = json.dumps(self.server.about).encode()
            self._send(HTTPStatus.OK, "application/json", content)
        elif path == "/source" and self.server.source:
            self._send_file(self.server.source)
        elif path in self.server.pages:
            kind, content = self.server.pages[path]
            self._send(HTTPStatus.OK, kind, content)
        else:
            self._send_error(HTTPStatus.NOT_FOUND, "gone", f"there is no {path}")

    def do_POST(self) -> None:
        if not self._is_same_origin(origin_needed=True):
            return
        body = self._body()
        if body is None:
            return
        if self.path == "/estimate":
            self._one_at_a_time(self._estimate, body)
        elif self.path == "/decode":
            self._one_at_a_time(self._decode, body)
        else:
            self._send_error(HTTPStatus.NOT_FOUND, "gone", f"there is no {self.path}")

    def _one_at_a_time(self, answer: Callable[[bytes], tuple[str, bytes]], body: bytes) -> None:
        if not self.server.busy.acquire(blocking=False):
            self._send_error(
                HTTPStatus.SERVICE_UNAVAILABLE, "busy", "another frame is being estimated"
            )
            return
        try:
            response = HTTPStatus.OK, *answer(body)
        except ValueError as error:
            response = _error_response(HTTPStatus.BAD_REQUEST, "frame", str(error))
        except MemoryError:
            message = "not enough memory for this picture: make it smaller"
            response = _error_response(HTTPStatus.BAD_REQUEST, "frame", message)
        except Exception as error:
            # One frame must not end the page; the terminal has the whole story.
            traceback.print_exc()
            message = f"the estimate failed ({type(error).__name__}); the terminal says more"
            response = _error_response(HTTPStatus.INTERNAL_SERVER_ERROR, "frame", message)
        finally:
            self.server.busy.release()
        self._send(*response)

    def _estimate(self, body: bytes) -> tuple[str, bytes]:
        request = wire.unpack(body)
        # Frames of two tabs are of two objects.
        if request.restart or request.page != self.server.page:
            self.server.session.restart()
            self.server.page = request.page
        result = self.server.session.process(request.image_srgb, request.mask, request.frame)
        height, width, _ = request.image_srgb.shape
        content = wire.pack(result, number=request.number, width=width, height=height)
        return "application/octet-stream", content

    def _decode(self, body: bytes) -> tuple[str, bytes]:
        """Return a picture that the browser cannot read, such as HEIC or OpenEXR, as a PNG."""
        suffix = unquote(self.headers.get("X-Suffix", "")).lower()
        if suffix not in SUFFIXES:
            raise ValueError(f"{suffix or 'this file'} is no picture: choose {', '.join(SUFFIXES)}")
        with tempfile.TemporaryDirectory(prefix="lime-live-") as folder:
            picture, png = Path(folder) / f"the picture{suffix}", Path(folder) / "picture.png"
            picture.write_bytes(body)
            try:
                image, alpha, _ = photo.load(picture)
                parts = [image] if alpha is None else [image, alpha]
                photo.write(png, np.concatenate(parts, axis=-1))
            except ValueError as error:
                raise ValueError(str(error).replace(str(picture), "the picture")) from error
            return "image/png", png.read_bytes()

    def _is_same_origin(self, *, origin_needed: bool) -> bool:
        """Return whether the request is from the server's own page; refuse it if not."""
        host, origin = self.headers.get("Host"), self.headers.get("Origin")
        own = {f"http://{name}" for name in self.server.hosts}
        if host in self.server.hosts and (origin in own or not (origin or origin_needed)):
            return True
        self.close_connection = True
        message = f"this server answers its own page alone: open {self.server.url}"
        self._send_error(HTTPStatus.FORBIDDEN, "gone", message)
        return False

    def _body(self) -> bytes | None:
        """Return the request's body; refuse it and return None if it is too large."""
        length = self.headers.get("Content-Length", "")
        known = length.isascii() and length.isdigit()
        # Python itself refuses to make a number of thousands of digits.
        if not known or len(length) > _DIGITS or int(length) > wire.LARGEST_BODY:
            self.close_connection = True
            self._send_error(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE if known else HTTPStatus.LENGTH_REQUIRED,
                "frame",
                f"a picture takes at most {wire.LARGEST_BODY >> 20} MiB: make it smaller",
            )
            return None
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            self.close_connection = True
            return None
        return body

    def _send_error(self, status: HTTPStatus, kind: str, message: str) -> None:
        self._send(*_error_response(status, kind, message))

    def _send(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        self._head(status, kind, len(content))
        self.wfile.write(content)

    def _send_file(self, path: Path) -> None:
        try:
            file = path.open("rb")
        except OSError as error:
            self._send_error(HTTPStatus.NOT_FOUND, "frame", f"{path.name}: {error.strerror}")
            return
        with file:
            kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
            self._head(HTTPStatus.OK, kind, path.stat().st_size)
            shutil.copyfileobj(file, self.wfile)

    def _head(self, status: HTTPStatus, kind: str, length: int) -> None:
        self.send_response(status)
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(length))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Keep silent: twenty lines a second would tell nobody anything."""


def _error_response(status: HTTPStatus, kind: str, message: str) -> tuple[HTTPStatus, str, bytes]:
    """Return an answer that says what is wrong: `kind` for the page, `message` for its user."""
    content = json.dumps({"error": message, "kind": kind}).encode()
    return status, "application/json", content
