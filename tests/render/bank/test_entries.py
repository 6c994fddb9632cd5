"""Entries: which body each shows, where it is in the crop, what of its G-buffer is held."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import small_banks
from render_scenes import sphere

from lime_keras.optics import octahedral
from lime_keras.optics.shading import view_directions
from lime_keras.render.bank import entries
from lime_keras.render.bank.description import Job
from lime_keras.render.scene import gbuffer
from lime_keras.render.scene.example import LEAST_COVERAGE
from lime_keras.synthesis import geometry


def job(choice, **changes):
    return Job(Path("nowhere"), small_banks.describe(choice, **changes), choice)


@pytest.fixture
def balls(mitsuba_choice, monkeypatch):
    """A job of undeformed balls."""
    ball = sphere(3)
    monkeypatch.setattr(entries, "endless", lambda rng: ball)
    monkeypatch.setattr(entries, "deformed", lambda mesh, rng: mesh)
    return job(mitsuba_choice, count=64, size=64)


def pictures(task, indices):
    """The decoded entries of these indices."""
    bodies = entries.Bodies(task)
    found = [entries.render(bodies, task, index) for index in indices]
    return found, [geometry.decode(e.data, task.description.size) for e in found]


# ---- bodies ----------------------------------------------------------------------------------


def test_procedural_bodies_come_in_rows_and_not_again(mitsuba_choice):
    bodies = entries.Bodies(job(mitsuba_choice, count=20))
    shown = [bodies.of_entry(index, 0) for index in range(20)]
    assert shown == [0] * 8 + [1] * 8 + [2] * 4
    assert bodies.names == [f"procedural-{k:05d}" for k in range(3)]


def test_half_of_the_entries_show_files_each_as_often_as_the_others(mitsuba_choice, monkeypatch):
    task = job(mitsuba_choice, count=16 * 15, shapes="folder")
    task = dataclasses.replace(task, usable={"shapes": ("a.ply", "b.ply", "c.ply")})
    bodies = entries.Bodies(task)
    shown = [bodies.names[bodies.of_entry(index, 0)] for index in range(16 * 15)]
    for name in ("a.ply", "b.ply", "c.ply"):
        assert shown.count(name) == 8 * 5
    assert len({name for name in shown if name.startswith("procedural")}) == 15
    files = [name for name in shown[::16]]
    assert {*files[:3]} == {*files[3:6]} == {"a.ply", "b.ply", "c.ply"}
    assert len({tuple(files[k : k + 3]) for k in range(0, 15, 3)}) > 1  # in another order


def test_a_file_that_fails_makes_way_for_a_procedural_body(mitsuba_choice):
    task = job(mitsuba_choice, count=1, shapes="folder")
    bodies = entries.Bodies(dataclasses.replace(task, usable={"shapes": ("thin.ply",)}))
    assert bodies.names == ["thin.ply", "procedural-00000"]
    assert [bodies.of_entry(0, attempt) for attempt in (0, 3, 4, 19)] == [0, 0, 1, 1]


def test_the_two_splits_show_other_bodies(mitsuba_choice):
    train, test = (
        entries.Bodies(job(mitsuba_choice, split=split)).mesh(0) for split in ("train", "test")
    )
    assert train.vertices.shape != test.vertices.shape or (train.vertices != test.vertices).any()


# ---- entries ---------------------------------------------------------------------------------


def test_every_entry_of_a_row_is_deformed_and_posed_anew(mitsuba_choice):
    found, decoded = pictures(job(mitsuba_choice), range(4))
    assert len({entry.shape for entry in found}) == 1
    assert len({entry.data for entry in found}) == 4
    assert len({tuple(entry.camera) for entry in found}) == 4
    for coverage, *_ in decoded:
        assert coverage.mean() / 255 >= LEAST_COVERAGE - 1 / 255


def test_an_entry_follows_from_seed_and_index_alone(mitsuba_choice):
    task = job(mitsuba_choice)
    [alone], _ = pictures(task, [3])
    [_, again], _ = pictures(task, [0, 3])
    assert alone.data == again.data and (alone.camera == again.camera).all()
    [other], _ = pictures(job(mitsuba_choice, seed=1), [3])
    assert other.data != alone.data


def test_objects_fill_the_crop_as_widely_as_stated(balls):
    """Balls, whose outline tells how much of the crop they fill; some are cut by its frame."""
    _, decoded = pictures(balls, range(64))
    cut = [bool(c[0].any() or c[-1].any() or c[:, 0].any() or c[:, -1].any()) for c, *_ in decoded]
    across = [
        max(np.ptp(np.nonzero(c)[0]), np.ptp(np.nonzero(c)[1])) / 64
        for (c, *_), is_cut in zip(decoded, cut, strict=True)
        if not is_cut
    ]
    assert 0.05 < np.mean(cut) < 0.4
    assert entries.FILL[0] - 0.03 < min(across) < 0.45 and 0.85 < max(across) <= 1


def test_what_is_too_small_is_drawn_again(balls, monkeypatch):
    posed = iter([0.05, 0.05, 1.0])
    original = entries.framed

    def framed(rng, mesh, size):
        pose, zoom = original(rng, mesh, size), next(posed)
        return dataclasses.replace(pose, camera=pose.camera * [zoom, zoom, 1, 1])

    monkeypatch.setattr(entries, "framed", framed)
    [entry], _ = pictures(balls, [0])
    assert [(f["index"], f["attempt"], f["shape"]) for f in entry.failures] == [
        (0, 0, "procedural-00000"),
        (0, 1, "procedural-00000"),
    ]
    assert all("covers" in failure["error"] for failure in entry.failures)


def test_what_is_always_too_small_ends_the_rendering(balls, monkeypatch):
    monkeypatch.setattr(entries, "LEAST_COVERAGE", 2.0)
    with pytest.raises(RuntimeError, match=r"entry 5 of seed 0 failed 20 times.*--seed"):
        pictures(balls, [5])


# ---- what is held of a G-buffer --------------------------------------------------------------


def test_the_normals_of_a_ball_are_its_own(balls):
    """Of a ball, the normal at a pixel follows from where its centre's ray meets the ball."""
    distance, focal, size = 6.0, 170.0, 64
    camera = np.array([focal, focal, 30.0, 34.0])
    tracer = gbuffer.Tracer(sphere(6), size, entries.QUALITY, packets=True)
    seen = tracer.trace(np.eye(3), np.array([0, 0, -distance]), camera)
    coverage, share, normal, spread = entries.quantised(seen, camera)
    whole = (coverage == 255) & (share == 255)
    assert whole.sum() > 200
    towards = -view_directions(camera, size, size)
    along = -distance * towards[..., 2]
    depth = along - np.sqrt(np.maximum(along**2 - distance**2 + 1, 0))
    expected = depth[..., None] * towards - [0, 0, -distance]
    off = np.linalg.norm(octahedral.decode(normal[0]) - expected, axis=-1)[whole]
    assert np.degrees(off).max() < 1.0 and np.degrees(off).mean() < 0.2
    assert not normal[1][share == 255].any() and not spread[1][share == 255].any()
    # Mirror directions turn twice as fast as normals, fastest at the rim.
    middle = geometry.variance_of(spread[0][34, 30])
    assert middle < geometry.variance_of(spread[0][whole]).max()


