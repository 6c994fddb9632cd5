"""The pretrained weights: a pickle read without executing it, and what the network then sees."""

import hashlib
import os
import pickle
from pathlib import Path

import keras
import numpy as np
import pytest
from PIL import Image

from lime_keras import console
from lime_keras.networks import efficientnet
from lime_keras.train import backbone


class _Executed:
    def __init__(self, *call):
        self._call = call

    def __reduce__(self):
        return self._call


PHOTOS = Path(__file__).parents[2] / "examples" / "photos"
STORAGES = {"7": np.arange(6, dtype="<f4")}


def raw(path, body):
    """A file whose tensors are the pickle `body`."""
    with path.open("wb") as file:
        for part in (0x1950A86A20F9469CFC6C, 1001, {}):
            pickle.dump(part, file, 2)
        file.write(body)
        pickle.dump(["7"], file, 2)
        file.write((6).to_bytes(8, "little") + STORAGES["7"].tobytes())
    return path


def tensor(shape=(2, 3), strides=(1, 2), offset=0):
    """The pickle of `{"w": a tensor}` that views the storage."""
    name = b"X\x07\x00\x00\x00storage"
    key, device = b"X\x01\x00\x00\x007", b"X\x03\x00\x00\x00cpu"
    storage = b"(" + name + b"ctorch\nFloatStorage\n" + key + device + b"K\x06NtQ"
    sizes, steps = (b"".join(b"K" + bytes([n]) for n in numbers) for numbers in (shape, strides))
    arguments = b"(" + storage + b"K" + bytes([offset]) + b"(" + sizes + b"t(" + steps + b"t\x89Nt"
    call = b"ctorch._utils\n_rebuild_tensor_v2\n" + arguments + b"R"
    return b"\x80\x02}X\x01\x00\x00\x00w" + call + b"s."


def test_a_tensor_is_read_by_its_strides(tmp_path):
    found = backbone.read(raw(tmp_path / "file.pth", tensor()))
    np.testing.assert_array_equal(found["w"], [[0, 2, 4], [1, 3, 5]])


@pytest.mark.parametrize("view", [{"shape": (2, 4)}, {"offset": 1}, {"strides": (3, 2)}])
def test_a_tensor_beyond_its_storage_is_refused(view, tmp_path):
    path = raw(tmp_path / "file.pth", tensor(**view))
    with pytest.raises(ValueError, match="reaches beyond"):
        backbone.read(path)


def test_nothing_is_executed(tmp_path):
    mark = tmp_path / "mark"
    body = pickle.dumps({"w": _Executed(os.mkdir, (str(mark),))}, 2)
    with pytest.raises(ValueError, match=r"it names (posix|os)\.mkdir"):
        backbone.read(raw(tmp_path / "file.pth", body))
    assert not mark.exists()


@pytest.mark.parametrize("length", [0, 10, 60, -1])
def test_a_cut_file_is_named(length, tmp_path):
    path = raw(tmp_path / "file.pth", tensor())
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"file\.pth is no file of PyTorch's tensors"):
        backbone.read(path)


def test_without_the_package_the_mend_is_told(monkeypatch):
    monkeypatch.setattr(console, "_installed", lambda module: False)
    with pytest.raises(console.MissingExtra, match=r"pip install '.\[train\]'"):
        backbone.find()


def test_another_file_is_refused(monkeypatch):
    monkeypatch.setattr(backbone, "SHA256", hashlib.sha256(b"").hexdigest())
    with pytest.raises(ValueError, match="other bytes"):
        backbone.find()


@pytest.mark.parametrize(("name", "number"), [("couch", 831), ("hat", 808)])
def test_photographs_are_classified_as_what_they_show(name, number):
    """By the package's own head; 831 is a studio couch, 808 a sombrero."""
    tensors = backbone.read(backbone.find())
    image = keras.Input((224, 224, 3))
    network = keras.Model(image, efficientnet.features(image)[-1])
    for layer, values in backbone.folded(tensors).items():
        network.get_layer(layer).set_weights(values)
    with Image.open(PHOTOS / f"{name}.png") as photo:
        seen = np.asarray(photo.convert("RGB").resize((224, 224)), np.float32) / 255
    features = np.asarray(network(seen[None]))
    kernel, bias = backbone._fold(tensors, "_conv_head", "_bn1")
    pooled = np.clip(features @ kernel[0, 0] + bias, 0, 6).mean((1, 2))
    logits = pooled @ tensors["_fc.weight"].T + tensors["_fc.bias"]
    assert logits.argmax() == number


def test_a_network_begins_with_them():
    from lime_keras.networks import PRESETS, SUBNETWORKS

    network = SUBNETWORKS["segmentation"].build(PRESETS["nano"])
    before = network.get_layer("up0_conv").get_weights()[0]
    backbone.begin(network)
    folded = backbone.folded(backbone.read(backbone.find()))
    for name in ("lite0_stem", "lite0_block5_depthwise", "lite0_block15_project"):
        np.testing.assert_array_equal(network.get_layer(name).get_weights()[0], folded[name][0])
    np.testing.assert_array_equal(network.get_layer("up0_conv").get_weights()[0], before)
    # The decoder learns first.
    trained = {variable.path.split("/")[0] for variable in network.trainable_variables}
    assert "up0_conv" in trained and not any(name.startswith("lite0") for name in trained)
    assert len(folded) == sum(
        "lite0" in layer.name and bool(layer.weights) for layer in network.layers
    )
