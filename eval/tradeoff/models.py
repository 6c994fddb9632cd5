"""The files of the models that are compared: graphs in each precision, a SavedModel, and a page.

They are written once into a folder, and again when they are of other weights.
"""

from collections.abc import Mapping
from pathlib import Path

from lime_keras.export import exporter, graphs
from lime_keras.io import atomic
from lime_keras.live import static
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import PRESETS, build

from . import browser
from .cases import BROWSER, PAPER, SAVED_MODEL, TimedUse


class Unavailable(RuntimeError):
    """What a case needs is not there, such as a browser."""


def path(case: TimedUse, runs: Mapping[str, Path], corpus: Path, folder: Path) -> Path:
    """Return what a case runs: the folder of a model, a SavedModel or a page.

    It is written if it is missing.

    Args:
        case: the case.
        runs: folder of each trained model, by name.
        corpus: corpus on whose train split graphs in eight bits are calibrated.
        folder: folder of the files that are written.

    Raises:
        Unavailable: if the case cannot be run here.
    """
    home = folder / case.model
    if case.model == PAPER:
        return _untrained(home)
    run = runs[case.model]
    if case.runtime in (SAVED_MODEL, BROWSER):
        is_page = case.runtime == BROWSER
        written = home / "page" if is_page else exporter.target(home, exporter.SAVED_MODEL)
        mark, digest = home / f"{case.runtime}.weights", model_folder.digest(run)
        if is_page and (lack := browser.missing()):
            raise Unavailable(lack)
        if not (written.is_dir() and mark.is_file() and mark.read_text() == digest):
            if is_page:
                _write_page(written, run)
            else:
                exporter.export(home, exporter.SAVED_MODEL, run)
            atomic.write(mark, digest)
        return written
    if case.precision == "float32":
        return run
    description = model_folder.read_description(model_folder.graphs(home, case.precision))
    if description is None or description.weights != model_folder.digest(run):
        exporter.export(home, exporter.GRAPHS, run, precision=case.precision, corpus=corpus)
    return home


def _untrained(home: Path) -> Path:
    """Return a folder with the preset `paper`, untrained."""
    if model_folder.read_description(model_folder.graphs(home)) is None:
        architecture = PRESETS[PAPER]
        weights.save(home / "model", architecture, build(architecture, seed=0), half=True)
        _, stored = weights.load(home)
        with atomic.replacing(model_folder.graphs(home)) as partial:
            graphs.write(partial, architecture, stored, model_folder.digest(home))
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
