"""Paint in linear light: by Eq. 4 under highlights that stay, and with the mask still true."""

import numpy as np
import pytest

from lime_keras.train.photos import paint

SIZE = 32
CLUTTER = ("_TEXTURED", "_PARTED", "_LABELLED", "_CAMOUFLAGED", "_STUDIO", "_SHADED")


def scene(edge=0.5, level=0.3):
    """A square with a highlight, of partial coverage along its upper side, before grey."""
    mask = np.zeros((SIZE, SIZE, 1), np.float32)
    mask[4:-4, 4:-4] = 1
    mask[4, 4:-4] = edge
    shading = np.broadcast_to(np.linspace(0.2, 0.6, SIZE, dtype=np.float32)[:, None], (SIZE, SIZE))
    albedo = np.float32([0.7, 0.4, 0.2])
    highlight = np.zeros_like(mask)
    highlight[10:14, 10:14] = 3.0
    light = mask * (albedo * shading[..., None] + highlight)
    return {
        "object": light.astype(np.float32),
        "background": np.broadcast_to((1 - mask) * level, light.shape).astype(np.float32),
        "mask": mask,
        "diffuse_shading": shading[..., None].astype(np.float32),
        "diffuse_albedo": albedo,
        "highlight": highlight,
    }


def only(monkeypatch, *names):
    """Switch off all kinds of clutter but these, which are sure."""
    for name in CLUTTER:
        monkeypatch.setattr(paint, name, float(name in names))


def cluttered(seed, one=None):
    one = scene() if one is None else one
    other = np.random.default_rng(9).uniform(0, 1, (SIZE, SIZE, 3)).astype(np.float32)
    return paint.clutter(one, other, np.random.default_rng(seed))


@pytest.mark.parametrize("kind", ["_PRINTED", "_MOTTLED"])
def test_under_a_print_the_light_is_that_of_another_albedo(kind, monkeypatch):
    for name in ("_PRINTED", "_MOTTLED"):
        monkeypatch.setattr(paint, name, float(name == kind))
    before = scene()
    light, marks = paint.prints(before, np.random.default_rng(0))
    inside = before["mask"][..., 0] > 0
    share = before["mask"] * before["diffuse_shading"]
    albedo = (light - before["mask"] * before["highlight"])[inside] / share[inside]
    assert -1e-3 < albedo.min() and albedo.max() < 1.5
    marked = marks[..., 0][inside] == 1
    assert 0.03 < marked.mean() <= (1.0 if kind == "_MOTTLED" else 0.99)
    # Marked wherever the albedo is another.
    changed = np.abs(albedo - before["diffuse_albedo"]).max(-1)
    assert changed[marked].mean() > 0.01 and changed[~marked].max(initial=0) < 1e-5
    assert not marks[~inside].any() and not light[~inside].any()


def test_most_objects_stay_as_they_were():
    before, same = scene(), 0
    for seed in range(200):
        light, marks = paint.prints(before, np.random.default_rng(seed))
        same += light is before["object"] and not marks.any()
    assert abs(same / 200 - (1 - paint._PRINTED) * (1 - paint._MOTTLED)) < 0.12


@pytest.mark.parametrize("kind", ["_TEXTURED", "_PARTED", "_LABELLED"])
def test_only_objects_are_painted(kind, monkeypatch):
    only(monkeypatch, kind)
    before, changed = scene(), 0
    for seed in range(12):
        light, behind = cluttered(seed)
        assert light.dtype == behind.dtype == np.float32 and light.min() >= 0
        np.testing.assert_array_equal(behind, before["background"])
        assert not light[before["mask"][..., 0] == 0].any()
        # No brighter than white, or than the object was.
        assert (light <= np.maximum(before["mask"], before["object"].max(-1, keepdims=True))).all()
        changed += (np.abs(light - before["object"]) > 0.02).any()
    assert changed > 9


@pytest.mark.parametrize("kind", ["_CAMOUFLAGED", "_STUDIO"])
def test_only_backgrounds_are_exchanged(kind, monkeypatch):
    only(monkeypatch, kind)
    before = scene(level=0.1)
    light, behind = cluttered(0, before)
    np.testing.assert_array_equal(light, before["object"])
    outside = before["mask"][..., 0] == 0
    assert not behind[before["mask"][..., 0] == 1].any()
    assert (np.abs(behind - before["background"])[outside] > 0.02).mean() > 0.3
    if kind == "_CAMOUFLAGED":
        own = light[before["mask"][..., 0] == 1].mean(0)
        seen = behind[outside].mean(0)
        assert own @ seen / np.linalg.norm(own) / np.linalg.norm(seen) > 0.999


def test_shadows_darken_all_alike(monkeypatch):
    only(monkeypatch, "_SHADED")
    before, darkest = scene(edge=0.5), []
    for seed in range(8):
        light, behind = cluttered(seed)
        whole, lit = before["object"] + before["background"], light + behind
        share = lit / whole
        assert share.max() <= 1 + 1e-6
        darkest.append(share.min())
    assert min(darkest) < 0.6 and min(darkest) > 0.24**2.2


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_empty_and_full_masks(level):
    one = scene() | {"mask": np.full((SIZE, SIZE, 1), level, np.float32)}
    one["object"] = one["object"] * level
    for seed in range(12):
        for found in (*cluttered(seed, one), *paint.prints(one, np.random.default_rng(seed))):
            assert np.isfinite(found).all() and found.min() >= 0


def test_a_generator_determines_the_paint(monkeypatch):
    monkeypatch.setattr(paint, "_PRINTED", 1.0)
    for found in (cluttered, lambda seed: paint.prints(scene(), np.random.default_rng(seed))):
        one, other, third = (found(seed) for seed in (5, 5, 6))
        assert all(map(np.array_equal, one, other)) and not np.array_equal(one[0], third[0])
