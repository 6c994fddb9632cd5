"""The G-buffer of a sphere in closed form, and of other shapes by their projected vertices."""

import dataclasses

import mitsuba
import numpy as np
import pytest
from render_scenes import sphere

from lime_keras.optics.shading import reflect, view_directions
from lime_keras.render.scene import gbuffer, sampling
from lime_keras.render.scene.quality import FAST, QUALITIES
from lime_keras.render.shapes import endless, meshes

SIZE = 64
CENTRED = np.array([0.0, 0.0, -6.0]), np.array([150.0, 150.0, 32.0, 32.0])
PLACES = [
    CENTRED,
    (np.array([0.7, -0.4, -6.0]), np.array([140.0, 140.0, 17.0, 22.5])),
    (np.array([-1.5, 1.0, -5.0]), np.array([95.0, 95.0, 60.0, 50.0])),
]
"""Translations and cameras that keep the unit sphere in the image."""


EVEN = dataclasses.replace(FAST, refined=FAST.subsamples)
"""The same number of samples in every pixel, one of them in its centre."""


@pytest.fixture(scope="module")
def ball(mitsuba_choice):
    return gbuffer.Tracer(sphere(), SIZE, EVEN)


@pytest.fixture(scope="module")
def refined_ball(mitsuba_choice):
    return gbuffer.Tracer(sphere(), SIZE, FAST)


def look(tracer, place, seed=0):
    rotation = sampling.sample_rotation(np.random.default_rng(seed))
    return tracer.trace(rotation, *place)


def projected_area(centre, focal):
    """In pixels, of the unit sphere: the ellipse that its tangent cone cuts out of the image."""
    squared = centre @ centre - 1
    return np.pi * focal**2 * np.sqrt(squared) / (centre[2] ** 2 - 1) ** 1.5


@pytest.mark.parametrize("place", PLACES)
def test_coverage_of_a_sphere_is_its_projected_area(ball, place):
    centre, camera = place
    coverage = look(ball, place).coverage
    np.testing.assert_allclose(coverage.sum(), projected_area(centre, camera[0]), rtol=0.01)


@pytest.mark.parametrize("place", PLACES)
def test_view_directions_are_those_of_the_camera(ball, place):
    seen = look(ball, place)
    expected = view_directions(place[1], SIZE, SIZE).reshape(-1, 3)[seen.covered_pixels]
    whole = seen.coverage.ravel()[seen.covered_pixels] == 1
    assert whole.sum() > 500
    np.testing.assert_allclose(seen.view[seen.central][whole], expected[whole], atol=2e-5)


@pytest.mark.parametrize("place", PLACES)
def test_normals_of_a_sphere_are_its_radii(ball, place):
    seen, centre = look(ball, place), place[0]
    away = -seen.view.astype(float) @ centre  # along the ray to the sphere's middle
    inside = away**2 - (centre @ centre - 1)  # half the chord, squared
    chosen = inside > 0.05
    point = (away - np.sqrt(np.where(chosen, inside, 0)))[:, None] * -seen.view - centre
    np.testing.assert_allclose(seen.normal[chosen], point[chosen], atol=5e-3)


def test_edges_are_covered_in_part_and_the_middle_wholly(ball):
    coverage = look(ball, CENTRED).coverage
    assert coverage.dtype == np.float32
    assert coverage[32, 32] == 1 and coverage[0, 0] == 0
    partly = coverage[(coverage > 0) & (coverage < 1)]
    samples = FAST.subsamples**2
    np.testing.assert_allclose(partly * samples, np.round(partly * samples), atol=1e-5)
    assert len(np.unique(partly)) > samples / 2


