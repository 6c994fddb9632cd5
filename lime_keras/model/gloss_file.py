"""The file beside a model's weights that says how likely its estimates are glossy.

`benchmarks/gloss.py` writes it. It changes the words for a gloss alone, so it is no part of the
model's digest.
"""

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path

from lime_keras.io import atomic, untrusted
from lime_keras.model import folder as model_folder
from lime_keras.optics.gloss import DEFAULT, Calibration

NAME = "gloss.json"


def read(run: Path) -> Calibration:
    """Return the calibration of a model; `gloss.DEFAULT` if it has none.

    Raises:
        ValueError: if the file is damaged.
    """
    path = model_folder.folder(run) / NAME
    if not path.exists():
        return DEFAULT
    mend = "delete it, or write it with benchmarks/gloss.py"
    with untrusted.naming(path, "a calibration", mend):
        content = untrusted.read_json(path)
        calibration = Calibration(float(content["even"]), float(content["slope"]))
        if not (math.isfinite(calibration.even) and 0 < calibration.slope < math.inf):
            raise ValueError(f"its numbers are {calibration}")
    return calibration


@contextlib.contextmanager
def kept(run: Path) -> Iterator[None]:
    """Keep a run's calibration while its model is written anew, if the weights stay the same."""
    path = run / "model" / NAME
    is_model = path.is_file() and (run / "model" / model_folder.ARCHITECTURE).is_file()
    before = model_folder.digest(run) if is_model else None
    content = path.read_bytes() if before else b""
    yield
    if before and model_folder.digest(run) == before:
        atomic.write(path, content)
