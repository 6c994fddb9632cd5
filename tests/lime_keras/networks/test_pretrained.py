"""The model that comes with the package."""

import numpy as np

from lime_keras import Estimator
from lime_keras.export import parity
from lime_keras.io import model_folder
from lime_keras.io.model_folder import SHIPPED
from lime_keras.networks import assemble, weights
from lime_keras.runtime import graph_folder
from lime_keras.runtime.engine import OnnxEngine


def test_it_is_whole_small_and_described():
    files = [path for path in SHIPPED.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 20 * 2**20
    assert {"lime.json", "training.json"} <= {path.name for path in files}
    assert (SHIPPED.parent / "README.md").is_file()
    architecture, subnetworks = weights.load(SHIPPED)
    assert architecture.description == "LIME" and len(subnetworks) == 5


def test_its_graphs_are_of_its_weights_and_answer_what_keras_answers():
    """After a change of the weights: `make graphs`."""
    folder = model_folder.graphs(SHIPPED)
    description = graph_folder.read(folder)
    assert description is not None and description.weights == model_folder.digest(SHIPPED)
    engine, images = OnnxEngine(folder, description), parity.images(128)
    joined = assemble(weights.load(SHIPPED)[1])
    expected = parity.answers(joined, images)
    found = parity.answers(lambda batch: engine.run(engine.outputs, {"image": batch}), images)
    parity.judge(expected, found, "float32")


def test_its_graphs_are_no_larger_than_its_weights():
    graphs = model_folder.graphs(SHIPPED).iterdir()
    model = model_folder.folder(SHIPPED).iterdir()
    size, limit = (sum(path.stat().st_size for path in files) for files in (graphs, model))
    assert size < limit


def test_it_finds_a_lit_ball_and_its_colour():
    """On the proof's dull ball, of albedo 0.5, 0.3, 0.2 before stripes: roughly where, and what."""
    image = parity.images(128)[0]
    rows, columns = np.mgrid[:128, :128] / 127 * 2.5 - 1.25
    truth = rows**2 + columns**2 < 1
    material = Estimator().estimate(image)
    found = material.layers["mask"][..., 0] >= 0.5
    assert (found & truth).sum() / (found | truth).sum() > 0.7
    red, green, blue = material.diffuse_albedo
    assert red > green > blue
