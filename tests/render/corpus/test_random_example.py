"""One example of a corpus: drawn anew where it fails, from what its shard draws from."""

import numpy as np
import pytest
from render_scenes import write_inputs

from lime_keras.data import records
from lime_keras.optics.material_law import sample_material
from lime_keras.render.corpus import random_example
from lime_keras.render.corpus.random_example import Sources, render_example
from lime_keras.render.scene.quality import FAST
from lime_keras.render.scene.sampling import sample_light_rotation, sample_pose
from lime_keras.render.scene.sources import BackgroundSource, LightSource, ShapeSource, generator

SMALL = {"size": 64, "shard_size": 2}


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = write_inputs(tmp_path_factory.mktemp("inputs"))
    return Sources(
        ShapeSource(folder / "shapes", "train", 0),
        LightSource(folder / "environments", "train", 0, folder / "rooms"),
        BackgroundSource(None),
    )


def test_a_scene_that_fails_is_drawn_anew_and_told(sources, monkeypatch):
    usable, calls = random_example.example.render, []

    def fails_once(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 1:
            raise ValueError("the object covers 0.1% of the image")
        return usable(*arguments, **options)

    monkeypatch.setattr(random_example.example, "render", fails_once)
    example = render_example(0, 3, sources, **SMALL)
    assert int(records.parse(example.record)["index"]) == 3 and len(calls) == 2
    [failure] = example.failures
    assert failure.pop("shape") in sources.shape_names
    assert failure.pop("light") in sources.light_names
    assert failure == {"index": 3, "attempt": 0, "error": "the object covers 0.1% of the image"}
    monkeypatch.setattr(random_example, "_TRIES", 1)
    calls.clear()
    with pytest.raises(RuntimeError, match=r"example 3 of seed 0 failed 1 times, last of .*0\.1%"):
        render_example(0, 3, sources, **SMALL)


def test_an_example_that_no_record_can_hold_is_drawn_anew_and_told(sources, monkeypatch):
    usable, calls = random_example.example.render, []

    def not_finite_once(*arguments, **options):
        calls.append(arguments)
        features = usable(*arguments, **options)
        if len(calls) == 1:
            features["mirror"][5, 5] = float("nan")
        return features

    monkeypatch.setattr(random_example.example, "render", not_finite_once)
    example = render_example(0, 3, sources, **SMALL)
    [failure] = example.failures
    assert "mirror is not finite" in failure["error"]
    assert (example.features["mirror"] >= 0).all()


def test_a_scene_is_drawn_in_the_order_that_the_bytes_of_corpora_depend_on(sources):
    features = render_example(0, 3, sources, **SMALL).features
    rng = generator(0, "train", "example", 3, 0)
    shape = sources.shape_names[rng.integers(len(sources.shape_names))]
    light = sources.light_names[rng.integers(len(sources.light_names))]
    pose = sample_pose(rng, sources.mesh(shape, 64, FAST)[0].vertices, 64)
    sample_light_rotation(rng, sources.light(light, FAST).strong_direction)
    material = sample_material(rng)
    background = sources.backgrounds.sample(rng, 64)
    assert (features["shape"], features["light"]) == (shape, light)
    np.testing.assert_array_equal(features["camera"], pose.camera)
    np.testing.assert_array_equal(features["diffuse_albedo"], material.diffuse_albedo)
    assert features["shininess"] == material.exponent
    outside = features["mask"][..., 0] == 0
    difference = np.abs(features["image"] - background)[outside]
    assert outside.any() and difference.max() < 1e-5


def test_a_shard_draws_from_a_part_of_many_files_and_the_split_from_all(sources, monkeypatch):
    many = [f"{number:03d}.ply" for number in range(200)]
    monkeypatch.setattr(sources, "shape_names", many)
    drawn = [sources.of_shard(0, shard)[0] for shard in range(30)]
    for names in drawn:
        assert len(set(names)) == random_example._SHAPES_PER_SHARD and names == sorted(names)
    assert set().union(*drawn) == set(many)
    assert sources.of_shard(0, 7)[0] == drawn[7] != drawn[8]
    assert sources.of_shard(0, 0)[1] == sources.light_names  # few: all of them


def test_built_in_sources_are_those_of_a_corpus_of_that_seed(tmp_path):
    """Its shard draws from 64 of the 400 shapes, and the shape drawn is the seed's."""
    sources = Sources.built_in("train", 5, tmp_path)
    assert (len(sources.shape_names), len(sources.light_names)) == (400, 40)
    [one, other] = (sources.of_shard(5, shard)[0] for shard in (0, 1))
    assert len(one) == len(other) == 64 and one != other
    mesh, _ = sources.mesh(one[0], 64, FAST)
    expected = ShapeSource(None, "train", 5).load(one[0])
    np.testing.assert_array_equal(mesh.vertices, expected.vertices)
    assert sources.mesh(one[0], 64, FAST)[0] is mesh  # held
