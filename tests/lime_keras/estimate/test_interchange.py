"""Materials as other tools read them."""

import json
import math
import shutil
import subprocess

import numpy as np
import pytest
import trimesh
from trimesh.exchange.obj import parse_mtl

from lime_keras.estimate import interchange
from lime_keras.material import Material

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


def test_gltf_is_a_sphere_of_the_material(numbers, tmp_path):
    path = tmp_path / "vase.gltf"
    path.write_text(interchange.gltf(material(*numbers), "vase"), encoding="utf-8")
    mesh = trimesh.load(path, force="mesh")
    # Vertices along the seam and at the poles lie upon one another.
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight and mesh.volume == pytest.approx(4 / 3 * math.pi, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=1e-6)


def test_gltf_reflects_what_was_estimated(numbers):
    """The layering of KHR_materials_specular, by hand: F0 and F90 are m_s, the rest is diffuse."""
    diffuse, specular, exponent = numbers
    found = json.loads(interchange.gltf(material(*numbers), "vase"))["materials"][0]
    extension = found["extensions"]["KHR_materials_specular"]
    strength = extension["specularFactor"]
    f0 = np.minimum(0.04 * np.array(extension["specularColorFactor"]), 1) * strength
    np.testing.assert_allclose(f0, specular, atol=1e-6)
    base = np.array(found["pbrMetallicRoughness"]["baseColorFactor"])
    assert base[3] == 1 and base.min() >= 0 and base.max() <= 1
    if max(diffuse) + specular <= 1:
        np.testing.assert_allclose((1 - specular) * base[:3], diffuse, atol=1e-6)
    roughness = found["pbrMetallicRoughness"]["roughnessFactor"]
    assert roughness**4 == pytest.approx(2 / (exponent + 2), rel=1e-4)


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


@pytest.mark.parametrize("exponent, lobe", [(100.0, 1.0), (3.0, 0.82)])
def test_mitsuba_renders_what_was_estimated(exponent, lobe, mitsuba_choice):
    """In a furnace the middle of the sphere reflects m_d + m_s, a rough one less of the lobe."""
    import mitsuba as mi

    scene = interchange.mitsuba_scene(material([0.3, 0.2, 0.1], 0.4, exponent))
    scene = json.loads(json.dumps(scene))
    scene["sensor"]["film"] |= {"width": 32, "height": 32}
    image = np.array(mi.render(mi.load_dict(scene), spp=64))
    expected = np.array([0.3, 0.2, 0.1]) + lobe * 0.4
    np.testing.assert_allclose(image[14:18, 14:18].mean((0, 1)), expected, atol=0.02)
    np.testing.assert_allclose(image[0, 0], 1, atol=1e-3)


@pytest.mark.parametrize("numbers", MATERIALS.values(), ids=MATERIALS)
def test_every_material_loads_in_mitsuba(numbers, mitsuba_choice):
    import mitsuba as mi

    assert mi.load_dict(interchange.mitsuba_scene(material(*numbers)))


@pytest.mark.parametrize("exponent", [0.0, 1e-6, 1.0, 1e3, 1e6])
def test_roughness_is_one_at_zero_and_falls(exponent):
    assert 0 < interchange.roughness(exponent) <= 1
    assert interchange.roughness(exponent) > interchange.roughness(exponent + 1)


def test_no_material_no_file():
    albedos = Material(diffuse_albedo=np.zeros(3), specular_albedo=0.0)
    for write in (interchange.wavefront, interchange.gltf):
        with pytest.raises(ValueError, match="holds no exponent"):
            write(albedos, "vase")
        with pytest.raises(ValueError, match="holds no albedos"):
            write(Material(exponent=10.0), "vase")
    with pytest.raises(ValueError, match="holds no exponent"):
        interchange.mitsuba_scene(albedos)
