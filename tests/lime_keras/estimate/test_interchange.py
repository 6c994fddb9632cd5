"""Materials as other tools read them."""

import json
import math
import os
import shutil
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh
from trimesh.exchange.obj import parse_mtl

from lime_keras.estimate import interchange
from lime_keras.material import Material
from lime_keras.optics import colour, environment, shading, studio_light

MATERIALS = {
    "usual": ([0.3, 0.2, 0.1], 0.4, 100.0),
    "matt": ([0.5, 0.6, 0.7], 0.0, 1.0),
    "mirror": ([0.0, 0.0, 0.0], 1.0, 1000.0),
    "bright": ([1.0, 1.0, 1.0], 1.0, 10.0),
}


def material(diffuse, specular, exponent):
    return Material(
        diffuse_albedo=np.array(diffuse, np.float32), specular_albedo=specular, exponent=exponent
    )


@pytest.fixture(params=MATERIALS.values(), ids=MATERIALS)
def numbers(request):
    return request.param


def test_mtl_is_read_by_another_tool(numbers):
    diffuse, specular, exponent = numbers
    found = parse_mtl(interchange.wavefront(material(*numbers), "my  vase"))
    assert list(found) == ["my_vase"]
    found = found["my_vase"]
    np.testing.assert_allclose(found["kd"], diffuse, atol=1e-6)
    np.testing.assert_allclose(found["ks"], [specular] * 3, atol=1e-6)
    np.testing.assert_allclose(found["ns"], [exponent], rtol=1e-4)


def test_mtl_tells_the_height_of_the_highlight(numbers):
    """The comment's Ks, by MTL's own formula for a light of irradiance 1: m_s · S of Eq. 3."""
    _, specular, exponent = numbers
    comment = interchange.wavefront(material(*numbers), "vase").splitlines()[1]
    towards = np.array([[0.0, 0.0, 1.0]])
    energy = np.array([math.pi])  # a white surface that faces it is white
    seen = shading.specular(towards, towards, exponent, towards, energy)
    assert float(comment.split()[-1]) == pytest.approx(specular * seen[0], rel=1e-5)


def test_gltf_is_a_sphere_of_the_material(numbers, tmp_path):
    path = tmp_path / "vase.gltf"
    path.write_text(interchange.gltf(material(*numbers), "vase"), encoding="utf-8")
    mesh = trimesh.load(path, force="mesh")
    # Vertices along the seam and at the poles lie upon one another.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight and mesh.volume == pytest.approx(4 / 3 * math.pi, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=1e-6)


def _written(numbers):
    """Roughness, lobe's reflectance and base colour of a glTF file, as the standard has them."""
    found = json.loads(interchange.gltf(material(*numbers), "vase"))["materials"][0]
    extension = found["extensions"]["KHR_materials_specular"]
    strength = extension["specularFactor"]
    f0 = np.minimum(0.04 * np.array(extension["specularColorFactor"]), 1) * strength
    np.testing.assert_allclose(f0, strength)  # F0 = F90: the same at every angle
    base = np.array(found["pbrMetallicRoughness"]["baseColorFactor"])
    assert base[3] == 1 and base.min() >= 0 and base.max() <= 1
    return found["pbrMetallicRoughness"]["roughnessFactor"], strength, base[:3]


@pytest.mark.parametrize("exponent", [0.0, 1.0, 3.0, 30.0, 1000.0])
@pytest.mark.parametrize(
    "diffuse, specular",
    [([0.3, 0.2, 0.1], 0.4), ([0.9, 0.6, 0.3], 0.8), ([1.0, 1.0, 1.0], 1.0), ([0.0] * 3, 1.0)],
)
def test_the_albedos_are_scaled_as_little_as_conserves_energy(diffuse, specular, exponent):
    """Base and lobe together reflect the estimate, or all light in the brightest channel."""
    numbers = diffuse, specular, exponent
    roughness, lobe, base = _written(numbers)
    wide = 1 / (1 + (exponent / 1.5) ** 2)
    total = np.array(diffuse) + (wide + 0.76 * (1 - wide)) * specular
    scale = interchange.albedo_scale(material(*numbers))
    assert scale == pytest.approx(min(1, 1 / total.max()))
    np.testing.assert_allclose((1 - lobe) * base + lobe, scale * total, atol=1e-5)
    assert lobe == pytest.approx(scale * 0.76 * (1 - wide) * specular, abs=1e-5)
    assert roughness**2 == pytest.approx(min((2 / (exponent + 2)) ** 0.625, 0.6), rel=1e-4)


