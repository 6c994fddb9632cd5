"""The file formats of an exported model: functions to write, describe and check it."""

import gc
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
import onnx
import tensorflow as tf
from keras import layers
from onnx import numpy_helper

from lime_keras.runtime.saved_model import SERVED

OPSET = 17  # version of the ONNX operator set in the written files
_ELEMENTWISE = (
    *("Add", "Sub", "Mul", "Div", "Pow", "Max", "Min"),
    *("Equal", "Less", "LessOrEqual", "Greater", "GreaterOrEqual"),
)
"""Operators that compute each pixel of an image with a number."""
REPEATED = "repeated"
"""End of the names of nodes that repeat the one channel of an image, after their reader's."""


def write_saved_model(network: keras.Model, path: Path) -> None:
    """Write an assembled model as a SavedModel folder.

    It has the signature `SERVED` and one for each output, which computes only what that output
    needs. All signatures share the variables.
    """
    module = tf.Module()
    module.shared = [variable.value for variable in network.variables]
    signatures = {SERVED: served(network)}
    for name, tensor in network.output.items():
        signatures[name] = served(keras.Model(network.input, {name: tensor}))
    tf.saved_model.save(module, str(path), signatures=signatures)


def write_card(path: Path, card: Mapping[str, Any]) -> None:
    """Write a model card (`export.model_card`) to a JSON file."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(card, indent=2) + "\n", encoding="utf-8")


def write_onnx(network: keras.Model, path: Path) -> None:
    """Write a model as ONNX in float32, with the output names of `served`."""
    import tf2onnx

    serve = served(_with_resizing(network))
    tf2onnx.convert.from_function(
        serve,
        input_signature=serve.input_signature,
        opset=OPSET,
        custom_op_handlers={"Log1p": (_convert_log1p, [])},  # which neither it nor ONNX has
        output_path=str(path),
    )
    model = onnx.load(path)
    _ease_broadcasts(model)
    _settle_resizing(model)
    onnx.save(model, path)
    # The converter's copies of the graph refer to one another, and hold 1 GB for a U-Net of 20 MB.
    gc.collect()


def _convert_log1p(graph: Any, node: Any, name: str, arguments: Any) -> None:
    """Convert log(1 + x), in the graph of `tf2onnx`; x is at least 0, so little is lost."""
    one = graph.make_const(f"{name}/one", np.float32(1.0))
    added = graph.make_node("Add", [node.input[0], one.output[0]])
    node.type = "Log"
    graph.replace_input(node, node.input[0], added.output[0], 0)


def _with_resizing(network: keras.Model) -> keras.Model:
    """Return the same model, upsampling by `Resizing`: one operator of ONNX, not fourteen."""

    def swapped(layer: layers.Layer) -> layers.Layer:
        if not isinstance(layer, layers.UpSampling2D):
            return layer
        rows, columns = layer.output.shape[1:3]
        return layers.Resizing(rows, columns, layer.interpolation, name=layer.name)

    return keras.models.clone_model(network, clone_function=swapped, recursive=True)


def _settle_resizing(model: onnx.ModelProto) -> None:
    """Give each resizing a rule of coordinates that ONNX still has.

    The converter writes a rule that ONNX has dropped. For whole factors both mean the same pixels.
    """
    for node in model.graph.node:
        for attribute in node.attribute:
            if attribute.s == b"tf_half_pixel_for_nn":
                attribute.s = b"asymmetric"


def _ease_broadcasts(model: onnx.ModelProto) -> None:
    """Give the operands of a graph shapes that ONNX Runtime computes with fast; no value changes.

    Left alone, it goes pixel by pixel where an image of one channel meets a number (25 times as
    slow) or an image of three channels (6 times). The number gets the shape (1, 1, 1, 1), and the
    one channel is repeated.
    """
    graph = model.graph
    inferred = onnx.shape_inference.infer_shapes(model).graph
    channels = {
        tensor.name: sizes[3].dim_value
        for tensor in (*inferred.value_info, *inferred.input, *inferred.output)
        for sizes in [tensor.type.tensor_type.shape.dim]
        if len(sizes) == 4 and sizes[2].dim_value != 1
    }
    numbers = {one.name: one for one in graph.initializer if math.prod(one.dims) == 1}
    nodes, changed = [], set()
    for node in graph.node:
        widest = max((channels.get(name, 0) for name in node.input), default=0)
        for index, name in enumerate(node.input) if node.op_type in _ELEMENTWISE else ():
            new = f"{name}/{widest}_channels"
            if widest == 1 and name in numbers:
                values = numpy_helper.to_array(numbers[name]).reshape(1, 1, 1, 1)
                if new not in changed:
                    graph.initializer.append(numpy_helper.from_array(values, new))
            elif 1 < widest < 5 and channels.get(name) == 1:
                if new not in changed:
                    label = f"{node.name}/{REPEATED}"
                    copies = [name] * widest
                    nodes.append(onnx.helper.make_node("Concat", copies, [new], label, axis=3))
            else:
                continue
            node.input[index] = new
            changed.add(new)
        nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)
    read = {name for node in nodes for name in node.input}
    for name in numbers.keys() - read:
        graph.initializer.remove(numbers[name])


def finish_onnx(path: Path, card: Mapping[str, Any]) -> None:
    """Sort the nodes of an ONNX file, write a model card into it, and check it.

    The card becomes the file's properties; values that are no text become JSON. The first dimension
    of inputs and outputs gets the name `batch`.

    Raises:
        onnx.checker.ValidationError: if the file is no valid ONNX.
    """
    model = onnx.load(path)
    settle(model)
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in card.items()}
    onnx.helper.set_model_props(model, texts)
    write_checked(model, path)


def write_checked(model: onnx.ModelProto, path: Path) -> None:
    """Write an ONNX file, the same model always as the same bytes.

    Raises:
        onnx.checker.ValidationError: if it is no valid ONNX: not every runtime forgives what ONNX
            Runtime does.
    """
    onnx.checker.check_model(model, full_check=True)
    path.write_bytes(model.SerializeToString(deterministic=True))


def settle(model: onnx.ModelProto) -> None:
    """Order and name the nodes and constants of a graph by their use alone.

    A node comes after those that it reads, in the order in which the outputs ask for them; names
    count in this order. Of equal constants one is kept, and of what nothing reads none.
    """
    # Visit: what the outputs ask for, in order.
    graph = model.graph
    made_by = {output: node for node in graph.node for output in node.output}
    constants = {constant.name: constant for constant in graph.initializer}
    names = {"": ""} | {tensor.name: tensor.name for tensor in (*graph.input, *graph.output)}
    nodes: dict[str, onnx.NodeProto] = {}
    kept: dict[tuple[Any, ...], onnx.TensorProto] = {}

    def name_constant(constant: onnx.TensorProto) -> None:
        values = numpy_helper.to_array(constant)
        first = kept.setdefault((values.dtype.str, values.shape, values.tobytes()), constant)
        names[constant.name] = f"constant{len(kept)}" if first is constant else names[first.name]

    def visit(name: str) -> None:
        # A stack of its own: a joined graph is deeper than Python's.
        waiting = [(name, 0)]
        while waiting:
            name, index = waiting.pop()
            node, constant = made_by.get(name), constants.get(name)
            if node is not None and node.output[0] not in nodes:
                if index < len(node.input):
                    waiting += [(name, index + 1), (node.input[index], 0)]
                    continue
                nodes[node.output[0]] = node
                for number, output in enumerate(node.output):
                    names.setdefault(output, f"{node.op_type}{len(nodes)}.{number}")
            elif constant is not None and name not in names:
                name_constant(constant)

    for output in sorted(tensor.name for tensor in graph.output):
        visit(output)
    # Rebuild: kept nodes and constants by their new names.
    settled = onnx.GraphProto(
        name=graph.name, node=nodes.values(), input=graph.input, output=graph.output
    )
    for constant in kept.values():
        settled.initializer.add().CopyFrom(constant)
        settled.initializer[-1].name = names[constant.name]
    for tensor in (*settled.input, *settled.output):
        tensor.type.tensor_type.shape.dim[0].dim_param = "batch"
    for node in settled.node:
        node.input[:] = [names[name] for name in node.input]
        node.output[:] = [names[name] for name in node.output]
        node.name = node.output[0]
        node.attribute.sort(key=lambda attribute: attribute.name)
    graph.CopyFrom(settled)


def served(network: keras.Model) -> tf.types.experimental.PolymorphicFunction:
    """Return the model as a TensorFlow function of its inputs `(B, …)`, in order and by name.

    The function returns a dictionary: the model's own, or, if the model returns tensors, a
    dictionary of the tensors by `output_names`.
    """
    signature = [
        tf.TensorSpec((None, *tensor.shape[1:]), tf.float32, name=tensor.name)
        for tensor in network.inputs
    ]

    @tf.function(input_signature=signature)
    def serve(*tensors: tf.Tensor) -> dict[str, tf.Tensor]:
        packed = keras.tree.pack_sequence_as(network.input, list(tensors))
        answer = network(packed, training=False)
        if not isinstance(answer, dict):
            answer = dict(zip(network.output_names, keras.tree.flatten(answer), strict=True))
        return {name: tf.identity(value, name=name) for name, value in answer.items()}

    return serve
