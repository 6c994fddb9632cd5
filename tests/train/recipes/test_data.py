"""Which files are validation's, and the list that a folder is checked against."""

import csv
import hashlib
import shutil

import pytest

from lime_keras.render.scene import environments
from lime_keras.render.shapes import meshes
from lime_keras.train.recipes import data

NAMES = [f"{letter}.ply" for letter in "abcdefghij"]


@pytest.fixture
def folder(tmp_path):
    """Ten meshes and three maps, in subfolders for training and test."""
    for kind, names in (("meshes", NAMES), ("environments", ["x.hdr", "y.exr", "z.hdr"])):
        for side in ("train", "test"):
            (tmp_path / "data" / kind / side).mkdir(parents=True)
        for name in names:
            (tmp_path / "data" / kind / "train" / name).write_text(name)
        (tmp_path / "data" / kind / "test" / names[0].replace(".", "-test.")).write_text("test")
    return tmp_path / "data"


def _sides(out, kind):
    return [{path.name for path in (out / kind / side).iterdir()} for side in ("train", "test")]


def test_validation_has_the_least_hashes_of_all_names():
    kept_out = data.validation_names(NAMES, 2)
    digest = {name: hashlib.sha256(b"validation " + name.encode()).hexdigest() for name in NAMES}
    assert len(kept_out) == 2
    rest = set(NAMES) - kept_out
    assert max(digest[name] for name in kept_out) < min(digest[name] for name in rest)
    # That of before: which others there are does not change who comes first.
    assert data.validation_names(NAMES[::-1], 1) < kept_out


@pytest.mark.parametrize(("files", "wanted", "kept"), [(10, 60, 2), (2, 60, 1), (500, 60, 60)])
def test_validation_keeps_no_more_than_a_fifth(files, wanted, kept):
    assert len(data.validation_names(map(str, range(files)), wanted)) == kept


def test_both_sides_are_links_and_share_nothing(folder, tmp_path):
    out = tmp_path / "run"
    data.link_sides(folder, "meshes", 2, out)
    train, test = _sides(out, "meshes")
    assert train | test == set(NAMES) and not train & test and len(test) == 2
    assert all((out / "meshes" / "train" / name).read_text() == name for name in train)
    # A file that went goes, and one whose link is broken comes back.
    name = min(train)
    (folder / "meshes" / "train" / name).unlink()
    (out / "meshes" / "train" / max(train)).unlink()
    data.link_sides(folder, "meshes", 2, out)
    assert set().union(*_sides(out, "meshes")) == set(NAMES) - {name}


def test_links_follow_the_folder_and_files_stay(folder, tmp_path):
    out, moved = tmp_path / "run", tmp_path / "moved"
    data.link_sides(folder, "meshes", 2, out)
    own = out / "meshes" / "train" / "notes.txt"
    own.write_text("mine")
    shutil.copytree(folder, moved)
    data.link_sides(moved, "meshes", 2, out)
    assert own.read_text() == "mine"
    links = [path for path in (out / "meshes").rglob("*.ply")]
    assert len(links) == len(NAMES)
    assert all(path.resolve().is_relative_to(moved) for path in links)
    # A file that would be rendered as one of the data.
    own.rename(own.with_suffix(".ply"))
    with pytest.raises(ValueError, match=r"notes.ply is no link to the data: remove it"):
        data.link_sides(moved, "meshes", 2, out)


def test_one_content_on_both_sides_is_refused(folder):
    files = data.digests(folder, "meshes")
    data.refuse_twins(files, 2)
    kept = data.validation_names(NAMES, 2)
    seen, left = (f"meshes/train/{min(side)}" for side in (kept, set(NAMES) - kept))
    with pytest.raises(ValueError, match=rf"{seen} and {left} may be the same, and one of them"):
        data.refuse_twins(files | {left: files[seen]}, 2)
    # One thing in two formats.
    twins = {seen: "0", seen.replace(".ply", ".obj"): "1"}
    with pytest.raises(ValueError, match="may be the same"):
        data.refuse_twins(twins, 1)
    # Twins of one side are as good as one.
    other = f"meshes/train/{max(kept)}"
    data.refuse_twins(files | {other: files[seen]}, 2)


