"""The graphs that the page runs without Python: `mask`, `material` and `layers`.

They join the graphs of a model (`lime_keras.model.folder`). `mask` is SegmentationNet, from
`image`. `material` is what the numbers need, from `image` and `mask`. `layers` is what is left,
which only pictures and the light need: it reads what `material` answers, too. All give exactly the
numbers of the model, of one image at a time.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

import onnx

from lime_keras.model import folder as model_folder
from lime_keras.model.folder import Description
from lime_keras.outputs import OUTPUTS

_IMAGES = ("image", "mask")


def write(folder: Path, graphs: Path, description: Description) -> tuple[str, ...]:
    """Write `mask.onnx`, `material.onnx` and, if something is left for it, `layers.onnx`.

    Returns:
        The names of the graphs.

    Raises:
        ValueError: if a graph is damaged.
    """
    rooms = _rooms(description)
    for name, parts in rooms.items():
        models = {part: _opened(graphs, description, part) for part in parts}
        answered = {output for part in parts for output in description.graphs[part].outputs}
        others = [graph for part, graph in description.graphs.items() if part not in parts]
        read = {quantity for graph in others for quantity in graph.inputs}
        outputs = [name for name in sorted(answered) if name in OUTPUTS or name in read]
        joined = _joined(name, models, outputs)
        onnx.checker.check_model(joined, full_check=True)
        onnx.save(joined, folder / f"{name}.onnx")
    return tuple(rooms)


def _rooms(description: Description) -> dict[str, list[str]]:
    """Return the subnetworks of each of the page's graphs that has any."""
    answered = {output for graph in description.graphs.values() for output in graph.outputs}
    numbers = [name for name in answered if name in OUTPUTS and OUTPUTS[name].layer is None]
    mask = description.needed(["mask"], ["image"])
    material = description.needed(numbers, _IMAGES)
    layers = [name for name in description.graphs if name not in {*mask, *material}]
    return {"mask": mask, "material": material} | ({"layers": layers} if layers else {})


def _opened(graphs: Path, description: Description, part: str) -> onnx.ModelProto:
    """Return a subnetwork's graph, for one image at a time."""
    content = model_folder.read_verified(graphs, part, description.graphs[part])
    model = onnx.load_from_string(content)
    for tensor in (*model.graph.input, *model.graph.output):
        tensor.type.tensor_type.shape.dim[0].dim_value = 1
    return model


def _joined(
    name: str, models: Mapping[str, onnx.ModelProto], outputs: Iterable[str]
) -> onnx.ModelProto:
    """Return one graph of several that read one another's answers by name."""
    parts = [
        onnx.compose.add_prefix(model, f"{part}/", rename_inputs=False, rename_outputs=False)
        for part, model in models.items()
    ]
    answered = {tensor.name: tensor for part in parts for tensor in part.graph.output}
    read = {tensor.name: tensor for part in parts for tensor in part.graph.input}
    graph = onnx.helper.make_graph(
        [node for part in parts for node in part.graph.node],
        name,
        [tensor for tensor in read.values() if tensor.name not in answered],
        [answered[output] for output in outputs],
        [constant for part in parts for constant in part.graph.initializer],
    )
    return onnx.helper.make_model(
        graph,
        ir_version=max(part.ir_version for part in parts),
        opset_imports=list(
            {opset.domain: opset for part in parts for opset in part.opset_import}.values()
        ),
    )