def test_samples_average_to_their_pixels_and_land_in_them(ball):
    seen = look(ball, PLACES[1])
    np.testing.assert_allclose(seen.pixel_means(seen.pixel.astype(float)), seen.covered_pixels)
    image = seen.image(seen.covered_pixels + 1.0)
    expected = np.where(seen.coverage > 0, np.arange(SIZE**2).reshape(SIZE, SIZE) + 1, 0)
    np.testing.assert_array_equal(image, expected[..., None])
    counts = np.bincount(seen.pixel, minlength=SIZE**2).reshape(SIZE, SIZE)
    np.testing.assert_allclose(seen.coverage * FAST.subsamples**2, counts, rtol=1e-5)


def test_pixel_means_are_plain_means(ball):
    seen = look(ball, CENTRED)
    values = np.random.default_rng(0).normal(size=len(seen.pixel))
    pixels = seen.covered_pixels[::97]
    expected = [values[seen.pixel == pixel].mean() for pixel in pixels]
    np.testing.assert_allclose(seen.pixel_means(values)[::97], expected, rtol=1e-5)


def test_the_central_sample_is_the_one_nearest_the_pixels_centre(ball):
    """Where the pixel is covered, it is the ray through the centre; else the nearest that hit."""
    seen = look(ball, PLACES[1])
    rays = view_directions(PLACES[1][1], SIZE, SIZE).reshape(-1, 3)[seen.pixel]
    away = np.linalg.norm(seen.view - rays, axis=1)
    nearest = np.full(SIZE**2, np.inf)
    np.minimum.at(nearest, seen.pixel, away)
    np.testing.assert_allclose(away[seen.central], nearest[seen.covered_pixels], atol=1e-4)
    assert (np.diff(seen.covered_pixels) > 0).all()


@pytest.mark.parametrize("quality", [*QUALITIES.values(), EVEN], ids=[*QUALITIES, "even"])
@pytest.mark.parametrize("most", [-1.0, 1e-3, 2.0])
def test_lobe_samples_stand_for_all_samples_of_their_pixels(mitsuba_choice, quality, most):
    seen = look(gbuffer.Tracer(sphere(), SIZE, quality), PLACES[0])
    whole = np.bincount(seen.pixel[seen.cells], seen.cell_weights, SIZE**2)
    full = seen.coverage.ravel() == 1
    np.testing.assert_allclose(whole[full], np.bincount(seen.pixel, minlength=SIZE**2)[full])
    assert np.bincount(seen.pixel[seen.cells]).max() == quality.cells**2
    chosen, weights = seen.lobe_samples(most)
    assert len(chosen) == len(weights) == len(set(chosen.tolist()))
    assert set(seen.pixel[chosen].tolist()) == set(seen.covered_pixels.tolist())
    if most == -1:
        assert len(chosen) == len(seen.cells)
    if most == 2:
        np.testing.assert_array_equal(np.sort(chosen), np.sort(seen.central))
    # A quantity that is linear over the image has nearly the same mean over either.
    x = seen.view[:, 0] / seen.view[:, 2]
    inside = seen.coverage.ravel()[seen.covered_pixels] == 1
    means = seen.pixel_means(x)[inside], seen.pixel_means(x[chosen], chosen, weights)[inside]
    pixel = 1 / PLACES[0][1][0]
    # Of 6 × 6 samples none is in the middle.
    np.testing.assert_allclose(*means, atol=(0.09 if most == 2 else 0.02) * pixel)


def test_edges_and_bent_surfaces_are_sampled_finely_and_the_rest_coarsely(refined_ball):
    seen = look(refined_ball, PLACES[1])
    counts = np.bincount(seen.pixel, minlength=SIZE**2)[seen.covered_pixels]
    coverage = seen.coverage.ravel()[seen.covered_pixels]
    edge = coverage < 1
    np.testing.assert_array_equal(counts[edge], np.round(coverage[edge] * FAST.refined**2))
    assert set(counts[~edge].tolist()) == {FAST.subsamples**2, FAST.refined**2}
    fine = counts[~edge] == FAST.refined**2
    # On a sphere the spread grows towards the silhouette.
    assert seen.spread[~edge][~fine].max() <= FAST.rough_above
    assert seen.spread[~edge][fine].mean() > FAST.rough_above
    assert np.unique(seen.covered_pixels).size == seen.covered_pixels.size