def test_what_is_too_bright_keeps_hue_and_gloss():
    """A material and the same with albedos that conserve energy: the same file, but for extras."""
    diffuse, specular, exponent = np.array([0.9, 0.6, 0.3]), 0.8, 100.0
    scale = interchange.albedo_scale(material(diffuse, specular, exponent))
    assert scale == pytest.approx(1 / (0.9 + 0.76 * 0.8), rel=1e-3)
    half = 0.5 * scale
    bright, sound, dim = (
        _written((factor * diffuse, factor * specular, exponent)) for factor in (1, scale, half)
    )
    for one, other in zip(bright, sound, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)
    np.testing.assert_allclose((1 - bright[1]) * bright[2], 2 * (1 - dim[1]) * dim[2], atol=1e-5)
    assert bright[1] == pytest.approx(2 * dim[1], rel=1e-4)
    found = json.loads(interchange.gltf(material(diffuse, specular, exponent), "vase"))
    assert found["materials"][0]["extras"]["albedo_scale"] == pytest.approx(scale, rel=1e-5)


def test_the_warning_tells_the_factor():
    assert interchange.remarks(material([0.3, 0.2, 0.1], 0.4, 100.0)) == []
    assert interchange.remarks(material([0.0] * 3, 0.0, 0.0)) == []
    (told,) = interchange.remarks(material([1.0, 1.0, 1.0], 1.0, 1000.0))
    assert "0.57 times the estimate" in told and "1.76 times as bright" in told


def test_gltf_passes_khronos_validator(tmp_path):
    """`npm install gltf-validator` in the checkout makes this test run."""
    node = shutil.which("node")
    script = """
      const validator = require("gltf-validator"), fs = require("fs");
      validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))
        .then(report => console.log(JSON.stringify(report.issues)));
    """
    known = node and not subprocess.run([node, "-e", "require('gltf-validator')"]).returncode
    if not known:
        pytest.skip("needs node and `npm install gltf-validator`")
    for name, numbers in MATERIALS.items():
        path = tmp_path / f"{name}.gltf"
        path.write_text(interchange.gltf(material(*numbers), name), encoding="utf-8")
        found = subprocess.run(
            [node, "-e", script, str(path)], capture_output=True, text=True, check=True
        )
        issues = json.loads(found.stdout)
        assert issues["numErrors"] == issues["numWarnings"] == 0, issues


@pytest.mark.slow
def test_gltf_is_opened_by_blender(tmp_path):
    """Blender, of the wheel `bpy`, reads the numbers and renders the sphere in a furnace."""
    wheels = tmp_path / "wheels"
    command = [sys.executable, "-m", "pip", "install", "-q", "--target", str(wheels), "bpy"]
    if subprocess.run(command, capture_output=True).returncode:
        pytest.skip("needs the wheel `bpy`, which this Python or machine cannot get")
    script = """
import json, sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
nodes = bpy.data.materials[0].node_tree.nodes
shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
read = {name: shader.inputs[name].default_value for name in ("Roughness", "Specular IOR Level")}
for name in ("Base Color", "Specular Tint"):
    read[name] = list(shader.inputs[name].default_value)
scene = bpy.context.scene
scene.world = bpy.data.worlds.new("furnace")
if scene.world.node_tree is None:
    scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location = (0, 0, 5)
scene.collection.objects.link(camera)
scene.camera = camera
scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 64
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.filepath = sys.argv[2]
bpy.ops.render.render(write_still=True)
print("READ" + json.dumps(read))
"""
    numbers = [0.9, 0.6, 0.3], 0.8, 100.0
    path, picture = tmp_path / "vase.gltf", tmp_path / "vase.exr"
    path.write_text(interchange.gltf(material(*numbers), "vase"), encoding="utf-8")
    answer = subprocess.run(
        [sys.executable, "-c", script, str(path), str(picture)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(wheels)},
    )
    assert answer.returncode == 0, answer.stderr
    line = next(one for one in answer.stdout.splitlines() if one.startswith("READ"))
    read, (roughness, lobe, base) = json.loads(line.removeprefix("READ")), _written(numbers)
    assert read["Roughness"] == pytest.approx(roughness, rel=1e-4)
    np.testing.assert_allclose(read["Base Color"][:3], base, rtol=1e-4)
    # Blender's level 0.5 is F0 = 0.04.
    np.testing.assert_allclose(
        0.08 * read["Specular IOR Level"] * np.array(read["Specular Tint"][:3]), lobe, rtol=1e-3
    )
    middle = photo_pixels(picture)[14:18, 14:18, :3].mean((0, 1))
    np.testing.assert_allclose(middle, (1 - lobe) * base + lobe, atol=0.05)


