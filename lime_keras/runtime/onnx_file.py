"""One exported ONNX file of a whole model, run by ONNX Runtime."""

import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np

from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import refuse_mask
from lime_keras.runtime.sessions import Session


class OnnxFile:
    """An `Engine` of one ONNX file.

    Args:
        path: file that `lime-export` wrote; its properties hold the model card.

    Raises:
        ValueError: if the file cannot be opened, or its card is missing or damaged.
    """

    def __init__(self, path: Path):
        self._path = path
        try:
            self._session = Session(lambda: str(path))
        except Exception as error:  # ONNX Runtime's own classes have no common base.
            raise ValueError(f"{path} cannot be opened as an ONNX network: {error}") from error
        card = self._session.opened().get_modelmeta().custom_metadata_map
        try:
            self.size, self.system = json.loads(card["input_shape"])[1], card["description"]
        except (ValueError, LookupError, TypeError) as error:
            raise ValueError(f"{path} has no model card: export the model anew") from error
        names = {output.name for output in self._session.opened().get_outputs()}
        self.outputs = tuple(filter(names.__contains__, OUTPUTS))

    def subnetworks(self, outputs: Iterable[str], inputs: Collection[str]) -> tuple[str, ...]:
        """Return no names, as the subnetworks are joined in one graph."""
        return ()

    def run(
        self, outputs: Collection[str], inputs: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Engine`); a mask is refused."""
        refuse_mask(inputs, self._path)
        names = list(outputs)
        try:
            answer = self._session.run(names, {"image": inputs["image"]})
        except ValueError as error:
            raise ValueError(f"{self._path} fails: {error}") from error
        return dict(zip(names, answer, strict=True))
