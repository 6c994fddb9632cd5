"""Where things come from: no file and no seed serves two ends."""

import functools
import itertools

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh

from lime_keras.render.rooms import renderer
from lime_keras.render.scene import sources

EXTENSIONS = (".obj", ".ply")


def fill(folder, names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


@pytest.mark.parametrize("count", [2, 3, 10, 41])
def test_a_folder_is_dealt_out_once(tmp_path, count):
    names = [f"mesh{k}.obj" for k in range(count)]
    fill(tmp_path, [*names, "readme.txt"])
    train, test = (sources.files(tmp_path, split, EXTENSIONS) for split in ("train", "test"))
    assert train == sorted(train) and test == sorted(test)
    assert sorted(path.name for path in train + test) == sorted(names)
    assert len(test) == max(1, round(0.2 * count)) and train


def test_the_deal_depends_on_the_names_alone(tmp_path):
    names = [f"mesh{k}.obj" for k in range(12)]
    here = fill(tmp_path / "here", names)
    there = fill(tmp_path / "there", reversed(names))
    for split in ("train", "test"):
        dealt = [
            [path.name for path in sources.files(folder, split, EXTENSIONS)]
            for folder in (here, there)
        ]
        assert dealt[0] == dealt[1]


def test_subfolders_of_the_splits_names_decide(tmp_path):
    fill(tmp_path, ["outside.obj"])
    fill(tmp_path / "train", ["a.obj", "b.PLY"])
    fill(tmp_path / "test", ["c.obj"])
    train, test = (sources.files(tmp_path, split, EXTENSIONS) for split in ("train", "test"))
    assert [path.name for path in train] == ["a.obj", "b.PLY"]
    assert test == [tmp_path / "test" / "c.obj"]


def test_unusable_folders_are_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match="missing is no folder"):
        sources.files(tmp_path / "missing", "train", EXTENSIONS)
    single = fill(tmp_path / "single", ["a.obj", "b.txt"])
    with pytest.raises(ValueError, match=r"single holds 1 \.obj, \.ply files.* at least 2"):
        sources.files(single, "train", EXTENSIONS)
    fill(tmp_path / "dealt" / "train", ["a.obj"])
    fill(tmp_path / "dealt" / "test", [])
    with pytest.raises(ValueError, match=r"test holds no \.obj, \.ply file"):
        sources.files(tmp_path / "dealt", "test", EXTENSIONS)
    fill(tmp_path / "half" / "train", ["a.obj", "b.obj"])
    with pytest.raises(ValueError, match=r"test is missing: .* by the folders train and test"):
        sources.files(tmp_path / "half", "train", EXTENSIONS)


def test_generators_are_independent_of_one_another():
    things = [
        (seed, split, kind, *indices)
        for seed in (0, 1, 2**62)
        for split in ("train", "test")
        for kind, indices in (
            ("example", (0, 0)),
            ("example", (0, 1)),
            ("example", (1, 0)),
            ("shape", (0,)),
            ("shape", (1,)),
            ("room", (0,)),
        )
    ]
    draws = [sources.generator(*thing).random(64) for thing in things]
    for first, second in itertools.combinations(draws, 2):
        assert not np.intersect1d(first, second).size
        assert abs(np.corrcoef(first, second)[0, 1]) < 0.6
    np.testing.assert_array_equal(sources.generator(*things[0]).random(64), draws[0])


def test_built_in_names_tell_splits_apart(tmp_path):
    for split, shapes, rooms in (("train", 400, 40), ("test", 100, 12)):
        shape_names = sources.ShapeSource((), split, 0).names()
        room_names = sources.LightSource((), split, 0, tmp_path).names()
        assert (len(set(shape_names)), len(set(room_names))) == (shapes, rooms)


def test_a_built_in_shape_depends_on_seed_split_and_number():
    meshes = [
        sources.ShapeSource((), split, seed).load(f"{split}-{index:04d}")
        for split, seed, index in (
            ("train", 0, 0),
            ("train", 0, 0),
            ("train", 0, 1),
            ("train", 1, 0),
            ("test", 0, 0),
        )
    ]
    np.testing.assert_array_equal(meshes[0].vertices, meshes[1].vertices)
    for other in meshes[2:]:
        assert not np.array_equal(meshes[0].vertices, other.vertices)


@pytest.mark.parametrize("dealt", [False, True])
def test_meshes_are_found_by_name(tmp_path, dealt):
    for split in ("train", "test"):
        folder = tmp_path / split if dealt else tmp_path
        folder.mkdir(exist_ok=True)
        trimesh.creation.box((1, 2, 3)).export(folder / f"{split}.obj")
    for split in ("train", "test"):
        files = sources.files(tmp_path, split, EXTENSIONS)
        source = sources.ShapeSource(files, split, 0)
        [name] = source.names()
        assert len(source.load(name).faces) == 12


def test_a_built_in_room_is_rendered_once_and_read_again(mitsuba_choice, monkeypatch, tmp_path):
    small = functools.partial(renderer.render, height=32, samples=2)
    monkeypatch.setattr(renderer, "render", small)
    source = sources.LightSource((), "train", 0, tmp_path / "rooms")
    first = source.load("room-0003.exr")
    assert [path.name for path in (tmp_path / "rooms").iterdir()] == ["room-0003.exr"]
    monkeypatch.delattr(renderer, "render")
    np.testing.assert_array_equal(source.load("room-0003.exr").radiance, first.radiance)
    assert first.radiance.shape == (32, 64) and first.name == "room-0003.exr"


def test_a_large_map_is_averaged_down(tmp_path):
    image = oiio.ImageBuf(np.ones((600, 1200), np.float16))
    assert image.write(str(tmp_path / "a.exr"))
    source = sources.LightSource([tmp_path / "a.exr"], "test", 0, tmp_path)
    assert source.names() == ["a.exr"]
    assert source.load("a.exr").radiance.shape == (512, 1024)


def test_backgrounds_are_textures_or_crops_of_pictures(tmp_path):
    rng = np.random.default_rng(0)
    assert sources.BackgroundSource(()).sample(rng, 32).shape == (32, 32, 3)
    with pytest.raises(ValueError, match=f"{tmp_path.name} holds no picture"):
        sources.pictures(tmp_path)
    image = oiio.ImageBuf(np.full((60, 80, 3), 128, np.uint8))
    assert image.write(str(tmp_path / "grey.png"))
    picture = sources.BackgroundSource(sources.pictures(tmp_path)).sample(rng, 32)
    np.testing.assert_allclose(picture, 0.5, atol=0.01)
