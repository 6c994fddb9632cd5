"""`lime-live`: a page that shows the material of what is held before the camera."""

import argparse
import os
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.commands import model_option
from lime_keras.model import folder as model_folder

_PORT = 8337

_EXAMPLE = f"""
examples:
  lime-live
  lime-live --camera
  lime-live --photo cup.jpg
  lime-live --video turntable.mp4 --weights runs/mine
  lime-live --static site

The page opens in the browser at http://127.0.0.1:{_PORT}/. On one side it shows the camera's
picture, a photo or a video, with the object's outline, its layers and numbers. On the other side it
shows a virtual object in the same material, under the estimated light. The networks run on this
computer, and no other computer can reach the page. Ctrl-C ends it.

--static writes the page as files for any web host; the networks then run in the visitor's browser.
It needs the extra `web`, and fetches 33 MB from the npm registry. To try it:
  python3 -m http.server -d site          (then open http://localhost:8000/)

More: docs/how-to/live.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = console.parser(
        prog="lime-live",
        usage="lime-live [--camera | --photo FILE | --video FILE | --static OUT] [options]",
        description="Show in the browser, live, the material of the object before the camera, on a "
        "virtual object under the same light.",
        epilog=_EXAMPLE,
    )
    start = out.add_argument_group("start").add_mutually_exclusive_group()
    start.add_argument("--camera", action="store_true", help="begin with the camera")
    start.add_argument("--photo", type=Path, metavar="FILE", help="begin with this photo")
    start.add_argument("--video", type=Path, metavar="FILE", help="begin with this video")
    start.add_argument(
        "--static", type=Path, metavar="OUT", help="write the page for a web host, and end"
    )
    model = out.add_argument_group("model")
    model_option.add(model)
    model_option.add_precision(model)
    page = out.add_argument_group("page")
    page.add_argument(
        "--port",
        type=console.whole(0, 2**16 - 1),
        default=_PORT,
        help=f"port on this computer; 0 takes any free one (default: {_PORT})",
    )
    page.add_argument(
        "--no-browser", action="store_true", help="open no browser; print the address"
    )
    return out


def main(argv: list[str] | None = None) -> int:
    """Serve the page until Ctrl-C, or write its files, and return the exit status."""
    command = parser()
    options = command.parse_args(argv)
    if options.static and options.precision != "float32":
        command.error("--static writes graphs in float32: leave out --precision")
    if options.static:
        return console.run(lambda: _write(options), "nothing was written")
    return console.run(lambda: _serve(options), "nothing was loaded yet")


def _write(options: argparse.Namespace) -> int:
    console.require("lime-live --static", "onnx")
    run = options.weights
    model_folder.files(run)
    from lime_keras.live import static
    from lime_keras.runtime import engine

    static.check(options.static)
    engine.load(run)
    print(f"onnxruntime-web {static.RUNTIME_VERSION} is fetched …", file=sys.stderr)
    runtime = static.fetched_runtime()
    print("the networks are written …", file=sys.stderr)
    static.write(options.static, run, runtime)
    print(
        f"{options.static} holds the page, for any web host; to try it here: "
        f"python3 -m http.server -d {options.static}, then http://localhost:8000/ in the browser"
    )
    return 0


def _serve(options: argparse.Namespace) -> int:
    for option, path in (("--photo", options.photo), ("--video", options.video)):
        if path is not None and not path.is_file():
            raise ValueError(f"{path} is no file: check what is passed to {option}")
    model_folder.files(options.weights)
    # Threads that wait for the next small product by spinning would take the processor from the
    # networks and from the browser.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import webbrowser

    from lime_keras.estimate.estimator import Estimator
    from lime_keras.live.server import LiveServer

    kinds = [kind for kind in ("camera", "photo", "video") if getattr(options, kind)]
    kind, source = kinds[0] if kinds else None, options.photo or options.video
    estimator = Estimator(options.weights, streaming=True, precision=options.precision)
    try:
        server = LiveServer(estimator, options.port, kind, source)
    except OSError as error:
        raise OSError(
            f"port {options.port} cannot be used ({error.strerror}): another lime-live may run "
            "there; end it, or pass --port 0 for any free port"
        ) from error
    with server:
        print(f"{server.url} shows the page; Ctrl-C ends it", flush=True)
        if not options.no_browser and not webbrowser.open(server.url):
            print(f"no browser could be opened: open {server.url} in one", file=sys.stderr)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print("\nended", file=sys.stderr)
    return 0
