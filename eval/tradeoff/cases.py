"""The cases of the trade: what is asked for, of which model, in which precision, on how many cores.

A photo is estimated by `Estimator`, and a frame of a stream by `Session`, from the picture in
memory to the answer in memory, as `lime-estimate` and `lime-live` do; the page without Python
answers the same frames in a browser. SavedModel and Keras, which other programs load, answer the
networks' square alone.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

from lime_keras.model.folder import PRECISIONS

PHOTO, STREAM, PAGE, NETWORKS = "photo", "stream", "page", "networks"  # kinds of cases
ONNX, KERAS, SAVED_MODEL, BROWSER = "ONNX Runtime", "Keras", "SavedModel", "Chromium"
_OF_A_FRAME: Mapping[str, Mapping[str, bool]] = {
    "mask": {"material": False, "layers": False, "light": False, "fusion": True},
    "material": {"material": True, "layers": False, "light": False, "fusion": True},
    "everything": {"material": True, "layers": True, "light": False, "fusion": True},
    "with the light": {"material": True, "layers": True, "light": True, "fusion": True},
}
ASKED: Mapping[str, Mapping[str, Any]] = {
    PHOTO: {
        "mask": ["mask"],
        "material": ["mask", "albedo", "exponent"],
        "everything": None,
        "with the light": None,
    },
    STREAM: _OF_A_FRAME,
    PAGE: _OF_A_FRAME,
}
"""What is asked for by name: `only` of an `Estimator`, and the options of a `FrameRequest`."""
WHOLE = "everything"
PAPER = "paper"  # name of the untrained model of the preset `paper`: its time and memory alone


@dataclasses.dataclass(frozen=True)
class TimedUse:
    """A use of a model, to be timed.

    Attributes:
        model: name of the model.
        kind: `PHOTO`, `STREAM`, `PAGE` or `NETWORKS`.
        asked: name out of `ASKED[kind]`; `everything` for `NETWORKS`.
        runtime: `ONNX`, `KERAS`, `SAVED_MODEL` or `BROWSER`.
        precision: precision of the graphs, out of `folder.PRECISIONS`.
        threads: number of processor cores that the process may use.
    """

    model: str
    kind: str
    asked: str
    runtime: str = ONNX
    precision: str = "float32"
    threads: int = 1

    @property
    def name(self) -> str:
        """The name of the use, fit for a file."""
        words = (self.model, self.kind, self.asked, self.runtime, self.precision, self.threads)
        return "-".join(map(str, words)).replace(" ", "-")


def of_model(model: str, cores: int) -> Iterator[TimedUse]:
    """Yield the cases of a model on a machine with a number of cores.

    One core and two are tried; the runtimes that others load, on all that are tried. Of `PAPER`,
    which takes seconds an answer, only the material and everything are asked for.
    """
    most = min(2, cores)
    for threads in sorted({1, most}):
        for precision in PRECISIONS if model != PAPER else PRECISIONS[:1]:
            for kind in (PHOTO, STREAM):
                for name in ASKED[kind] if model != PAPER else ("material", WHOLE):
                    yield TimedUse(model, kind, name, ONNX, precision, threads)
        for name in ASKED[PAGE] if model != PAPER else ():
            yield TimedUse(model, PAGE, name, BROWSER, threads=threads)
    if model != PAPER:
        for runtime in (SAVED_MODEL, KERAS):
            yield TimedUse(model, NETWORKS, WHOLE, runtime, threads=most)
