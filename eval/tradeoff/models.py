"""The files of the models that are compared: graphs in each precision, a SavedModel, and a page.

They are written once into a folder, and again when they are of other weights or other code.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from lime_keras.data.corpus import Split
from lime_keras.export import exporter, graphs
from lime_keras.io import atomic, untrusted
from lime_keras.live import static
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import PRESETS, build

from .. import kept
from . import browser
from .cases import BROWSER, PAPER, SAVED_MODEL, TimedUse


class Unavailable(RuntimeError):
    """What a case needs is not there, such as a browser."""


def path(case: TimedUse, runs: Mapping[str, Path], corpus: Path, folder: Path) -> Path:
    """Return what a case runs: the folder of a model, a SavedModel or a page.

    It is written into `folder` if it is missing; the train split of `corpus` calibrates graphs in
    eight bits.

    Raises:
        Unavailable: if the case cannot be run here.
    """
    home = folder / case.model
    if case.model == PAPER:
        return _untrained(home)
    run = runs[case.model]
    mark = home / f"{case.runtime}-{case.precision}.made-of"
    of_what = f"{model_folder.digest(run)} {kept.code()}"
    if case.runtime == BROWSER:
        files = sorted(one for one in static.PAGE.rglob("*") if one.is_file())
        of_what += " " + hashlib.sha256(b"".join(one.read_bytes() for one in files)).hexdigest()
    if case.precision == "int8":
        of_what += " " + untrusted.sha256(Split(corpus, "train").manifest_path)
    is_made = mark.is_file() and mark.read_text() == of_what
    if case.runtime in (SAVED_MODEL, BROWSER):
        is_page = case.runtime == BROWSER
        written = home / "page" if is_page else exporter.target(home, exporter.SAVED_MODEL)
        if is_page and (lack := browser.missing()):
            raise Unavailable(lack)
        if not (written.is_dir() and is_made):
            if is_page:
                _write_page(written, run)
            else:
                exporter.export(home, exporter.SAVED_MODEL, run)
            atomic.write(mark, of_what)
        return written
    if case.precision == "float32":
        return run
    if not (is_made and model_folder.read_description(model_folder.graphs(home, case.precision))):
        exporter.export(home, exporter.GRAPHS, run, precision=case.precision, corpus=corpus)
        atomic.write(mark, of_what)
    return home


def _untrained(home: Path) -> Path:
    """Return a folder with the preset `paper`, untrained."""
    architecture, mark = PRESETS[PAPER], home / "made-of"
    of_what = f"{architecture} {kept.code()}"
    if not (mark.is_file() and mark.read_text() == of_what):
        weights.save(home / "model", architecture, build(architecture, seed=0), half=True)
        _, stored = weights.load(home)
        with atomic.replacing(model_folder.graphs(home)) as partial:
            graphs.write(partial, architecture, stored, model_folder.digest(home))
        atomic.write(mark, of_what)
    return home


def _write_page(path: Path, run: Path) -> None:
    try:
        static.write(path, run, static.fetched_runtime())
    except OSError as error:
        raise Unavailable(str(error)) from error


def size(case: TimedUse, path: Path) -> int:
    """Return the number of bytes of the files that a case loads."""
    if case.runtime == SAVED_MODEL:
        files = [file for file in path.rglob("*") if file.is_file()]
    elif case.runtime == BROWSER:
        files = list((path / "graphs").iterdir())
    elif case.precision != "float32":
        files = list(model_folder.graphs(path, case.precision).glob("*.onnx"))
    else:
        files = model_folder.files(path)
    return sum(file.stat().st_size for file in files)
