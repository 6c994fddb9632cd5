"""The light of stored scenes, with their own albedos and with others, drawn as the paper does."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import composed, example

from lime_keras.data import camera, records
from lime_keras.optics import colour, material_law
from lime_keras.train.photos.radiance import repaint, scene

SIZE = 48
UNIFORM = (material_law.UNIFORM,)
FEATURES = ("image", "mask")  # of SegmentationNet: what albedos need comes beside


@pytest.fixture(scope="module")
def sphere():
    return records.parse(records.encode(example(0, size=SIZE)))


def lit(stored, seed=0, materials=()):
    """The scene of an example that is stored, as NumPy arrays."""
    found = scene(records.encode(stored), tf.constant([seed, 1]), FEATURES, materials)
    return {name: value.numpy() for name, value in found.items()}


def covering(coverage, background=0.3):
    """A stored sphere of even coverage before a grey background."""
    sphere = example(2, size=SIZE)
    mask = sphere["mask"] * coverage
    linear = np.clip(mask * composed(sphere) + (1 - mask) * background, 0, 1)
    return sphere | {"mask": mask, "image": colour.linear_to_srgb(linear)}


@pytest.mark.parametrize("materials", [(), UNIFORM])
@pytest.mark.parametrize("seed", range(3))
def test_the_objects_light_is_eq_4_and_not_clipped(seed, materials):
    found = lit(example(seed, size=SIZE), seed, materials)
    np.testing.assert_allclose(found["object"], found["mask"] * composed(found), rtol=1e-4)
    inside = found["mask"][..., 0] == 1
    assert not found["background"][inside].any()
    np.testing.assert_allclose(
        found["background"][~inside], colour.srgb_to_linear(found["image"][~inside]), atol=1e-6
    )
    assert found["object"].max() > 1


@pytest.mark.parametrize("coverage", [1.0, 0.5, 0.1])
def test_light_adds_up_to_the_stored_image(coverage):
    found = lit(covering(coverage))
    level = colour.linear_to_srgb(np.clip(found["object"] + found["background"], 0, 1))
    apart = np.abs(level - found["image"])[found["image"] < 1]
    assert apart.size > 1000 and apart.max() <= 1.01 / 255


@pytest.mark.parametrize("coverage", [0.1, 0.5, 0.9])
def test_a_silhouette_keeps_its_backgrounds_share(coverage):
    found = lit(covering(coverage), 2, UNIFORM)
    rim = found["mask"][..., 0] > 0
    expected = (1 - found["mask"][rim]) * 0.3
    unclipped = found["image"][rim] < 1
    assert np.abs(found["background"][rim] - expected)[unclipped].max() < 0.02


def test_a_background_is_never_less_than_black():
    """Where the stored image is clipped, less is left than the object's own share."""
    stored = covering(0.9, background=1.0)
    found = lit(stored | {"diffuse_shading": stored["diffuse_shading"] * 100})
    assert found["background"].min() == 0 and np.isfinite(found["object"]).all()


def test_extremes_stay_finite():
    sphere = example(0, size=SIZE)
    huge = {
        name: sphere[name] * 0 + records.LARGEST_HALF
        for name in ("diffuse_shading", "specular_shading")
    }
    for changes in (huge, {"mask": sphere["mask"] * 0}):
        found = lit(sphere | changes, 0, UNIFORM)
        assert np.isfinite(found["object"]).all() and np.isfinite(found["background"]).all()


def test_all_but_the_albedos_stays(sphere):
    found = repaint(sphere, tf.constant([4, 1]), UNIFORM)
    assert set(found) == set(sphere)
    for name in sphere:
        same = np.array_equal(found[name], sphere[name])
        assert same == (name not in ("diffuse_albedo", "specular_albedo")), name
        assert found[name].shape == sphere[name].shape and found[name].dtype == sphere[name].dtype


def test_a_photo_shows_the_new_albedos_clipped_parts_as_well():
    found = lit(example(0, size=SIZE), 0, UNIFORM)
    tensors = {name: tf.constant(value) for name, value in found.items()}
    taken = camera.photograph(
        tensors, tensors["object"] + tensors["background"], tf.constant([1, 1])
    )
    inside = found["mask"][..., 0] == 1
    seen = taken["image"].numpy()[inside]
    new = colour.linear_to_srgb(np.clip(composed(taken), 0, 1))[inside]
    own = example(0, size=SIZE)
    albedos = {name: own[name] for name in ("diffuse_albedo", "specular_albedo")}
    old = colour.linear_to_srgb(np.clip(composed(taken | albedos), 0, 1))[inside]
    # Blur, noise and JPEG are a real camera's.
    assert np.abs(seen - new).mean() < 0.03 < 0.05 < np.abs(seen - old).mean()


def test_albedos_are_drawn_as_section_5_1_draws_them(sphere):
    drawn = [repaint(sphere, tf.constant([seed, 0]), UNIFORM) for seed in range(300)]
    diffuse = np.stack([one["diffuse_albedo"] for one in drawn])
    specular = np.stack([one["specular_albedo"] for one in drawn])
    for values in (*diffuse.T, specular):
        assert 0 <= values.min() < 0.05 and 0.95 < values.max() < 1
        # Uniform: mean 1/2 and variance 1/12, within some four standard errors.
        assert abs(values.mean() - 0.5) < 0.07 and abs(values.var() - 1 / 12) < 0.02
    # No channel tells of another.
    correlation = np.corrcoef(np.concatenate([diffuse.T, specular[None]]))
    assert np.abs(correlation - np.eye(4)).max() < 0.25


@pytest.mark.parametrize(
    "log", [-1.0, 1.5, 4.0, *(pytest.param(log, marks=pytest.mark.slow) for log in (0.0, 3.0))]
)
def test_natural_albedos_are_those_of_materials_of_the_scenes_exponent(sphere, log):
    """Beyond the table's ends as at its ends."""
    stored = dict(sphere) | {"shininess": tf.constant(10.0**log, tf.float32)}
    law = (material_law.NATURAL,)
    found = [repaint(stored, tf.constant([seed, 0]), law) for seed in range(200)]
    drawn = np.array([[*new["diffuse_albedo"], new["specular_albedo"]] for new in found])
    table = material_law.natural_table()
    rows = {tuple(row[1:]): row[0] for row in table}
    logs = np.array([rows[tuple(row)] for row in drawn])
    assert np.abs(logs - np.clip(log, 0, 3)).max() < 0.025
    # Half of 129 rows, or at an end of 65, are drawn at least once in 200 draws.
    assert len(np.unique(logs)) > 30


def test_several_laws_take_turns(sphere):
    laws = (material_law.UNIFORM, material_law.NATURAL)
    seeds = [tf.constant([seed, 0]) for seed in range(120)]
    both = [float(repaint(sphere, seed, laws)["specular_albedo"]) for seed in seeds]
    alone = [
        {float(repaint(sphere, seed, (law,))["specular_albedo"]) for seed in seeds} for law in laws
    ]
    shares = [np.mean([value in known for value in both]) for known in alone]
    assert min(shares) > 0.3 and sum(shares) == pytest.approx(1, abs=0.02)