def test_the_spread_is_the_variance_of_mirror_directions(ball):
    seen = look(ball, PLACES[1])
    mirrored = reflect(seen.normal.astype(float), seen.view.astype(float))
    for k in range(0, len(seen.central), 211):
        own = mirrored[seen.pixel == seen.covered_pixels[k]]
        expected = np.mean(np.sum((own - own.mean(axis=0)) ** 2, axis=1))
        np.testing.assert_allclose(seen.spread[k], expected, atol=2e-6)


def test_coverage_converges_to_the_projected_area(refined_ball, ball, mitsuba_choice):
    """And every pixel's to its own: finer samples change it by less than a coarse one's share."""
    place = PLACES[1]
    area = projected_area(place[0], place[1][0])
    reference = gbuffer.Tracer(sphere(), SIZE, QUALITIES["reference"])
    fine, middle, coarse = (
        look(tracer, place).coverage for tracer in (reference, refined_ball, ball)
    )
    np.testing.assert_allclose([fine.sum(), middle.sum()], area, rtol=2e-3)
    assert np.abs(middle - fine).mean() < np.abs(coarse - fine).mean() / 1.5
    assert np.abs(middle - fine).max() < 0.15


def test_normals_through_the_centre_are_the_same_however_fine(ball, mitsuba_choice):
    reference = gbuffer.Tracer(sphere(), SIZE, QUALITIES["reference"])
    looks = [look(tracer, PLACES[1]) for tracer in (reference, ball)]
    both = np.intersect1d(*(seen.covered_pixels for seen in looks))
    normals = [s.image(s.normal[s.central]).reshape(-1, 3)[both] for s in looks]
    assert np.median(np.abs(normals[0] - normals[1])) < 1e-6


def test_a_part_keeps_only_its_pixels(refined_ball):
    seen = look(refined_ball, PLACES[1])
    kept = np.random.default_rng(0).random(SIZE**2) < 0.3
    part = seen.part(kept)
    inside = kept[seen.covered_pixels]
    np.testing.assert_array_equal(part.covered_pixels, seen.covered_pixels[inside])
    np.testing.assert_array_equal(part.spread, seen.spread[inside])
    x = seen.normal[:, 0]
    np.testing.assert_array_equal(part.pixel_means(part.normal[:, 0]), seen.pixel_means(x)[inside])
    chosen, weights = seen.lobe_samples(1e-3)
    few, their_weights = part.lobe_samples(1e-3)
    whole = seen.pixel_means(x[chosen], chosen, weights)[inside]
    np.testing.assert_allclose(part.pixel_means(part.normal[few, 0], few, their_weights), whole)


def test_nothing_in_sight_is_an_empty_buffer(refined_ball):
    rotation = np.eye(3)
    seen = refined_ball.trace(rotation, np.array([40.0, 0.0, -6.0]), CENTRED[1])
    assert not seen.coverage.any() and len(seen.pixel) == len(seen.central) == 0
    assert seen.pixel_means(np.zeros(0)).shape == (0,)


def test_an_object_around_the_camera_is_seen_from_inside(refined_ball):
    seen = refined_ball.trace(np.eye(3), np.array([0.0, 0.0, -0.3]), CENTRED[1])
    assert (seen.coverage == 1).all()
    assert (np.sum(seen.normal * seen.view, axis=1) > 0).all()


