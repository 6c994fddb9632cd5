"""An exported SavedModel, run by TensorFlow as TensorFlow Serving runs it."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np

from lime_keras import console
from lime_keras.io import untrusted
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import refuse_mask

SERVED = "serving_default"
"""Name of the signature with every output; each output also has a signature with its own name."""
CARD = Path("assets.extra") / "lime.json"
"""Place of the model card in a SavedModel: a folder for files that no loader reads."""


class SavedModel:
    """An `Engine` of a SavedModel folder; a single output is computed by its own signature.

    Args:
        path: folder that `lime_keras.export.formats.write_saved_model` wrote, with its card.

    Raises:
        OSError: if the folder holds no SavedModel.
        ValueError: if its card is missing or damaged.
    """

    def __init__(self, path: Path):
        console.import_tensorflow()
        import tensorflow as tf

        self._path = path
        try:
            card = untrusted.read_json(path / CARD)
            self.size, self.system = int(card["input_shape"][1]), str(card["description"])
        except (OSError, ValueError, LookupError, TypeError) as error:
            raise ValueError(
                f"{path / CARD} is missing or damaged: export the model anew"
            ) from error
        # The signatures alone do not keep the loaded model, and its variables, alive.
        self._loaded = tf.saved_model.load(str(path))
        names = self._loaded.signatures[SERVED].structured_outputs
        self.outputs = tuple(filter(names.__contains__, OUTPUTS))

    def subnetworks(self, outputs: Iterable[str], inputs: Collection[str]) -> tuple[str, ...]:
        """Return no names, as the subnetworks are joined in one graph."""
        return ()

    def run(
        self, outputs: Collection[str], inputs: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Engine`); a mask is refused."""
        import tensorflow as tf

        console.check_fork()
        refuse_mask(inputs, self._path)
        [*names] = outputs
        signature = names[0] if len(names) == 1 < len(self.outputs) else SERVED
        answer = self._loaded.signatures[signature](image=tf.constant(inputs["image"]))
        return {name: answer[name].numpy() for name in names}