def photo_pixels(path):
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


@pytest.mark.parametrize("exponent, lobe", [(100.0, 0.76), (3.0, 0.7)])
def test_mitsuba_reflects_what_was_estimated(exponent, lobe, mitsuba_choice):
    """In a furnace the middle of the sphere reflects m_d and three quarters of m_s."""
    import mitsuba as mi

    scene = interchange.mitsuba_scene(material([0.3, 0.2, 0.1], 0.4, exponent))
    scene = json.loads(json.dumps(scene))
    scene = {name: part for name, part in scene.items() if not name.startswith("light_")}
    scene["furnace"] = {"type": "constant"}
    image = _rendered(mi, scene, 64)
    expected = np.array([0.3, 0.2, 0.1]) + lobe * 0.4
    np.testing.assert_allclose(image[14:18, 14:18].mean((0, 1)), expected, atol=0.02)
    np.testing.assert_allclose(image[0, 0], 1, atol=1e-3)


def _rendered(mi, scene, samples):
    scene["sensor"]["film"] |= {"width": 32, "height": 32, "rfilter": {"type": "box"}}
    return np.array(mi.render(mi.load_dict(scene), spp=samples))[..., :3]


def _of_eq_4(diffuse, specular, exponent):
    """Eq. 4 on the scene's sphere in the studio at pixels' centres, and which see the sphere."""
    camera = np.array([*[16 / math.tan(math.radians(20))] * 2, 16, 16])
    view = shading.view_directions(camera, 32, 32)
    centre = np.array([0, 0, -interchange.SPHERE_DISTANCE])
    along = -view @ centre
    below = along**2 - centre @ centre + 1
    normal = -(along - np.sqrt(np.maximum(below, 0)))[..., None] * view - centre
    light = environment.rotate(studio_light.light(), np.eye(3), 128, 256)
    energy = (light * environment.solid_angles(128, 256)).ravel()
    towards = environment.directions(128, 256).reshape(-1, 3)[energy > 0]
    energy, inside = energy[energy > 0], below > 0.1
    picture = np.zeros((32, 32, 3))
    d = shading.diffuse(normal[inside], towards, energy)
    s = shading.specular(normal[inside], view[inside], exponent, towards, energy)
    picture[inside] = np.outer(d, diffuse) + specular * s[:, None]
    return picture, inside


@pytest.mark.parametrize(
    "numbers, most",
    [
        (([0.8, 0.5, 0.2], 0.0, 100.0), 0.01),
        (([0.3, 0.2, 0.1], 0.4, 100.0), 0.05),
        (([0.9, 0.6, 0.3], 0.8, 100.0), 0.08),
        (([0.2, 0.4, 0.6], 0.6, 1.0), 0.05),
    ],
    ids=["matt", "glossy", "too bright", "wide lobe"],
)
def test_mitsubas_picture_is_that_of_eq_4(numbers, most, mitsuba_choice):
    """Mean difference as seen on a screen, over the sphere in the studio."""
    import mitsuba as mi

    scene = interchange.mitsuba_scene(material(*numbers))
    found = _rendered(mi, json.loads(json.dumps(scene)), 64)
    truth, inside = _of_eq_4(*numbers)
    seen = [colour.linear_to_srgb(np.clip(one[inside], 0, 1)) for one in (found, truth)]
    assert np.mean(np.abs(seen[0] - seen[1])) < most
    assert np.all(found[~inside & (np.abs(np.indices((32, 32)) - 15.5).max(0) > 14)] == 0)


@pytest.mark.parametrize("numbers", MATERIALS.values(), ids=MATERIALS)
def test_every_material_loads_in_mitsuba(numbers, mitsuba_choice):
    import mitsuba as mi

    assert mi.load_dict(interchange.mitsuba_scene(material(*numbers)))


def test_no_material_no_file():
    albedos = Material(diffuse_albedo=np.zeros(3), specular_albedo=0.0)
    for write in (interchange.wavefront, interchange.gltf):
        for lacking in (albedos, Material(exponent=10.0)):
            with pytest.raises(ValueError, match="lacks a number"):
                write(lacking, "vase")
    with pytest.raises(ValueError, match="lacks a number"):
        interchange.mitsuba_scene(albedos)
    assert interchange.remarks(albedos) == []
