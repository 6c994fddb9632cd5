"""The model that comes with the package."""

import numpy as np

from lime_keras import Estimator
from lime_keras.export import parity
from lime_keras.networks import weights


def test_it_is_whole_small_and_described():
    files = [path for path in weights.SHIPPED.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 20 * 2**20
    assert {"lime.json", "training.json"} <= {path.name for path in files}
    assert (weights.SHIPPED.parent / "README.md").is_file()
    architecture, subnetworks = weights.load(weights.SHIPPED)
    assert architecture.description == "LIME" and len(subnetworks) == 5


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
