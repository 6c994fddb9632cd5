"""The light that materials are shown under."""

from lime_keras.optics import environment, shading, studio_light


def test_the_studio_lights_a_white_ball_without_burning_it_out():
    light = studio_light.light()
    assert light.shape == environment.STORED_SHAPE and light.min() == 0
    normals = environment.directions(16, 32).reshape(-1, 3)
    facing = normals[normals[:, 2] > 0]
    diffuse = shading.diffuse(facing, *shading.texels(light))
    assert 0.5 < diffuse.max() < 1.0
    assert not studio_light.light().flags.writeable
