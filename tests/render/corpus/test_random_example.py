"""One example of a corpus: drawn anew where it fails, from what its shard draws from."""

import numpy as np
import pytest
from render_scenes import write_inputs

from lime_keras.data import records
from lime_keras.optics.material_law import sample_material
from lime_keras.render.corpus import bodies, random_example
from lime_keras.render.corpus.bodies import Body
from lime_keras.render.corpus.random_example import Sources, render_example
from lime_keras.render.scene import environments
from lime_keras.render.scene.quality import FAST
from lime_keras.render.scene.sampling import sample_light_rotation, sample_pose
from lime_keras.render.scene.sources import (
    MIXED,
    BackgroundSource,
    LightSource,
    ShapeSource,
    files,
    generator,
)
from lime_keras.render.shapes import meshes

SMALL = {"size": 64, "shard_size": 2}


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = write_inputs(tmp_path_factory.mktemp("inputs"))
    maps = files(folder / "environments", "train", environments.EXTENSIONS)
    return Sources(
        ShapeSource(files(folder / "shapes", "train", meshes.EXTENSIONS), "train", 0),
        LightSource(maps, "train", 0, folder / "rooms"),
        BackgroundSource(()),
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
    pose = sample_pose(rng, sources.mesh(Body(shape), 64, FAST)[0].vertices, 64)
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
    drawn = [
        [body.name for body in sources.names_in_shard(0, shard, 512)[0]] for shard in range(30)
    ]
    for names in drawn:
        assert len(set(names)) == bodies.MOST and names == sorted(names)
    assert set().union(*drawn) == set(many)
    assert drawn[7] != drawn[8]
    assert sources.names_in_shard(0, 0, 512)[1] == sources.light_names  # few: all of them


def test_built_in_sources_are_those_of_a_corpus_of_that_seed(tmp_path):
    """Its shard draws from 64 of the 400 shapes, and the shape drawn is the seed's."""
    sources = Sources.built_in("train", 5, tmp_path)
    assert (len(sources.shape_names), len(sources.light_names)) == (400, 40)
    [one, other] = (sources.names_in_shard(5, shard, 512)[0] for shard in (0, 1))
    assert len(one) == len(other) == 64 and one != other
    mesh, _ = sources.mesh(one[0], 64, FAST)
    expected = ShapeSource((), "train", 5).load(one[0].name)
    np.testing.assert_array_equal(mesh.vertices, expected.vertices)
    assert sources.mesh(one[0], 64, FAST)[0] is mesh  # held


@pytest.fixture(scope="module")
def varied(sources):
    """Two files, a mixture of a map with rooms and skies, and bodies made for each shard."""
    lights = LightSource(sources._lights.files, "train", 0, sources._lights.cache, law=MIXED)
    lights.cache.mkdir(exist_ok=True)
    for name in lights.rooms():  # any map will do, and rendering takes seconds
        if not (lights.cache / name).is_file():
            (lights.cache / name).write_bytes(lights.files[0].read_bytes())
    return Sources(sources._shapes, lights, sources.backgrounds, endless=0.8)


def test_mixed_lights_are_made_of_all_maps(varied, sources):
    [own] = sources.light_names
    assert varied.light_names[0] == own and len(varied.light_names) == 1 + 40 + 48
    drawn = [varied.light((3, number), FAST) for number in range(6)]
    assert len({light.radiance.tobytes() for light in drawn}) == 6
    assert {light.name for light in drawn} <= set(varied.light_names)
    again = varied._light((3, 4), FAST)
    np.testing.assert_array_equal(again.radiance, drawn[4].radiance)
    assert abs(again.radiance.mean() - varied._light((4, 4), FAST).radiance.mean()) > 1e-4


def test_a_shard_has_a_body_and_a_light_for_eight_examples_and_64_at_most(varied):
    for size, expected in ((1, 1), (8, 1), (9, 2), (512, 64), (4096, 64)):
        drawn, lights = varied.names_in_shard(0, 2, size)
        assert len(drawn) == len(lights) == expected
        assert set(lights) == {(2, number) for number in range(expected)}


def test_bodies_are_endless_by_the_share(varied, sources):
    drawn = [body for shard in range(40) for body in varied.names_in_shard(0, shard, 512)[0]]
    made = [body for body in drawn if body.place]
    assert len(made) / len(drawn) == pytest.approx(0.8, abs=0.03)
    assert len({body.name for body in made}) == len(made)
    assert {body.name for body in drawn if not body.place} == set(sources.shape_names)
    first, again, other = (varied._mesh(body, 64, FAST)[0] for body in (*made[:1] * 2, made[1]))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    assert not np.array_equal(first.vertices, other.vertices)


def test_a_varied_scene_is_drawn_from_its_index_alone(varied):
    first = render_example(0, 5, varied, **SMALL)
    assert first.record == render_example(0, 5, varied, **SMALL).record
    assert first.record != render_example(0, 6, varied, **SMALL).record
    # The environment stored is the mixture's, turned.
    mean = float(first.features["environment"].mean())
    assert np.isfinite(mean) and mean > 0
