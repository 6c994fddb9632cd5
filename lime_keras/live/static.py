"""The page without Python: a folder of files that any web host serves.

ONNX Runtime for browsers is not in the wheel. It is taken from the npm registry when the folder is
written, in the one release that was tested.
"""

import base64
import hashlib
import http.client
import io
import json
import shutil
import tarfile
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from typing import IO, cast

from lime_keras.estimate import cautions
from lime_keras.io import atomic, untrusted
from lime_keras.live import page_graphs
from lime_keras.live.server import PAGE
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file
from lime_keras.runtime import onnx_graphs
from lime_keras.version import __version__

RUNTIME_VERSION = "1.30.0"  # release of onnxruntime-web
_ARCHIVE = f"onnxruntime-web-{RUNTIME_VERSION}.tgz"
_ADDRESS = f"https://registry.npmjs.org/onnxruntime-web/-/{_ARCHIVE}"
_SHA512 = "q0y+JrrtukXSzsBWEMccVfqX25LRmosXHF+CaRJmg8pZClzcV7svNc4rKY3jL02Vb7QmRMDs1SigqR4CXAfKYQ=="
"""Checksum of the archive, as the registry tells it."""
_RUNTIME = {
    "wasm": {
        "script": "ort.wasm.min.mjs",
        "module": "ort-wasm-simd-threaded.mjs",
        "wasm": "ort-wasm-simd-threaded.wasm",
    },
    # The other build for WebGPU has 26.8 MB, more than Cloudflare Pages takes as one file.
    "webgpu": {
        "script": "ort.jspi.min.mjs",
        "module": "ort-wasm-simd-threaded.jspi.mjs",
        "wasm": "ort-wasm-simd-threaded.jspi.wasm",
    },
}
"""Files of each backend in the archive's folder `dist`."""
_DESCRIPTION = "engine.json"
_PATIENCE = 60


def write(out: Path, run: Path, runtime: Mapping[str, bytes]) -> None:
    """Write the page, its engine and a model into a folder; replace a page written before.

    Args:
        out: folder to write.
        run: folder of the trained model, exported (`model_folder.graphs`).
        runtime: files of onnxruntime-web by name (see `fetched_runtime`).

    Raises:
        ValueError: if `out` holds something else than a page, or the model holds no graphs of its
            weights, or learnt the printed lobe, which the page cannot draw.
        OSError: if a file cannot be read or written.
    """
    check(out)
    if model_folder.lobe(run) == "printed":
        raise ValueError(f"{run} cannot be a page: {cautions.PRINTED_LOBE.message}")
    engine = onnx_graphs.load(run)
    with atomic.replacing(out) as partial:
        shutil.copytree(PAGE, partial)
        (partial / ".nojekyll").touch()  # else GitHub Pages leaves files out
        # The page first tells what its browser lacks, and starts the service worker.
        script, page = '<script src="browser/preflight.js"></script>\n', partial / "index.html"
        text = page.read_text(encoding="utf-8").replace("</head>", f"{script}</head>", 1)
        page.write_text(text, encoding="utf-8")
        (partial / "graphs").mkdir()
        names = page_graphs.write(partial / "graphs", engine.folder, engine.description)
        for name, content in runtime.items():
            (partial / "runtime" / name).write_bytes(content)
        about = {
            "engine": "browser",
            "version": __version__,
            "system": engine.system,
            "size": engine.size,
            "gloss": gloss_file.read(run)._asdict(),
            "runtime": {name: _placed(partial, backend) for name, backend in _RUNTIME.items()},
            "graphs": {
                graph: {"path": path, "bytes": (partial / path).stat().st_size}
                for graph in names
                for path in [f"graphs/{graph}.onnx"]
            },
        }
        text = json.dumps(about, indent=1) + "\n"
        (partial / _DESCRIPTION).write_text(text, encoding="utf-8")


def check(out: Path) -> None:
    """Raise ValueError if a folder holds something else than a page that was written before."""
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file: name a folder")
    if not out.name:
        raise ValueError(f"{out} cannot be replaced: name a folder in it")
    if not out.is_dir() or not any(out.iterdir()):
        return
    try:
        description = untrusted.read_json(out / _DESCRIPTION)
        is_page = description["engine"] == "browser"
    except (OSError, ValueError, LookupError, TypeError):
        is_page = False
    own = {_DESCRIPTION, "graphs", ".nojekyll", ".DS_Store", *(one.name for one in PAGE.iterdir())}
    others = sorted(entry.name for entry in out.iterdir() if not is_page or entry.name not in own)
    if others:
        raise ValueError(
            f"{out} holds {others[0]}, which is no part of a page and would be lost: name a new "
            "folder"
        )


def fetched_runtime() -> dict[str, bytes]:
    """Return the files of onnxruntime-web that the page runs, by name.

    They come from the npm registry, or from the archive that `npm pack` has left in the current
    folder.

    Raises:
        OSError: if the registry cannot be reached.
        ValueError: if the archive is not the one that is expected.
    """
    content = _archive()
    digest = base64.b64encode(hashlib.sha512(content).digest()).decode()
    if digest != _SHA512:
        raise ValueError(
            f"{_ARCHIVE} is damaged or another file (its SHA-512 is {digest}): delete it if it lies"
            " in this folder, and try again"
        )
    names = [name for backend in _RUNTIME.values() for name in backend.values()]
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        # The archive's checksum says that each member is there, and a file.
        return {
            name: cast(IO[bytes], archive.extractfile(f"package/dist/{name}")).read()
            for name in names
        }


def _archive() -> bytes:
    """Return the content of the archive."""
    file = Path(_ARCHIVE)
    if file.is_file():
        return file.read_bytes()
    try:
        with urllib.request.urlopen(_ADDRESS, timeout=_PATIENCE) as answer:
            return answer.read()
    except (OSError, http.client.HTTPException) as error:
        raise OSError(
            f"{_ADDRESS} cannot be fetched ({error}): connect to the network; or run `npm pack "
            f"onnxruntime-web@{RUNTIME_VERSION}` where there is one, and put {_ARCHIVE} into the "
            "folder in which you run this"
        ) from error


def _placed(folder: Path, backend: dict[str, str]) -> dict[str, str | int]:
    """Return the paths of a backend's files, and the size of its WebAssembly."""
    paths = {role: f"runtime/{name}" for role, name in backend.items()}
    return paths | {"bytes": (folder / paths["wasm"]).stat().st_size}
