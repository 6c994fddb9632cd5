"""The light from the layers: known lights come back, and nothing that is missing breaks it."""

import dataclasses
import math

import illumination as benchmark
import numpy as np
import pytest

from lime_keras.lighting import illumination
from lime_keras.material import Material
from lime_keras.optics import environment, shading

SIZE = 96
SHAPE = environment.STORED_SHAPE


def _ball(size=SIZE):
    """Normals `(S, S, 3)`, views and mask of a ball; pixels turned from the viewer left out."""
    camera = np.array([3.0 * size, 3.0 * size, size / 2, size / 2])
    view = shading.view_directions(camera, size, size)
    down, across = (np.mgrid[:size, :size] + 0.5) * (2 / size) - 1
    z = np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    normal = np.stack([across, -down, z], axis=-1)
    inside = (np.hypot(across, down) < 1) & (np.sum(normal * view, axis=-1) > 0.05)
    return normal * inside[..., None], view, inside[..., None].astype(np.float64)


def _layers(radiance, normal, view, mask):
    """M and D `(S, S, 1)` of what is seen under a map in camera space."""
    inside = mask[..., 0] > 0
    layers = []
    for values in (
        environment.lookup(radiance, shading.reflect(normal[inside], view[inside])),
        shading.diffuse(normal[inside], *shading.texels(radiance)),
    ):
        layer = np.zeros(mask.shape)
        layer[inside, 0] = values
        layers.append(layer)
    return layers


def _seen(radiance):
    """What is observed of a ball under a map in camera space: normals, views, M, D and mask."""
    normal, view, mask = _ball()
    return normal, view, *_layers(radiance, normal, view, mask), mask


def _observed(radiance):
    return illumination.observe(*_seen(radiance))


def _lit(light, normal, mask):
    """The mean D of a ball under a light that was found."""
    return np.mean(shading.diffuse(normal[mask[..., 0] > 0], *shading.texels(light)))


def _smooth_light(seed=0):
    """A light without detail below 10°, and far from even."""
    rng = np.random.default_rng(seed)
    return environment.blur(rng.exponential(size=SHAPE) ** 3, math.radians(10)) + 0.05


def _unknown():
    return np.full((SIZE, SIZE, 1), np.nan)


def test_a_mirror_ball_gives_back_what_it_mirrors():
    truth = _smooth_light()
    evidence = _observed(truth)
    found, seen = illumination.estimate(evidence), benchmark.is_observed(evidence)
    assert found.shape == SHAPE
    assert np.sum(environment.solid_angles(*SHAPE)[seen]) > 0.85 * 4 * np.pi
    assert np.median(np.abs(found / truth - 1)[seen]) < 0.03
    assert np.quantile(np.abs(found / truth - 1)[seen], 0.95) < 0.2