@pytest.mark.parametrize("index", range(3))
def test_every_normal_faces_the_viewer(mitsuba_choice, index):
    """Also after decoding, and of the second surfaces, whose codes are coarse."""
    [entry], [(coverage, share, normal, spread)] = pictures(job(mitsuba_choice), [index])
    view = view_directions(entry.camera, 32, 32)
    two = (coverage > 0) & (share < 255)
    assert two.any() and share[coverage > 0].min() > 0 and spread.max() <= geometry.WIDEST
    for codes, there in ((normal[0], coverage > 0), (normal[1], two)):
        cosine = np.sum(octahedral.decode(codes) * view, axis=-1)[there]
        assert cosine.min() > 0.01


def test_grazing_second_surfaces_face_the_viewer_after_decoding():
    """Of a row of pixels, each with a surface in front and a grazing one, in all directions."""
    size = 256
    camera = np.array([5000.0, 5000, 0, 0])
    view = view_directions(camera, size, size)[0].repeat(2, axis=0)
    angle = np.linspace(0, 2 * np.pi, size)
    grazing = np.stack([np.cos(angle), np.sin(angle), np.full(size, 1e-3)], axis=-1)
    normal = np.stack([np.broadcast_to([0.0, 0, 1], (size, 3)), grazing], axis=1).reshape(-1, 3)
    coverage = np.zeros((size, size), np.float32)
    coverage[0] = 1
    pixel, first = np.arange(size).repeat(2), np.arange(0, 2 * size, 2)
    ones = np.ones(size, int)
    held = gbuffer.GBuffer(coverage, normal, view, pixel, first, 0.5 * ones, first, ones)
    encoded = geometry.encode(*entries.quantised(held, camera))
    _, share, codes, _ = geometry.decode(encoded, size)
    assert (share[0] < 255).all()
    for surface, least in enumerate((0.018, 0.03)):  # of 0.02 and 0.05, less what codes lose
        cosine = np.sum(octahedral.decode(codes[surface][0]) * view[::2], axis=-1)
        assert cosine.min() > least


def test_a_pixel_that_is_touched_is_covered():
    """However little: 0 would mean that nothing is there."""
    one = np.zeros((2, 2), np.float32)
    one[0, 1] = 1e-6
    normal, view = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, 1]])
    whole = np.zeros(1, int)
    held = gbuffer.GBuffer(one, normal, view, whole + 1, whole, whole * 0.0, whole, whole + 1)
    coverage, share, codes, _ = entries.quantised(held, np.array([50, 50, 1, 1.0]))
    assert coverage.tolist() == [[0, 1], [0, 0]] and share.tolist() == [[255] * 2] * 2
    assert codes[0, 0, 1].any() and not codes[0, 1].any()
