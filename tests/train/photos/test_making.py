"""Photos: of a number alone, whoever makes them; painted before the camera, and marked."""

import dataclasses
import os

import numpy as np
import pytest
from no_progress import nothing
from PIL import Image
from sphere_corpus import example, write_split

from lime_keras.data import camera
from lime_keras.networks import SUBNETWORKS
from lime_keras.optics import camera_law, colour
from lime_keras.train import terms
from lime_keras.train.config import corpus_sha256
from lime_keras.train.photos import kept, making, paint
from lime_keras.train.photos.kept import Kept
from lime_keras.train.photos.making import Recipe, Studio

SIZE = 32
FEATURES = (*terms.features_of(terms.terms_of(SUBNETWORKS, "robust")), "seed", "index")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photos") / "corpus"
    return write_split(folder, "train", [range(3), range(3, 5), range(5, 8)], size=SIZE)


@pytest.fixture(scope="module")
def recipe(corpus):
    return Recipe(
        corpora=(corpus,),
        corpus_sha256=corpus_sha256([corpus]),
        seed=3,
        size=SIZE,
        features=FEATURES,
        camera=True,
        materials=("uniform",),
        paint="prints",
    )


def _same(one, other):
    for name, value in one.items():
        np.testing.assert_array_equal(value, other[name], err_msg=name)


@pytest.mark.parametrize("which", ["prints", "clutter", None])
def test_a_photo_follows_from_its_number_alone(recipe, which):
    studio = Studio(dataclasses.replace(recipe, paint=which))
    some = studio.photos(range(0, 9))
    for number in (4, 0, 8):
        alone = studio.photos(range(number, number + 1))
        _same(alone, {name: value[number : number + 1] for name, value in some.items()})
    assert len({one.tobytes() for one in some["image"]}) == 9


def test_every_scene_is_seen_before_any_is_seen_again(recipe):
    rows = Studio(recipe).photos(range(15))["index"]
    for epoch in range(3):
        assert sorted(rows[5 * epoch : 5 * epoch + 5]) == [0, 1, 2, 3, 4]
    assert len({tuple(rows[first : first + 5]) for first in (0, 5, 10)}) > 1


def test_any_number_of_processes_and_an_interruption_leave_the_same_bytes(
    recipe, tmp_path, monkeypatch
):
    monkeypatch.setattr(kept, "PART", 3)
    folders = [tmp_path / name for name in ("one", "two")]
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0})
    told = []

    def interrupt(what, done, total):
        told.append((what, done, total))
        if len(told) == 2:
            raise KeyboardInterrupt

    photos = Kept(folders[0], 7, FEATURES, SIZE)
    with pytest.raises(KeyboardInterrupt):
        making.make(recipe, photos, "photos", interrupt)
    assert photos.begin() == [range(6, 7)] and not photos.is_complete
    making.make(recipe, photos, "photos", lambda *progress: told.append(progress))
    assert told == [("photos", 3, 7), ("photos", 6, 7), ("photos", 7, 7)]
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1})
    making.make(recipe, Kept(folders[1], 7, FEATURES, SIZE), "photos", nothing)
    for path in sorted(folders[0].glob("*.np*")):
        assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name


def test_after_an_interruption_behind_the_last_part_the_photos_are_complete(recipe, tmp_path):
    def interrupt(what, done, total):
        raise KeyboardInterrupt

    photos = Kept(tmp_path / "photos", 2, FEATURES, SIZE)
    with pytest.raises(KeyboardInterrupt):
        making.make(recipe, photos, "photos", interrupt)
    assert not photos.is_complete
    making.make(recipe, photos, "photos", nothing)
    assert photos.is_complete


def _straight(monkeypatch, **numbers):
    """Let the camera err as these say: no noise, cast, exposure or defocus but theirs."""
    changes = {"STOPS": 0.0, "CONFUSION": 0.0, "FULL_WELL": (1e12, 1e12), "READ_NOISE": 0.0}
    changes |= {"CAST": 0.0, "TINT": 0.0, "UNEVEN": 0.0, "NEVER_COMPRESSED": 1.0} | numbers
    for name, value in changes.items():
        monkeypatch.setattr(camera_law, name, value)


def _printed(monkeypatch):
    """Let every object bear one print with sharp edges, and nothing else."""
    monkeypatch.setattr(paint, "_PRINTED", 1.0)
    monkeypatch.setattr(paint, "_MOTTLED", 0.0)
    monkeypatch.setattr(paint, "_SHARPNESS", 1e6)


def test_eq_4_gives_the_photo_but_where_paint_lies(recipe, monkeypatch):
    _straight(monkeypatch)
    _printed(monkeypatch)
    rows = Studio(recipe).photos(range(6))
    grey = rows["specular_albedo"][:, None, None, None] * rows["specular_shading"]
    grey = grey + rows["ambient"][:, None, None, None]
    linear = rows["diffuse_albedo"][:, None, None] * rows["diffuse_shading"] + grey
    apart = np.abs(colour.linear_to_srgb(np.clip(linear, 0, 1)) - rows["image"]).max(-1)
    inside, painted = rows["mask"][..., 0] == 1, rows["painted"][..., 0] == 1
    assert 0.02 < painted[inside].mean() < 0.9 and not painted[~inside].any()
    assert apart[inside & ~painted].max() < 1.5 / 255
    assert np.median(apart[inside & painted]) > 0.03


