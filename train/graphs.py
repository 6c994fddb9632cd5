"""The graphs of a finished run, which estimating runs; they are written in a process of its own.

The export is TensorFlow's, and a run may have trained under another backend.
"""

import os
import shlex
import subprocess
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.model import folder as model_folder

_EXPORT = "import sys; from lime_keras.commands.export import main; sys.exit(main())"


def write(run: Path) -> str:
    """Write the graphs of a run with a whole model, if it has none; return what to tell of them."""
    folder = model_folder.graphs(run)
    description = model_folder.read_description(folder)
    if description is not None and description.weights == model_folder.digest(run):
        return f"its graphs, which lime-estimate runs, in {folder}"
    arguments = [str(run), "--format", "graphs", "--weights", str(run)]
    command = shlex.join(["lime-export", *arguments])
    try:
        console.require("lime-export", *console.EXPORTING)
    except console.MissingExtra as error:
        return f"no graphs for lime-estimate: {error}; then run `{command}`"
    print(f"the graphs that lime-estimate runs are written to {folder} …", file=sys.stderr)
    done = subprocess.run(
        [sys.executable, "-c", _EXPORT, *arguments],
        env=os.environ | {"KERAS_BACKEND": "tensorflow", "CUDA_VISIBLE_DEVICES": "-1"},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        words = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return f"no graphs for lime-estimate ({words[-1]}): run `{command}`"
    return f"its graphs, which lime-estimate runs, in {folder}"
