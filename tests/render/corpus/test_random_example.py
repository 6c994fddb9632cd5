"""One example of a corpus: drawn anew where it fails, from what its shard draws from."""

import functools

import numpy as np
import OpenImageIO as oiio
import pytest
from render_scenes import write_inputs

from lime_keras.data import records
from lime_keras.optics.material_law import sample_material
from lime_keras.render.corpus import random_example
from lime_keras.render.corpus.random_example import Sources, render_example
from lime_keras.render.rooms import renderer
from lime_keras.render.scene import environments
from lime_keras.render.scene.sampling import sample_light_rotation, sample_pose
from lime_keras.render.scene.sources import MIXED, files, generator
from lime_keras.render.shapes import endless, meshes

SMALL = {"size": 64, "shard_size": 2}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """The folder of rooms and the files of the train split: one mesh, and one map."""
    folder = write_inputs(tmp_path_factory.mktemp("inputs"))
    kinds = {"shapes": meshes.EXTENSIONS, "environments": environments.EXTENSIONS}
    return folder / "rooms", {kind: files(folder / kind, "train", kinds[kind]) for kind in kinds}


@pytest.fixture(scope="module")
def sources(inputs):
    return Sources("train", 0, *inputs)


def test_a_scene_that_fails_is_drawn_anew_and_told(sources, monkeypatch):
    usable, calls = random_example.example.render, []

    def fails_once(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 1:
            raise ValueError("the object covers 0.1% of the image")
        return usable(*arguments, **options)

    monkeypatch.setattr(random_example.example, "render", fails_once)
    example = render_example(3, sources, **SMALL)
    assert int(records.parse(example.record)["index"]) == 3 and len(calls) == 2
    [failure] = example.failures
    assert failure.pop("shape") in sources.shape_names
    assert failure.pop("light") in sources.light_names
    assert failure == {"index": 3, "attempt": 0, "error": "the object covers 0.1% of the image"}
    monkeypatch.setattr(random_example, "_TRIES", 1)
    calls.clear()
    with pytest.raises(RuntimeError, match=r"example 3 of seed 0 failed 1 times, last of .*0\.1%"):
        render_example(3, sources, **SMALL)


def test_a_shard_whose_bodies_all_fail_takes_another_shape(sources, monkeypatch):
    usable = random_example.example.render
    monkeypatch.setattr(sources, "names_in_shard", lambda *_: (["needle"], sources.light_names))
    [ball], found, made = sources.shape_names, [], sources.mesh

    def mesh(name, *rest):
        found.append(name)
        return made(ball, *rest)

    monkeypatch.setattr(sources, "mesh", mesh)

    def fails_of_the_needle(*arguments, **options):
        if found[-1] == "needle":
            raise ValueError("the object covers 0.1% of the image")
        return usable(*arguments, **options)

    monkeypatch.setattr(random_example.example, "render", fails_of_the_needle)
    example = render_example(3, sources, **SMALL)
    assert example.features["shape"] == ball and len(example.failures) == 10


def test_an_example_that_no_record_can_hold_is_drawn_anew_and_told(sources, monkeypatch):
    usable, calls = random_example.example.render, []

    def not_finite_once(*arguments, **options):
        calls.append(arguments)
        features = usable(*arguments, **options)
        if len(calls) == 1:
            features["mirror"][5, 5] = float("nan")
        return features

    monkeypatch.setattr(random_example.example, "render", not_finite_once)
    example = render_example(3, sources, **SMALL)
    [failure] = example.failures
    assert "mirror is not finite" in failure["error"]
    assert (example.features["mirror"] >= 0).all()


def test_a_scene_is_drawn_in_the_order_that_the_bytes_of_corpora_depend_on(sources):
    features = render_example(3, sources, **SMALL).features
    rng = generator(0, "train", "example", 3, 0)
    shape = sources.shape_names[rng.integers(len(sources.shape_names))]
    light = sources.light_names[rng.integers(len(sources.light_names))]
    pose = sample_pose(rng, sources.mesh(shape, 64)[0].vertices, 64)
    sample_light_rotation(rng, sources.light(light).strong_direction)
    material = sample_material(rng)
    background = sources.background(rng, 64)
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
    drawn = [sources.names_in_shard(shard, 512)[0] for shard in range(30)]
    for names in drawn:
        assert len(set(names)) == random_example.MOST and names == sorted(names)
    assert set().union(*drawn) == set(many)
    assert drawn[7] != drawn[8]
    assert sources.names_in_shard(0, 512)[1] == sources.light_names  # few: all of them


def test_built_in_sources_are_those_of_a_corpus_of_that_seed(tmp_path):
    """Its shard draws from 64 of the 400 shapes, and the shape drawn is the seed's."""
    sources = Sources("train", 5, tmp_path)
    assert (len(set(sources.shape_names)), len(set(sources.light_names))) == (400, 40)
    [one, other] = (sources.names_in_shard(shard, 512)[0] for shard in (0, 1))
    assert len(one) == len(other) == 64 and one != other
    mesh, _ = sources.mesh(one[0], 64)
    expected = endless.procedural(generator(5, "train", "shape", int(one[0][-4:])))
    np.testing.assert_array_equal(mesh.vertices, expected.vertices)
    assert sources.mesh(one[0], 64)[0] is mesh  # held


def test_a_built_in_shape_depends_on_seed_split_and_number(tmp_path):
    drawn = [
        Sources(split, seed, tmp_path).mesh(f"{split}-{index:04d}", 64)[0].vertices
        for split, seed, index in (
            ("train", 0, 0),
            ("train", 0, 0),
            ("train", 0, 1),
            ("train", 1, 0),
            ("test", 0, 0),
        )
    ]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    for other in drawn[2:]:
        assert not np.array_equal(drawn[0], other)


def test_a_built_in_room_is_rendered_once_and_read_again(mitsuba_choice, monkeypatch, tmp_path):
    small = functools.partial(renderer.render, height=32, samples=2)
    monkeypatch.setattr(renderer, "render", small)
    sources = Sources("train", 0, tmp_path / "rooms")
    first = sources.light("room-0003.exr")
    assert [path.name for path in sources.rooms.iterdir()] == ["room-0003.exr"]
    monkeypatch.delattr(renderer, "render")
    np.testing.assert_array_equal(sources._light("room-0003.exr").radiance, first.radiance)
    assert first.radiance.shape == (32, 64) and first.name == "room-0003.exr"


def test_a_large_map_is_averaged_down(tmp_path):
    image = oiio.ImageBuf(np.ones((600, 1200), np.float16))
    assert image.write(str(tmp_path / "a.exr"))
    sources = Sources("test", 0, tmp_path, {"environments": [tmp_path / "a.exr"]})
    assert sources.light_names == ["a.exr"] and sources.room_names == []
    assert sources.light("a.exr").radiance.shape == (512, 1024)


def test_backgrounds_are_textures_or_crops_of_pictures(sources, tmp_path):
    rng = np.random.default_rng(0)
    assert sources.background(rng, 32).shape == (32, 32, 3)
    image = oiio.ImageBuf(np.full((60, 80, 3), 128, np.uint8))
    assert image.write(str(tmp_path / "grey.png"))
    of_pictures = Sources("train", 0, tmp_path, {"backgrounds": [tmp_path / "grey.png"]})
    np.testing.assert_allclose(of_pictures.background(rng, 32), 0.5, atol=0.01)


@pytest.fixture(scope="module")
def varied(inputs):
    """Two files, a mixture of a map with rooms and skies, and bodies made for each shard."""
    rooms, given = inputs
    sources = Sources("train", 0, rooms, given, law=MIXED, endless=0.8)
    rooms.mkdir()
    for name in sources.room_names:  # any map will do, and rendering takes seconds
        (rooms / name).write_bytes(given["environments"][0].read_bytes())
    return sources


def test_mixed_lights_are_made_of_all_maps(varied, sources):
    [own] = sources.light_names
    assert varied.light_names[0] == own and len(varied.light_names) == 1 + 40 + 48
    drawn = [varied.light(f"mixed-00003-{number:02d}") for number in range(6)]
    assert len({light.radiance.tobytes() for light in drawn}) == 6
    assert {light.name for light in drawn} <= set(varied.light_names)
    again = varied._light("mixed-00003-04")
    np.testing.assert_array_equal(again.radiance, drawn[4].radiance)
    assert abs(again.radiance.mean() - varied._light("mixed-00004-04").radiance.mean()) > 1e-4


def test_a_map_may_be_called_like_a_mixture(varied, monkeypatch):
    [path] = varied._maps.values()
    monkeypatch.setitem(varied._maps, "mixed-light.exr", path)
    assert varied._light("mixed-light.exr").name == "mixed-light.exr"


def test_a_shard_has_a_body_and_a_light_for_eight_examples_and_64_at_most(varied):
    for size, expected in ((1, 1), (8, 1), (9, 2), (512, 64), (4096, 64)):
        drawn, lights = varied.names_in_shard(2, size)
        assert len(drawn) == len(lights) == expected
        assert set(lights) == {f"mixed-00002-{number:02d}" for number in range(expected)}


def test_bodies_are_endless_by_the_share(varied, sources):
    drawn = [name for shard in range(40) for name in varied.names_in_shard(shard, 512)[0]]
    made = [name for name in drawn if name not in sources.shape_names]
    assert len(made) / len(drawn) == pytest.approx(0.8, abs=0.03)
    assert len(set(made)) == len(made)
    assert set(drawn) == {*made, *sources.shape_names}
    first, again, other = (varied._mesh(name, 64)[0] for name in (*made[:1] * 2, made[1]))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    assert not np.array_equal(first.vertices, other.vertices)


def test_a_varied_scene_is_drawn_from_its_index_alone(varied):
    first = render_example(5, varied, **SMALL)
    assert first.record == render_example(5, varied, **SMALL).record
    assert first.record != render_example(6, varied, **SMALL).record
    # The environment stored is the mixture's, turned.
    mean = float(first.features["environment"].mean())
    assert np.isfinite(mean) and mean > 0
