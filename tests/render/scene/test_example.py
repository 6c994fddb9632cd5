"""Rendered examples, as they come back out of a record."""

import numpy as np
import pytest
from render_scenes import photographed, sphere
from sphere_corpus import composed

from lime_keras.data import records
from lime_keras.data.corpus import LOBES
from lime_keras.optics import colour, environment, shading
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.render.scene import gbuffer, lights, sampling
from lime_keras.render.scene.example import render
from lime_keras.render.scene.quality import QUALITIES

SIZE = 64
POSE = sampling.Pose(
    sampling.sample_rotation(np.random.default_rng(0)),
    np.array([0.3, -0.2, -6.0]),
    np.array([130.0, 130.0, 30.0, 28.0]),
)
MATERIAL = BlinnPhong(np.array([0.6, 0.3, 0.1]), 0.4, 35.0, 0.03)
WHITE = BlinnPhong(np.ones(3), 0.0, 35.0, 0.0)
BACKGROUND = np.random.default_rng(1).uniform(size=(SIZE, SIZE, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def tracer(mitsuba_choice):
    return gbuffer.Tracer(sphere(4), SIZE)


@pytest.fixture(scope="module")
def light():
    return lights.prepare("photographed", photographed(128))


@pytest.fixture(scope="module")
def turn(light):
    return sampling.sample_light_rotation(np.random.default_rng(2), light.strong_direction)


def parsed(tracer, light, turn, material=MATERIAL, pose=POSE, lobe="furnace"):
    """An example, encoded as a record and read back."""
    features = render(tracer, light, pose, turn, material, BACKGROUND, lobe=lobe)
    names = {"shape": "sphere", "light": light.name, "seed": 0, "index": 0}
    read = records.parse(records.encode(features | names))
    return {name: tensor.numpy() for name, tensor in read.items()}


@pytest.fixture(scope="module")
def example(tracer, light, turn):
    return parsed(tracer, light, turn)


def recomposed(example):
    return colour.linear_to_srgb(np.clip(composed(example), 0, 1))


@pytest.mark.parametrize("lobe", LOBES)
def test_the_layers_recompose_to_the_image(tracer, light, turn, lobe):
    example = parsed(tracer, light, turn, lobe=lobe)
    whole = example["mask"][..., 0] == 1
    assert whole.sum() > 500
    difference = np.abs(recomposed(example) - example["image"])[whole]
    assert difference.max() <= 1.01 / 255
    assert 0.05 < example["image"][whole].mean() < 0.95


def test_outside_the_mask_lies_the_background(example):
    outside = example["mask"][..., 0] == 0
    assert outside.sum() > 500
    difference = np.abs(example["image"] - BACKGROUND)[outside]
    assert difference.max() <= 0.51 / 255


@pytest.mark.parametrize("specular_albedo", [0.4, 1.0])
def test_the_edge_mixes_linear_light_and_the_sensor_clips_the_mixture(
    tracer, light, turn, specular_albedo
):
    material = BlinnPhong(np.ones(3), specular_albedo, 3.0, 0.05)
    example = parsed(tracer, light, turn, material)
    mask = example["mask"]
    edge = (mask[..., 0] > 0) & (mask[..., 0] < 1)
    inside = composed(example)
    assert (inside[edge] > 1).mean() > 0.02  # some are bright enough to outshine the background
    expected = mask * inside + (1 - mask) * colour.srgb_to_linear(BACKGROUND)
    expected = colour.linear_to_srgb(np.clip(expected, 0, 1))
    difference = np.abs(expected - example["image"])[edge]
    assert edge.sum() > 50 and difference.max() <= 3 / 255


def test_reference_quality_sees_the_same_scene(light, turn, tracer, example):
    reference = QUALITIES["reference"]
    fine_light = lights.prepare("photographed", photographed(128), quality=reference)
    fine = parsed(gbuffer.Tracer(sphere(4), SIZE, reference), fine_light, turn)
    both = (fine["mask"][..., 0] == 1) & (example["mask"][..., 0] == 1)
    for name, median, most in (
        ("diffuse_shading", 0.01, 0.05),
        ("specular_shading", 0.02, 0.2),
        ("mirror", 0.05, 1.0),  # a pixel of so small an image sees much of a map at once
    ):
        errors = np.abs(example[name] - fine[name])[both] / np.maximum(fine[name][both], 1e-3)
        assert np.median(errors) < median and np.percentile(errors, 99) < most, name


def test_layers_are_black_outside_and_normals_unit_inside(example):
    inside = example["mask"] > 0
    for name in ("diffuse_shading", "specular_shading", "mirror"):
        assert not example[name][~inside].any()
    length = np.linalg.norm(example["normal"], axis=-1)
    np.testing.assert_allclose(length, inside[..., 0], atol=2e-3)


def test_the_stored_light_shades_the_stored_normals(example):
    """The environment is in camera space: from it, normals and camera, D and M follow anew."""
    whole = example["mask"][..., 0] == 1
    normal, radiance = example["normal"][whole], example["environment"][..., 0]
    view = shading.view_directions(example["camera"], SIZE, SIZE)[whole]
    diffuse = shading.diffuse(normal, *shading.texels(radiance))
    stored = example["diffuse_shading"][whole][:, 0]
    np.testing.assert_allclose(diffuse, stored, rtol=0.05, atol=0.01)
    specular = shading.specular(
        normal, view.astype(np.float32), MATERIAL.exponent, *shading.texels(radiance)
    )
    stored = example["specular_shading"][whole][:, 0]
    errors = np.abs(specular - stored) / (stored + 0.05 * stored.mean())
    assert np.median(errors) < 0.03
    mirror = environment.lookup(radiance, shading.reflect(normal, view))
    stored = example["mirror"][whole][:, 0]
    assert np.corrcoef(np.log(mirror), np.log(stored))[0, 1] > 0.85


def test_the_stored_light_keeps_its_mean(example):
    mean = environment.spherical_mean(example["environment"][..., 0])
    assert mean == pytest.approx(lights.MEAN_RADIANCE, rel=0.02)


def test_a_white_sphere_in_a_white_world_is_white(tracer):
    even = lights.prepare("even", np.ones((64, 128)), 1.0)
    example = parsed(tracer, even, np.eye(3), WHITE)
    inside = example["mask"][..., 0] > 0
    np.testing.assert_allclose(example["mirror"][inside], 1, atol=1e-3)
    np.testing.assert_allclose(example["diffuse_shading"][inside], 1, atol=2e-3)
    np.testing.assert_allclose(example["environment"], 1, atol=1e-3)
    whole = example["mask"][..., 0] == 1
    np.testing.assert_allclose(example["image"][whole], 1, atol=1.01 / 255)


@pytest.mark.parametrize("exponent", [0.0, 1000.0])
def test_the_printed_lobe_changes_s_alone_and_half_floats_hold_it(tracer, light, turn, exponent):
    """At s = 1000 the printed S is 125 times smaller: half floats still have their 11 digits."""
    material = BlinnPhong(np.zeros(3), 0.9, exponent, 0.0)
    furnace, printed = (parsed(tracer, light, turn, material, lobe=lobe) for lobe in LOBES)
    for name in ("mask", "normal", "diffuse_shading", "mirror", "environment"):
        np.testing.assert_array_equal(printed[name], furnace[name])
    expected = furnace["specular_shading"] * shading.lobe_factor(exponent, "printed")
    np.testing.assert_allclose(printed["specular_shading"], expected, rtol=1e-3, atol=2**-25)


def test_the_material_and_the_camera_are_stored(example):
    np.testing.assert_allclose(example["camera"], POSE.camera)
    np.testing.assert_allclose(example["diffuse_albedo"], MATERIAL.diffuse_albedo, rtol=1e-6)
    stored = [example[name] for name in ("specular_albedo", "shininess", "ambient")]
    np.testing.assert_allclose(stored, [0.4, 35.0, 0.03], rtol=1e-6)


@pytest.mark.parametrize("translation", [(0.3, -0.2, -60.0), (40.0, 0.0, -6.0)])
def test_an_object_too_small_or_out_of_sight_is_refused(tracer, light, turn, translation):
    pose = sampling.Pose(POSE.rotation, np.array(translation), POSE.camera)
    with pytest.raises(ValueError, match=r"the object covers \d\.\d% of the image"):
        render(tracer, light, pose, turn, MATERIAL, BACKGROUND)
