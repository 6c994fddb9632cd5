"""An exported SavedModel, run by TensorFlow as TensorFlow Serving runs it."""

from collections.abc import Collection
from pathlib import Path

import numpy as np

from lime_keras import console
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import Arrays

SERVED = "serving_default"
"""Name of the signature with every output; each output also has a signature with its own name."""
CARD = Path("assets.extra") / "lime.json"
"""Place of the model card in a SavedModel: a folder for files that no loader reads."""


class SavedModel:
    """An `Answering` of a SavedModel folder; a single output is computed by its own signature.

    Attributes:
        size: height and width of the images in pixels.

    Raises:
        OSError: if the folder holds no SavedModel.
    """

    def __init__(self, path: Path):
        console.import_tensorflow()
        import tensorflow as tf

        # The signatures alone do not keep the loaded model, and its variables, alive.
        self._loaded = tf.saved_model.load(str(path))
        served = self._loaded.signatures[SERVED]
        self.size = int(served.structured_input_signature[1]["image"].shape[1])
        self.outputs = tuple(filter(served.structured_outputs.__contains__, OUTPUTS))

    def run(self, outputs: Collection[str], inputs: Arrays) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Answering`); a mask is not read."""
        import tensorflow as tf

        console.check_fork()
        [*names] = outputs
        signature = names[0] if len(names) == 1 < len(self.outputs) else SERVED
        answer = self._loaded.signatures[signature](image=tf.constant(inputs["image"]))
        return {name: answer[name].numpy() for name in names}
