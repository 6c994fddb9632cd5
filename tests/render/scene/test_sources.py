"""Where things come from: no file and no seed serves two ends."""

import itertools

import numpy as np
import pytest

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


def test_pictures_of_a_folder_are_found(tmp_path):
    with pytest.raises(ValueError, match=f"{tmp_path.name} holds no picture"):
        sources.pictures(tmp_path)
    fill(tmp_path, ["b.png", "a.JPG", "readme.txt"])
    assert [path.name for path in sources.pictures(tmp_path)] == ["a.JPG", "b.png"]


def test_one_thing_in_two_formats_is_refused(tmp_path):
    for name in ("a.obj", "b.obj", "Bunny.obj", "bunny.glb"):
        (tmp_path / name).touch()
    with pytest.raises(ValueError, match=r"Bunny.obj and bunny.glb may be one thing, which"):
        sources.files(tmp_path, "train", (".obj", ".glb"))
