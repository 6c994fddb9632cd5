"""The pretrained weights: a pickle read without executing it, and what the network then sees."""

import hashlib
import io
import pickle
from pathlib import Path

import keras
import numpy as np
import pytest
from PIL import Image

from lime_keras import console
from lime_keras.networks import efficientnet
from lime_keras.train import backbone

PHOTOS = Path(__file__).parents[2] / "examples" / "photos"


def test_nothing_that_a_pickle_names_is_executed(tmp_path):
    call = b"cos\nmkdir\n(" + pickle.dumps(str(tmp_path / "mark"), 0)[:-1] + b"tR."
    with pytest.raises(pickle.UnpicklingError, match=r"it names os\.mkdir"):
        backbone._Unpickler(io.BytesIO(call)).load()
    assert not (tmp_path / "mark").exists()


def test_without_the_package_the_mend_is_told(monkeypatch):
    monkeypatch.setattr(console, "_installed", lambda module: False)
    with pytest.raises(console.MissingExtra, match=r"pip install '.\[train\]'"):
        backbone.read()


def test_another_file_is_refused(monkeypatch):
    monkeypatch.setattr(backbone, "SHA256", hashlib.sha256(b"").hexdigest())
    with pytest.raises(ValueError, match="other bytes"):
        backbone.read()


@pytest.mark.parametrize(("name", "number"), [("couch", 831), ("hat", 808)])
def test_photographs_are_classified_as_what_they_show(name, number):
    """By the package's own head; 831 is a studio couch, 808 a sombrero."""
    tensors = backbone.read()
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
    folded = backbone.folded(backbone.read())
    for name in ("lite0_stem", "lite0_block5_depthwise", "lite0_block15_project"):
        np.testing.assert_array_equal(network.get_layer(name).get_weights()[0], folded[name][0])
    np.testing.assert_array_equal(network.get_layer("up0_conv").get_weights()[0], before)
    # The decoder learns first.
    trained = {variable.path.split("/")[0] for variable in network.trainable_variables}
    assert "up0_conv" in trained and not any(name.startswith("lite0") for name in trained)
    assert len(folded) == sum(
        "lite0" in layer.name and bool(layer.weights) for layer in network.layers
    )