@pytest.mark.parametrize("fault", ["defocus", "jpeg"])
def test_prints_pass_the_camera(recipe, fault, monkeypatch):
    """Painted onto the finished photo, their edges would stay as sharp as they were cut."""
    _printed(monkeypatch)
    monkeypatch.setattr(paint, "smooth_noise", _edge)
    monkeypatch.setattr(paint, "_LEVELS", (0.0, 0.0))
    monkeypatch.setattr(paint, "_BRIGHTEST_ALBEDO", 0.0)
    numbers = (
        {"CONFUSION": 4 / SIZE}
        if fault == "defocus"
        else {"NEVER_COMPRESSED": 0.0, "QUALITY": (5.0, 5.0)}
    )
    _straight(monkeypatch)
    sharp = Studio(recipe).photos(range(12))
    _straight(monkeypatch, **numbers)
    seen = Studio(recipe).photos(range(12))
    steps = []
    for rows in (sharp, seen):
        columns = rows["image"][:, SIZE // 2, SIZE // 2 - 1 : SIZE // 2 + 1]
        steps.append(np.abs(columns[:, 0] - columns[:, 1]).max(-1))
    changed = np.abs(steps[0] - steps[1]) > 0.02
    assert np.median(steps[0]) > 0.1 and changed.mean() > 0.5
    if fault == "defocus":
        # The blur carries paint beyond its edge, and the marks with it.
        wider = seen["painted"].sum() - sharp["painted"].sum()
        assert wider > 0 and np.median(steps[1]) < 0.8 * np.median(steps[0])


def _edge(size, generator, cells=None):
    """In place of noise: above 0 in the right half of a picture."""
    return np.where(np.arange(size) < size / 2, -1.0, 1.0)[None, :, None].repeat(size, 0)


def test_without_laws_a_photo_is_the_scene_as_rendered(recipe):
    plain = dataclasses.replace(recipe, camera=False, materials=(), paint=None)
    rows = Studio(plain).photos(range(5))
    for row, index in enumerate(rows["index"]):
        stored = example(int(index), size=SIZE)
        np.testing.assert_allclose(rows["image"][row], stored["image"], atol=0.51 / 255)
        np.testing.assert_allclose(rows["diffuse_albedo"][row], stored["diffuse_albedo"])
    assert not rows["painted"].any() and not rows["cast"].any()


def test_scenes_that_never_change_are_kept_once(recipe, tmp_path):
    plain = dataclasses.replace(recipe, camera=False, materials=(), paint=None)
    assert making.count_of(plain, tmp_path, 100) == 5
    assert making.count_of(plain, tmp_path, 2) == 2
    assert making.count_of(recipe, tmp_path, 100) == 100
    validation_recipe = dataclasses.replace(recipe, paint=None, validation=2)
    assert making.count_of(validation_recipe, tmp_path, 100) == 2


def test_validation_photos_are_by_the_seeds_of_their_scenes(recipe):
    validation_recipe = dataclasses.replace(recipe, materials=(), paint=None, validation=2)
    rows = Studio(validation_recipe).photos(range(2))
    assert rows["index"].tolist() == [5, 6]
    again = Studio(dataclasses.replace(validation_recipe, seed=9)).photos(range(2))
    _same(rows, again)


def test_the_key_follows_from_all_but_the_folders(recipe, tmp_path):
    assert dataclasses.replace(recipe, corpora=(tmp_path,)).key() == recipe.key()
    changes = (
        {"seed": 4},
        {"camera": False},
        {"materials": ("natural",)},
        {"paint": "clutter"},
        {"corpus_sha256": "0"},
        {"cutouts_sha256": "1"},
        {"size": 16},
        {"validation": 3},
    )
    keys = {dataclasses.replace(recipe, **change).key() for change in changes}
    assert len(keys | {recipe.key()}) == len(changes) + 1


def test_radiance_meets_the_camera_unclipped(recipe, monkeypatch):
    """A highlight beyond white is still white after a shorter exposure, and no grey plateau."""
    seen = []
    honest = camera.photograph

    def noted(example, radiance, seed=None):
        seen.append(radiance)
        return honest(example, radiance, seed)

    monkeypatch.setattr(camera, "photograph", noted)
    rows = Studio(recipe).photos(range(5))
    assert seen and rows["clipped"].any()
    _straight(monkeypatch, STOPS=0.0)
    monkeypatch.setattr(camera_law, "exposure", lambda drawn: 0.25 + 0.0 * drawn)
    dark = Studio(recipe).photos(range(5))
    assert dark["clipped"].sum() < rows["clipped"].sum()
    assert np.isfinite(dark["image"]).all() and dark["image"].max() > 0.9


def test_a_cut_out_is_shown_without_a_camera_too(recipe, tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (80, 80, 4), dtype=np.uint8)
    pixels[..., 3] = 0
    pixels[5:75, 5:75, 3] = 255
    for name, levels in (("things", pixels), ("places", pixels[..., :3])):
        (tmp_path / name).mkdir()
        Image.fromarray(levels).save(tmp_path / name / "some.png")
    plain = dataclasses.replace(recipe, camera=False, materials=(), paint=None)
    cut = dataclasses.replace(plain, cutouts=(tmp_path / "things", tmp_path / "places"))
    before, after = (Studio(one).photos(range(0, 16)) for one in (plain, cut))
    replaced, shown = (
        [
            np.abs(np.subtract(one, other, dtype=np.float32)).max() > 0.1
            for one, other in zip(before[name], after[name], strict=True)
        ]
        for name in ("mask", "image")
    )
    assert shown == replaced and 0 < sum(replaced) < 16
