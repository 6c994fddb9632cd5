"""The weights of a subnetwork inside its exported graph, from which Keras reads them exactly.

An exporter moves axes, folds a head's bias into the arithmetic behind it, and may keep equal
constants once. The graph's property `keras_weights` therefore says of each weight which constant
holds it, and in which order of axes; or, if none does, its values.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

_PROPERTY = "keras_weights"
_ORDERS: Mapping[int, Sequence[tuple[int, ...]]] = {
    # Kernels of convolutions: (out, in, height, width) there, (height, width, in, out) in Keras;
    # of depthwise ones (channels, 1, height, width) and (height, width, channels, 1).
    4: ((2, 3, 1, 0), (2, 3, 0, 1), (0, 1, 2, 3)),
    2: ((0, 1), (1, 0)),
}
"""Orders of a constant's axes that are tried, by their number; the identity for all others."""
_MOST_REPEATED = 256  # largest number of values that the property itself holds


def describe(graph: onnx.ModelProto, weights: Mapping[str, np.ndarray]) -> None:
    """Write into a graph where each weight is; a graph that lacks a large one is left as it is.

    Args:
        graph: exported graph of a subnetwork.
        weights: the subnetwork's weights by path, float32.
    """
    constants = {
        (array.shape, array.tobytes()): (constant.name, order)
        for constant in reversed(graph.graph.initializer)
        for axes in [len(constant.dims)]
        for order in reversed(_ORDERS.get(axes, [tuple(range(axes))]))
        for array in [_values(constant, order)]
    }
    places = {}
    for path, values in weights.items():
        place = constants.get((values.shape, values.tobytes()))
        if place is not None:
            places[path] = {"constant": place[0], "axes": place[1]}
        elif values.size <= _MOST_REPEATED:
            places[path] = {"values": values.tolist()}
        else:
            return
    graph.metadata_props.add(key=_PROPERTY, value=json.dumps(places))


def read(content: bytes, path: Path) -> dict[str, np.ndarray]:
    """Return the weights in a subnetwork's graph by path, float32.

    Args:
        content: the ONNX file that `lime_keras.export.graphs` wrote.
        path: path of the file, for the error.

    Raises:
        ValueError: if the file is no such graph.
    """
    try:
        # A constant whose values lie in another file has none here, and is refused.
        graph = onnx.load_from_string(content)
        [text] = [prop.value for prop in graph.metadata_props if prop.key == _PROPERTY]
        constants = {constant.name: constant for constant in graph.graph.initializer}
        return {
            name: np.asarray(place["values"], np.float32)
            if "values" in place
            else _values(constants[place["constant"]], place["axes"])
            for name, place in json.loads(text).items()
        }
    # What is damaged, protobuf tells with an error of its own.
    except Exception as error:
        raise ValueError(
            f"{path} holds no weights that Keras can read ({type(error).__name__}): take it from "
            "where it came from again, or pass the run that it was exported from"
        ) from error


def _values(constant: onnx.TensorProto, order: Sequence[int]) -> np.ndarray:
    return numpy_helper.to_array(constant).astype(np.float32).transpose(order)