def test_a_folder_without_sides_is_split_as_well(folder, tmp_path):
    plain = tmp_path / "plain"
    shutil.copytree(folder / "meshes" / "train", plain / "meshes")
    data.link_sides(plain, "meshes", 2, tmp_path / "plain-run")
    data.link_sides(folder, "meshes", 2, tmp_path / "run")
    assert _sides(tmp_path / "plain-run", "meshes") == _sides(tmp_path / "run", "meshes")


def test_too_few_files_are_told(folder):
    for path in (folder / "environments" / "train").glob("[yz]*"):
        path.unlink()
    with pytest.raises(FileNotFoundError, match=r"environments/train holds 1 .hdr, .exr files"):
        data.training_files(folder, "environments")
    shutil.rmtree(folder / "environments")
    with pytest.raises(FileNotFoundError, match=r"environments is missing: --data takes a folder"):
        data.training_files(folder, "environments")


def test_two_files_are_one_for_each_side_and_one_is_refused(tmp_path):
    (tmp_path / "meshes").mkdir()
    for name in ("a.ply", "b.ply"):
        (tmp_path / "meshes" / name).write_bytes(b"ply")
    data.link_sides(tmp_path, "meshes", 60, tmp_path / "run")
    train, test = _sides(tmp_path / "run", "meshes")
    assert len(train) == len(test) == 1 and train | test == {"a.ply", "b.ply"}
    (tmp_path / "meshes" / "b.ply").unlink()
    with pytest.raises(FileNotFoundError, match="at least 2 are needed"):
        data.link_sides(tmp_path, "meshes", 60, tmp_path / "other")


def test_digests_are_of_the_training_side_alone(folder):
    files = data.digests(folder, "meshes")
    assert sorted(files) == [f"meshes/train/{name}" for name in NAMES]
    assert files["meshes/train/a.ply"] == hashlib.sha256(b"a.ply").hexdigest()
    assert data.total(files) == data.total(dict(reversed(files.items())))
    assert data.total(files | {"meshes/train/a.ply": "0"}) != data.total(files)


def test_the_check_names_what_differs(folder, monkeypatch, capsys):
    files = data.digests(folder, "meshes")
    maps = data.digests(folder, "environments")
    monkeypatch.setattr(data, "listed", lambda: files | maps)
    assert data.main([str(folder)]) == 1
    told = capsys.readouterr().out
    assert "meshes/test/a-test.ply is not in the list" in told
    shutil.rmtree(folder / "meshes" / "test")
    shutil.rmtree(folder / "environments" / "test")
    assert data.main([str(folder)]) == 0
    assert f"{folder} holds all the 13 files of the list" in capsys.readouterr().out
    (folder / "meshes" / "train" / "a.ply").write_text("b")
    (folder / "meshes" / "train" / "b.ply").unlink()
    assert data.main([str(folder)]) == 1
    told = capsys.readouterr().out
    assert "a.ply has other bytes\n" in told and "b.ply is missing\n" in told
    assert data.main([str(folder / "none")]) == 1
    assert "error:" in capsys.readouterr().err


def test_the_list_names_licence_and_source_of_every_file():
    with data.LIST.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len({row["file"] for row in rows}) == len(rows) == len(data.listed())
    for row in rows:
        kind, side, _ = row["file"].split("/")
        assert kind in data.SUFFIXES and side in ("train", "test")
        assert len(bytes.fromhex(row["sha256"])) == 32
        assert row["licence"] and row["place"] and "@" in row["repository"], row["file"]


def test_the_files_are_those_that_are_rendered():
    rendered = {"meshes": meshes.EXTENSIONS, "environments": environments.EXTENSIONS}
    assert {kind: set(one) for kind, one in data.SUFFIXES.items()} == {
        kind: set(one) for kind, one in rendered.items()
    }