@pytest.mark.parametrize("row, column", [(20, 40), (40, 90), (5, 64)])
def test_a_lamp_is_found_where_it_is_with_its_energy(row, column):
    truth = np.full(SHAPE, 0.2)
    truth[row - 1 : row + 2, column - 2 : column + 2] = 60.0
    found = illumination.estimate(_observed(truth))
    solid_angle = environment.solid_angles(*SHAPE)
    directions = environment.directions(*SHAPE)
    lamp = np.argmax(truth * solid_angle)
    brightest = directions.reshape(-1, 3)[np.argmax(found)]
    assert brightest @ directions.reshape(-1, 3)[lamp] > math.cos(math.radians(6))
    near = directions @ directions.reshape(-1, 3)[lamp] > math.cos(math.radians(15))
    energy, expected = (np.sum((light * solid_angle)[near]) for light in (found, truth))
    assert energy == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("level", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("known", ["both", "mirror", "diffuse"])
def test_a_furnace_gives_a_furnace(level, known):
    normal, view, mask = _ball()
    even = np.full(mask.shape, level)
    mirror = _unknown() if known == "diffuse" else even
    diffuse = _unknown() if known == "mirror" else even
    evidence = illumination.observe(normal, view, mirror, diffuse, mask)
    assert illumination.estimate(evidence) == pytest.approx(level, rel=1e-5)


@pytest.mark.parametrize("direction", [(0.6, 0.0, 0.8), (0, 1, 0.0), (-0.7, -0.5, 0.5), (0, 0, 1)])
def test_the_direction_of_a_cosine_lobe_from_d_alone(direction):
    towards = np.array(direction) / np.linalg.norm(direction)
    truth = np.maximum(environment.directions(*SHAPE) @ towards, 0)
    normal, view, _, diffuse, mask = _seen(truth)
    evidence = illumination.observe(normal, view, _unknown(), diffuse, mask)
    found = illumination.estimate(evidence)
    moment = np.einsum(
        "hw,hwc->c", found * environment.solid_angles(*SHAPE), environment.directions(*SHAPE)
    )
    # Normals that face the viewer hardly tell front from back, where the ridge says even light.
    assert moment @ towards / np.linalg.norm(moment) > math.cos(math.radians(25))
    assert found.min() >= 0


def test_d_adds_the_light_that_is_not_mirrored():
    """With the left half of the mirror image unknown, its lamp is still known from D."""
    truth = 0.2 + 3 * np.maximum(environment.directions(*SHAPE) @ np.array([-0.8, 0, 0.6]), 0) ** 4
    normal, view, mirror, diffuse, mask = _seen(truth)
    mirror[normal[..., 0] < 0.15] = np.nan
    found = illumination.estimate(illumination.observe(normal, view, mirror, diffuse, mask))
    lit = shading.diffuse(normal[mask[..., 0] > 0], *shading.texels(found))
    assert np.mean(np.abs(lit - diffuse[mask > 0])) < 0.05 * np.mean(diffuse[mask > 0])


def test_light_is_not_counted_twice():
    """The object lit by what was found has the D that was seen."""
    for seed in range(3):
        normal, view, mirror, diffuse, mask = _seen(_smooth_light(seed))
        found = illumination.estimate(illumination.observe(normal, view, mirror, diffuse, mask))
        assert _lit(found, normal, mask) == pytest.approx(np.mean(diffuse[mask > 0]), rel=0.02)


@pytest.mark.parametrize("level", [0.25, 1.0])
def test_as_printed_a_furnace_counts_twice_where_m_shows_it(level):
    """Section 7 adds M's map and the harmonics of D: what both show is twice as bright."""
    evidence = _observed(np.full(SHAPE, level))
    light = benchmark.as_printed(evidence)
    shown = evidence.mirror_weight > 0
    np.testing.assert_allclose(light[shown], 2 * level, rtol=0.02)
    np.testing.assert_allclose(light[~shown], level, rtol=0.02)
    np.testing.assert_allclose(illumination.estimate(evidence), level, rtol=0.02)


def test_as_printed_d_alone_and_m_alone_are_finite():
    evidence = _observed(_smooth_light())
    nothing = np.zeros_like(evidence.mirror)
    of_d = dataclasses.replace(evidence, mirror=nothing, mirror_weight=nothing)
    none = np.zeros_like(evidence.diffuse)
    of_m = dataclasses.replace(evidence, diffuse=none, diffuse_weight=none)
    both = benchmark.as_printed(evidence)
    apart = benchmark.as_printed(of_d), benchmark.as_printed(of_m)
    assert np.isfinite(both).all() and (both >= 0).all()
    # Only harmonics below 0 are cut, so the sum is that of its parts.
    assert np.mean(np.isclose(both, sum(apart), rtol=1e-6, atol=1e-9)) > 0.9


def test_a_black_mirror_image_leaves_the_light_of_d():
    """What a network finds in a dull object: no reflection, which is no proof of darkness."""
    normal, view, _, diffuse, mask = _seen(_smooth_light())
    evidence = illumination.observe(normal, view, np.zeros(mask.shape), diffuse, mask)
    found = illumination.estimate(evidence)
    assert _lit(found, normal, mask) == pytest.approx(np.mean(diffuse[mask > 0]), rel=0.05)


def test_the_mask_leaves_out_what_is_not_the_object():
    normal, view, mirror, diffuse, mask = _seen(_smooth_light())
    half = mask * (np.arange(SIZE)[None, :, None] < SIZE // 2)
    expected = illumination.observe(normal, view, mirror, diffuse, half)
    spoilt = [np.where(half > 0, layer, 1e6) for layer in (mirror, diffuse)]
    found = illumination.observe(normal, view, *spoilt, half)
    assert found.mirror == pytest.approx(expected.mirror)
    assert found.diffuse == pytest.approx(expected.diffuse)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_unknown_normals_count_nothing(value):
    normal, view, *layers, mask = _seen(_smooth_light())
    hole = np.arange(SIZE)[:, None, None] < SIZE // 3
    expected = illumination.observe(normal, view, *layers, mask * ~hole)
    found = illumination.observe(np.where(hole, value, normal), view, *layers, mask)
    assert found.mirror == pytest.approx(expected.mirror)
    assert found.diffuse_weight == pytest.approx(expected.diffuse_weight)


def test_normals_need_not_be_exactly_unit():
    normal, view, *layers, mask = _seen(_smooth_light())
    rng = np.random.default_rng(0)
    scaled = normal * rng.uniform(0.7, 1.3, (SIZE, SIZE, 1))
    expected = illumination.observe(normal, view, *layers, mask)
    assert illumination.observe(scaled, view, *layers, mask).mirror == pytest.approx(
        expected.mirror
    )


@pytest.mark.parametrize("pixels", [1, 2, 50])
@pytest.mark.parametrize("known", ["both", "mirror", "diffuse"])
def test_few_pixels_and_equal_normals_give_a_plain_finite_light(pixels, known):
    """One pixel knows little: the light stays near the even one that explains it."""
    normal = np.tile([0.0, 0.6, 0.8], (1, pixels, 1))
    view = np.tile([0.0, 0.0, 1.0], (1, pixels, 1))
    layer = np.full((1, pixels, 1), 0.7)
    blank = np.full_like(layer, np.nan)
    mirror, diffuse = (blank if known == other else layer for other in ("diffuse", "mirror"))
    evidence = illumination.observe(normal, view, mirror, diffuse, np.ones_like(layer))
    assert illumination.estimate(evidence) == pytest.approx(0.7, rel=1e-5)


def test_one_bright_pixel_beside_a_dark_one():
    normal = np.array([[[0.0, 0.6, 0.8], [0.6, 0.0, 0.8]]])
    view = np.tile([0.0, 0.0, 1.0], (1, 2, 1))
    layer = np.array([[[1e4], [1e-4]]])
    light = illumination.estimate(illumination.observe(normal, view, layer, layer, layer * 0 + 1))
    assert np.all(np.isfinite(light)) and light.min() >= 0 and light.max() < 1e6


def test_grazing_pixels_alone_are_finite():
    normal, view, *layers, mask = _seen(_smooth_light())
    rim = mask * (np.sum(normal * view, axis=-1, keepdims=True) < 0.15)
    light = illumination.estimate(illumination.observe(normal, view, *layers, rim))
    assert np.all(np.isfinite(light)) and light.min() >= 0


def test_no_light_at_all_is_black():
    assert not illumination.estimate(_observed(np.zeros(SHAPE))).any()


@pytest.mark.parametrize("what", ["mask", "normal", "layers"])
def test_nothing_seen_is_told(what):
    normal, view, mask = _ball()
    layer = np.ones(mask.shape)
    if what == "mask":
        mask = np.zeros_like(mask)
    elif what == "normal":
        normal = np.zeros_like(normal)
    else:
        layer = _unknown()
    with pytest.raises(ValueError, match="no pixel shows the light"):
        illumination.estimate(illumination.observe(normal, view, layer, layer, mask))


@pytest.mark.parametrize(
    "change, mend",
    [
        ({"normal": lambda n: n[1:]}, "size of the mask"),
        ({"normal": lambda n: n * 3}, "normalise"),
        ({"normal": lambda n: n * [1, 1, -1]}, "flip z"),
        ({"normal": lambda n: n * np.where(np.arange(SIZE) % 5 < 3, -1, 1)[:, None]}, "60% of the"),
        ({"mirror": lambda m: m - 2}, "at least 0"),
        ({"diffuse_shading": lambda d: d * np.inf}, "finite"),
        ({"mask": lambda m: m * 255}, "255"),
        ({"mask": lambda m: m[..., 0]}, r"expected \(96, 96, 1\)"),
        ({"mask": lambda m: m * np.nan}, "255"),
    ],
)
def test_what_cannot_be_is_refused(change, mend):
    normal, view, mask = _ball()
    layer = np.ones(mask.shape)
    given = {"normal": normal, "view": view, "mirror": layer, "diffuse_shading": layer}
    given["mask"] = mask
    for name, spoil in change.items():
        given[name] = spoil(given[name])
    with pytest.raises(ValueError, match=mend):
        illumination.observe(**given)


def test_harmonics_are_orthonormal():
    basis = illumination.harmonics(environment.directions(*SHAPE)).reshape(-1, 9)
    weighted = basis * environment.solid_angles(*SHAPE).reshape(-1, 1)
    assert basis.T @ weighted == pytest.approx(np.eye(9), abs=5e-3)


def test_an_estimates_layers_show_the_light():
    normal, _, mask = _ball()
    view = shading.view_directions(shading.assumed_camera(SIZE, SIZE), SIZE, SIZE)
    mask = mask * (np.sum(normal * view, axis=-1, keepdims=True) > 0.05)
    mirror, diffuse = _layers(_smooth_light(), normal, view, mask)
    albedo = np.array([0.5, 0.3, 0.1])
    layers = {"mask": mask, "mirror": mirror, "diffuse": diffuse * albedo}
    found = illumination.from_material(Material(albedo, 0.3, 20.0, layers=layers), normal)
    expected = illumination.observe(normal, view, mirror, diffuse, mask)
    assert found.mirror == pytest.approx(expected.mirror)
    assert found.diffuse == pytest.approx(expected.diffuse)
    for lacking in (Material(albedo), Material(layers=layers)):
        with pytest.raises(ValueError, match="lacks"):
            illumination.from_material(lacking, normal)
