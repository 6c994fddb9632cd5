"""Scenes in other paint: drawn as the paper draws it, and recomposed before their background."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example

from lime_keras.data import camera, records
from lime_keras.data.recomposition import recompose
from lime_keras.data.repaint import repaint
from lime_keras.optics import colour, material_law
from lime_keras.optics.compositing import compose

SIZE = 48
PAINTED = ("image", "diffuse_albedo", "specular_albedo")


@pytest.fixture(scope="module")
def sphere():
    return records.parse(records.encode(example(0, size=SIZE)))


def pictured(scene, seed):
    """The scene in other paint, and its picture."""
    new = repaint(scene, seed)
    return new | {"image": recompose(new, scene)}


def painted(scene, seed):
    found = pictured(scene, tf.constant([seed, 1]))
    return {name: value.numpy() for name, value in found.items()}


def composed(scene):
    """Eq. 4 from an example's own layers, `(S, S, 3)`, not clipped."""
    return compose(
        np.asarray(scene["diffuse_albedo"]),
        np.asarray(scene["specular_albedo"]),
        np.asarray(scene["ambient"]),
        np.asarray(scene["diffuse_shading"])[None],
        np.asarray(scene["specular_shading"])[None],
    )[0]


def soft(scene, coverage):
    """The scene with a silhouette that covers so much of its pixels, before a grey background."""
    mask = np.asarray(scene["mask"]).copy()
    inside = mask[..., 0] > 0
    rim = inside & ~np.roll(inside, 1, axis=1)
    mask[rim] = coverage
    scene = {name: np.asarray(value) for name, value in scene.items()} | {"mask": mask}
    linear = mask * composed(scene) + (1 - mask) * 0.2
    scene["image"] = np.round(255 * colour.linear_to_srgb(np.clip(linear, 0, 1))) / 255
    return {name: tf.constant(value) for name, value in scene.items()}, rim


@pytest.mark.parametrize("seed", range(6))
def test_the_picture_is_eq_4_of_the_new_albedos(sphere, seed):
    found = painted(sphere, seed)
    inside = found["mask"][..., 0] == 1
    level = colour.linear_to_srgb(np.clip(composed(found), 0, 1))
    np.testing.assert_allclose(found["image"][inside], level[inside], atol=0.53 / 255)
    np.testing.assert_array_equal(found["image"][~inside], sphere["image"][~inside])
    np.testing.assert_allclose(found["image"] * 255, np.round(found["image"] * 255), atol=1e-3)
    assert np.abs(found["image"] - sphere["image"])[inside].mean() > 0.02


def test_all_but_paint_stays(sphere):
    found = painted(sphere, 0)
    assert set(found) == set(sphere)
    for name in set(sphere) - set(PAINTED):
        assert np.array_equal(found[name], sphere[name]), name
    for name in PAINTED:
        assert found[name].shape == sphere[name].shape and found[name].dtype == np.float32


@pytest.mark.parametrize("coverage", [0.1, 0.5, 0.9])
def test_a_silhouette_keeps_its_backgrounds_share(sphere, coverage):
    scene, rim = soft(sphere, np.float32(coverage))
    assert rim.sum() > 20
    found = painted(scene, 2)
    linear = coverage * composed(found) + (1 - coverage) * 0.2
    expected = colour.linear_to_srgb(np.clip(linear, 0, 1))
    # Half a level of the stored picture, brighter where the new paint is darker, and half of this.
    dark = expected[rim] < 0.1
    apart = np.abs(found["image"][rim] - expected[rim])
    unclipped = np.asarray(scene["image"])[rim] < 1
    assert apart[unclipped & ~dark].max() < 4 / 255


def test_the_paint_is_drawn_as_section_5_1_draws_it(sphere):
    drawn = [repaint(sphere, tf.constant([seed, 0])) for seed in range(300)]
    diffuse = np.stack([scene["diffuse_albedo"] for scene in drawn])
    specular = np.stack([scene["specular_albedo"] for scene in drawn])
    for values in (*diffuse.T, specular):
        assert 0 <= values.min() < 0.05 and 0.95 < values.max() < 1
        # Uniform: mean 1/2 and variance 1/12, within some four standard errors.
        assert abs(values.mean() - 0.5) < 0.07 and abs(values.var() - 1 / 12) < 0.02
    # No channel tells of another.
    correlation = np.corrcoef(np.concatenate([diffuse.T, specular[None]]))
    assert np.abs(correlation - np.eye(4)).max() < 0.25


def test_the_seed_decides(sphere):
    for name in PAINTED:
        first, again, other = (painted(sphere, seed)[name] for seed in (4, 4, 5))
        np.testing.assert_array_equal(first, again)
        assert not np.array_equal(first, other)


def test_extremes_stay_pictures(sphere):
    huge = dict(sphere)
    for name in ("diffuse_shading", "specular_shading"):
        huge[name] = sphere[name] * 0 + records.LARGEST_HALF
    nothing = dict(sphere) | {"mask": sphere["mask"] * 0}
    for scene in (huge, nothing):
        found = painted(scene, 0)["image"]
        assert np.isfinite(found).all() and found.min() >= 0 and found.max() <= 1
    np.testing.assert_allclose(painted(nothing, 0)["image"], sphere["image"], atol=1e-6)


def test_a_photo_of_it_shows_eq_4_too(sphere):
    """What the camera takes for the scene's radiance follows the paint, clipped parts as well."""
    scene = pictured(sphere, tf.constant([0, 0]))
    taken = camera.photograph(scene, tf.constant([1, 1]))
    inside = np.asarray(scene["mask"])[..., 0] == 1
    seen = taken["image"].numpy()[inside]
    new = colour.linear_to_srgb(np.clip(composed(taken), 0, 1))[inside]
    albedos = {name: sphere[name] for name in PAINTED[1:]}
    old = colour.linear_to_srgb(np.clip(composed(taken | albedos), 0, 1))[inside]
    # Blur, noise and JPEG are a real camera's.
    assert np.abs(seen - new).mean() < 0.03 < 0.05 < np.abs(seen - old).mean()


@pytest.mark.parametrize("log", [-1.0, 0.0, 1.5, 3.0, 4.0])
def test_natural_paint_is_that_of_materials_of_the_scenes_exponent(sphere, log):
    """Beyond the table's ends as at its ends."""
    scene = dict(sphere) | {"shininess": tf.constant(10.0**log, tf.float32)}
    found = [repaint(scene, tf.constant([seed, 0]), (material_law.NATURAL,)) for seed in range(200)]
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
