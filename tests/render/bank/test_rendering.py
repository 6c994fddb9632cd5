"""A bank's bytes: the same whatever the number of workers and interruptions."""

import json
import shutil

import numpy as np
import pytest
import small_banks

from lime_keras.render.bank import entries, textures, worker
from lime_keras.synthesis import bank as banks
from lime_keras.synthesis.geometry import GeometryBank


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def again(folder, choice, inputs, **changes):
    """Renders the bank of the fixture `rendered` once more."""
    values = {
        "count": 20,
        "shard_size": 8,
        "shapes": str(inputs / "shapes"),
        "environments": str(inputs / "environments"),
    }
    return small_banks.render(folder, choice, **(values | changes))


def test_a_bank_is_whole_and_its_manifest_tells_all(rendered):
    manifest = banks.manifest(rendered)
    found = GeometryBank(rendered)
    assert (len(found), found.size, manifest["shards"]) == (20, 32, 3)
    assert manifest["shapes"][1:] == ["procedural-00000", "procedural-00001"]
    assert found.shape.tolist() == [0] * 8 + [1] * 8 + [0] * 4
    assert manifest["description"]["shapes"] == "shapes"  # by name alone: a bank may be passed on
    assert manifest["inputs"]["shapes"].keys() == {manifest["shapes"][0]}
    assert {"mitsuba", "numpy"} <= set(manifest["packages"])
    files = {str(p.relative_to(rendered)) for p in rendered.rglob("*") if p.is_file()}
    beside = {"bank.json", "description.json", "inputs.json"}
    sidecars = {f"geometry/{shard:05d}.json" for shard in range(3)}
    assert files == {*manifest["files"], *beside, *sidecars}
    assert banks.textures(rendered).shape == (5, 48, 48, 3)


def test_what_is_finished_is_not_rendered_again(rendered, inputs, mitsuba_choice, monkeypatch):
    before = contents(rendered)
    for module, name in ((worker, "render_shard"), (worker, "render_light")):
        monkeypatch.setattr(module, name, None)
    monkeypatch.setattr(worker, "render_textures", None)
    told = []
    again(rendered, mitsuba_choice, inputs, tell=lambda *t: told.append(t))
    assert told == [(20, 20)] and contents(rendered) == before


def test_an_interrupted_bank_goes_on_to_the_same_bytes(
    rendered, inputs, mitsuba_choice, monkeypatch, tmp_path
):
    """Interrupted in every kind of work: after it, what was finished is kept."""
    out, expected = tmp_path / "bank", contents(rendered)
    todo = {"render_light": 1, "render_textures": 1, "render_shard": 2}
    kept = {}
    for name, limit in todo.items():
        original, count = getattr(worker, name), iter(range(limit))

        def stopped(held, item, original=original, count=count):
            if next(count, None) is None:
                raise KeyboardInterrupt
            original(held, item)

        with monkeypatch.context() as patch:
            patch.setattr(worker, name, stopped)
            with pytest.raises(KeyboardInterrupt):
                again(out, mitsuba_choice, inputs)
        assert not banks.is_bank(out)
        found = {n: (out / n).stat().st_mtime_ns for n in contents(out) if n != "description.json"}
        assert all(found.get(n) == t for n, t in kept.items() if n in found and "inputs" not in n)
        kept = found
    for folder in (".", "geometry", "parts", "parts/rooms"):
        (out / folder / "partial-left").write_bytes(b"by a killed process")
    told = []
    again(out, mitsuba_choice, inputs, tell=lambda *t: told.append(t))
    assert told[0] == (16, 20) and contents(out) == expected


def test_workers_make_the_same_bytes(tmp_path, mitsuba_choice, monkeypatch):
    """Entries of one process, and of two."""
    alone = tmp_path / "alone"
    small_banks.render(alone, mitsuba_choice, shard_size=2)
    expected = {n: c for n, c in contents(alone).items() if n.startswith("geometry/")}
    out = tmp_path / "bank"
    shutil.copytree(alone / "lights", out / "lights")
    shutil.copy(alone / banks.TEXTURES, out / banks.TEXTURES)
    small_banks.render(out, mitsuba_choice, shard_size=2, workers=2)
    assert {n: c for n, c in contents(out).items() if n.startswith("geometry/")} == expected


def test_a_prefix_of_a_bank_is_the_shorter_bank(rendered, inputs, mitsuba_choice, tmp_path):
    """But for the order of the files, which comes round anew, and there is one file."""
    again(tmp_path, mitsuba_choice, inputs, count=8)
    shorter = contents(tmp_path)
    assert shorter["geometry/00000.bin"] == (rendered / "geometry/00000.bin").read_bytes()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"seed": 7}, "seed 0 there, 7 asked"),
        ({"count": 21}, "count 20 there, 21 asked"),
        ({"shapes": None}, "shapes shapes there, None asked"),
    ],
)
def test_another_bank_in_the_folder_is_refused(rendered, inputs, mitsuba_choice, changes, told):
    with pytest.raises(ValueError, match=f"holds another bank: {told}"):
        again(rendered, mitsuba_choice, inputs, **changes)


def test_a_corpus_in_the_folder_is_refused(tmp_path, inputs, mitsuba_choice):
    (tmp_path / "description.json").write_text(json.dumps({"split": "train", "shading": "furnace"}))
    with pytest.raises(ValueError, match="holds another bank: count None there"):
        again(tmp_path, mitsuba_choice, inputs)


def test_an_unusable_file_is_refused_before_the_folder_is_made_or_skipped(
    tmp_path, inputs, mitsuba_choice
):
    shapes = tmp_path / "shapes"
    shutil.copytree(inputs / "shapes", shapes / "train")
    shutil.copytree(inputs / "shapes", shapes / "test")
    (shapes / "train" / "broken.ply").write_text("nothing")
    out = tmp_path / "bank"
    with pytest.raises(ValueError, match=r"1 file cannot be used:\n  shapes: broken\.ply"):
        again(out, mitsuba_choice, inputs, shapes=str(shapes), count=1)
    assert not out.exists()
    manifest = again(out, mitsuba_choice, inputs, shapes=str(shapes), count=1, skip_unusable=True)
    assert list(manifest["skipped"]["shapes"]) == ["broken.ply"]
    assert "broken.ply" not in manifest["shapes"]


def test_the_users_pictures_are_the_textures(tmp_path, mitsuba_choice):
    """Each in turn: of two pictures of one colour each, every other texture has that colour."""
    import OpenImageIO as oiio

    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for name, level in (("a.png", 0.2), ("b.png", 0.8)):
        image = oiio.ImageBuf(np.full((40, 40, 3), level, np.float32))
        assert image.write(str(pictures / name), oiio.UINT8)
    out = tmp_path / "bank"
    small_banks.render(out, mitsuba_choice, count=1, backgrounds=str(pictures))
    held = banks.textures(out)
    assert [int(texture.mean()) for texture in held] == [51, 204, 51, 204, 51]
    assert textures.tasks() == range(8)  # of the banks of users


def test_a_full_disk_is_told_by_the_file(tmp_path, mitsuba_choice, monkeypatch):
    from lime_keras.render.bank.description import Job

    job = Job(tmp_path, small_banks.describe(mitsuba_choice, count=1), mitsuba_choice)
    state = worker.Worker(job, entries.Bodies(job), ticks=type("T", (), {"put": print})())

    def full(path, content, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(worker.atomic, "write", full)
    with pytest.raises(RuntimeError, match=r"00000\.bin cannot be written .*No space left"):
        worker.render_shard(state, 0)