@pytest.mark.parametrize(
    ("shift", "expected"), [((0.5, 0, 0), (32, 41.4)), ((0, 0.5, 0), (22.6, 32))]
)
def test_up_is_up_and_right_is_right(ball, shift, expected):
    camera = np.array([110.0, 110.0, 32.0, 32.0])
    rows, columns = np.nonzero(look(ball, (CENTRED[0] + shift, camera)).coverage)
    np.testing.assert_allclose([rows.mean() + 0.5, columns.mean() + 0.5], expected, atol=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_a_posed_shape_covers_the_box_of_its_projected_vertices(mitsuba_choice, seed):
    rng = np.random.default_rng(seed)
    mesh = endless.procedural(rng)
    pose = sampling.sample_pose(rng, mesh.vertices, SIZE)
    seen = gbuffer.Tracer(mesh, SIZE).trace(pose.rotation, pose.translation, pose.camera)
    fx, fy, cx, cy = pose.camera
    x, y, z = pose.rotation @ mesh.vertices.T + pose.translation[:, None]
    column, row = cx - fx * x / z, cy + fy * y / z
    rows, columns = np.nonzero(seen.coverage)
    found = [rows.min(), rows.max() + 1, columns.min(), columns.max() + 1]
    np.testing.assert_allclose(found, [row.min(), row.max(), column.min(), column.max()], atol=1.4)


def test_a_tracer_remembers_nothing_of_the_last_look(ball):
    first = look(ball, PLACES[1])
    look(ball, PLACES[2])
    again = look(ball, PLACES[1])
    np.testing.assert_array_equal(first.normal, again.normal)
    np.testing.assert_array_equal(first.coverage, again.coverage)


@pytest.mark.parametrize("garbled", [False, True])
def test_every_normal_faces_the_viewer(mitsuba_choice, garbled):
    rng = np.random.default_rng(3)
    mesh = endless.procedural(rng)
    if garbled:
        noise = rng.normal(size=mesh.normals.shape).astype(np.float32)
        noise /= np.linalg.norm(noise, axis=1, keepdims=True)
        mesh = meshes.Mesh(mesh.vertices, mesh.faces, noise)
    seen = look(gbuffer.Tracer(mesh, SIZE), CENTRED)
    assert (np.sum(seen.normal * seen.view, axis=1) > 0.015).all()
    np.testing.assert_allclose(np.linalg.norm(seen.normal, axis=1), 1, atol=1e-5)


def test_both_variants_see_the_same(ball, mitsuba_choice):
    if mitsuba_choice.variant == "scalar_rgb":
        pytest.skip("only one variant works here")
    fast = look(ball, PLACES[1])
    mitsuba.set_variant("scalar_rgb")
    try:
        slow = look(gbuffer.Tracer(sphere(), SIZE, EVEN), PLACES[1])
    finally:
        mitsuba.set_variant(mitsuba_choice.variant)
    assert np.abs(fast.coverage - slow.coverage).sum() < 2
    both = np.intersect1d(fast.covered_pixels, slow.covered_pixels)
    views = [s.image(s.normal[s.central]).reshape(-1, 3)[both] for s in (fast, slow)]
    np.testing.assert_allclose(np.median(np.abs(views[0] - views[1])), 0, atol=1e-5)
    assert (np.abs(views[0] - views[1]).max(axis=1) < 1e-3).mean() > 0.99


@pytest.mark.parametrize("place", PLACES)
def test_pixels_without_a_triangle_are_left_out_and_change_nothing(
    mitsuba_choice, place, monkeypatch
):
    tracer = gbuffer.Tracer(sphere(), SIZE, FAST)
    assert 0.1 < tracer._in_sight(np.eye(3), *place).mean() < 1
    found = look(tracer, place)
    monkeypatch.setattr(tracer, "_in_sight", lambda *_: np.ones(SIZE**2, bool))
    everywhere = look(tracer, place)
    for field in dataclasses.fields(gbuffer.GBuffer):
        np.testing.assert_array_equal(
            getattr(found, field.name), getattr(everywhere, field.name), field.name
        )


def test_rays_in_packets_hit_the_same_surface(mitsuba_choice):
    alone = look(gbuffer.Tracer(sphere(), SIZE, FAST), PLACES[0])
    together = look(gbuffer.Tracer(sphere(), SIZE, FAST, packets=True), PLACES[0])
    np.testing.assert_array_equal(together.coverage, alone.coverage)
    np.testing.assert_allclose(together.normal, alone.normal, atol=1e-3)
