"""The look of exported materials beside the estimate's own: ꟻLIP of spheres.

    python benchmarks/interchange.py
    python benchmarks/interchange.py --merl merl_blinnphong_derived.csv --environments hdris/

A sphere of each material is shaded by Eq. 4, by float64 sums over the lights, and as each written
file says:

- Mitsuba: the scene itself, rendered by Mitsuba;
- glTF: the formulas of glTF 2.0, appendix B, and of KHR_materials_specular;
- MTL: the format's own formula, with Ks as written and as in the comment; and the formula of
  three.js, which normalises the lobe.

The light is the studio's (`studio_light`). With --environments, material i is also shown under the
i-th map of the folder, scaled as for a corpus. Materials are drawn as for a corpus; those of --merl
are Blinn–Phong fits of the 100 MERL materials: kd / π + ks (n + 2) / 2π cosⁿ, in the columns
`sgd_cbrt_*`.

For each material the mean ꟻLIP over the sphere is taken. "clipped" is the plain export:
α = √(2 / (s + 2)) for both distributions, a lobe of m_s, and a base of m_d / (1 − m_s), clipped
at 1. "same light" is the export under the same light; "brighter light" is under a light brighter by
1 / `albedo_scale`, as Mitsuba's scene has it. MTL clips nothing and is not scaled.
"""

import argparse
import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenImageIO as oiio
from tqdm import tqdm

from lime_keras.estimate import interchange
from lime_keras.io import photo
from lime_keras.material import Material
from lime_keras.optics import colour, environment, material_law, microfacets, shading, studio_light
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene import environments, lights

_BOX_LIGHTS = 300
"""Number of lights that stand for each light."""
_FINEST = (64, 128)
_SAMPLES = 256
"""Samples of a pixel in Mitsuba."""
_SHOWN = 6
_TINY = 1e-9


class Sphere(NamedTuple):
    """The samples of a picture of Mitsuba's sphere, 2 × 2 in each pixel.

    Attributes:
        inside: `(2 S, 2 S)`, samples that hit the sphere.
        whole: `(S, S)`, pixels all of whose samples hit it.
        normal: `(N, 3)`, unit normals of the hits in camera space.
        view: `(N, 3)`, unit directions to the viewer.
    """

    inside: np.ndarray
    whole: np.ndarray
    normal: np.ndarray
    view: np.ndarray


class Light(NamedTuple):
    """A light as a sum: directions `(T, 3)`, energies `(T,)`, and the map, None of the studio."""

    direction: np.ndarray
    energy: np.ndarray
    radiance: np.ndarray | None


def main() -> None:
    """Print a Markdown table of median and worst ꟻLIP."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--count", type=int, default=50, help="random materials (default: 50)")
    options.add_argument("--seed", type=int, default=0, help="(default: 0)")
    options.add_argument("--size", type=int, default=64, help="of the pictures (default: 64)")
    options.add_argument("--merl", type=Path, metavar="CSV", help="Blinn–Phong fits of MERL")
    options.add_argument(
        "--environments", type=Path, metavar="DIR", help="maps, besides the studio"
    )
    options.add_argument("--out", type=Path, metavar="PNG", help="picture of the first materials")
    arguments = options.parse_args()
    # Materials and lights.
    variants.activate(variants.choose(), 2)
    rng = np.random.default_rng(arguments.seed)
    materials = {"random": [material_law.sample_material(rng) for _ in range(arguments.count)]}
    if arguments.merl:
        materials["MERL"] = list(_merl(arguments.merl))
    lightings = {"studio": [_studio()]}
    if arguments.environments:
        paths = sorted(arguments.environments.iterdir())[: arguments.count]
        lightings["maps"] = [_map(path) for path in paths]
    # Compare.
    sphere = _sphere(arguments.size)
    print("| materials | light | file | export | median ꟻLIP | worst |")
    print("|---|---|---|---|---:|---:|")
    for name, some in materials.items():
        scales = [interchange.albedo_scale(_exported(material)) for material in some]
        for light_name, light in lightings.items():
            found: dict[tuple[str, str], list[float]] = {}
            sheets = []
            for index, material in enumerate(tqdm(some, desc=f"{name}, {light_name}")):
                pictures = _pictures(material, light[index % len(light)], sphere)
                truth = pictures.pop(("Eq. 4", ""))
                for key, picture in pictures.items():
                    found.setdefault(key, []).append(_flip(truth, picture, sphere.whole))
                sheets.append([truth, *pictures.values()])
            for (file, export), values in found.items():
                print(
                    f"| {name} | {light_name} | {file} | {export} | {np.median(values):.3f} | "
                    f"{np.max(values):.3f} |",
                    flush=True,
                )
            if arguments.out:
                path = arguments.out.with_stem(f"{arguments.out.stem}-{name}-{light_name}")
                _draw(path, sheets[:_SHOWN])
        print(
            f"{name}: {np.mean(np.array(scales) < 1):.0%} are scaled, the least by "
            f"{min(scales):.2f}\n"
        )


def _merl(path: Path) -> Iterator[BlinnPhong]:
    """Yield the fits; near the middle of the lobe, Eq. 3's m_s is four times their ks."""
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            diffuse, specular = (
                np.array([float(row[f"sgd_cbrt_{part}_{channel}"]) for channel in "rgb"])
                for part in ("kd", "ks")
            )
            yield BlinnPhong(
                np.clip(diffuse, 0, 1),
                float(np.clip(4 * specular.mean(), 0, 1)),
                float(np.clip(float(row["sgd_cbrt_n"]), 1, 1000)),
            )


def _exported(material: BlinnPhong) -> Material:
    return Material(material.diffuse_albedo, material.specular_albedo, material.exponent)


def _sphere(size: int) -> Sphere:
    """Return the samples of the sphere as Mitsuba's scene shows it, in camera space."""
    focal = size / math.tan(math.radians(20))
    step = (np.arange(2 * size) + 0.5 - size) / focal
    x, y = np.meshgrid(step, -step)
    ray = np.stack([x, y, np.full_like(x, -1)], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    centre = np.array([0, 0, -interchange.SPHERE_DISTANCE])
    along = ray @ centre
    below = along**2 - centre @ centre + 1
    inside = below > 0
    normal = (along - np.sqrt(np.maximum(below, 0)))[..., None] * ray - centre
    whole = inside.reshape(size, 2, size, 2).all(axis=(1, 3))
    return Sphere(inside, whole, normal[inside], -ray[inside])


def _studio() -> Light:
    """Return lights that fill the lights of the studio evenly, on spirals."""
    directions, energies = [], []
    for towards, radius, strength in studio_light.LIGHTS:
        axis = np.array(towards) / np.linalg.norm(towards)
        frame = np.linalg.svd(axis[None, :])[2]  # its first row is ± the axis
        share = (np.arange(_BOX_LIGHTS) + 0.5) / _BOX_LIGHTS
        height = 1 - math.cos(math.radians(radius))
        cosine, turn = 1 - height * share, np.arange(_BOX_LIGHTS) * math.pi * (3 - math.sqrt(5))
        sine = np.sqrt(1 - cosine**2)
        around = np.stack([sine * np.cos(turn), sine * np.sin(turn)], axis=-1) @ frame[1:]
        directions.append(cosine[:, None] * axis + around)
        energies.append(np.full(_BOX_LIGHTS, strength * 2 * math.pi * height / _BOX_LIGHTS))
    return Light(np.concatenate(directions), np.concatenate(energies), None)


def _map(path: Path) -> Light:
    radiance = environment.rotate(environments.load(path), np.eye(3), *_FINEST)
    radiance *= lights.MEAN_RADIANCE / environment.spherical_mean(radiance)
    energy = radiance * environment.solid_angles(*_FINEST)
    return Light(environment.directions(*_FINEST).reshape(-1, 3), energy.ravel(), radiance)


def _pictures(
    material: BlinnPhong, light: Light, sphere: Sphere
) -> dict[tuple[str, str], np.ndarray]:
    """Return linear pictures `(S, S, 3)` by file and export; Eq. 4 first."""
    estimate = _exported(material)
    brighter = 1 / interchange.albedo_scale(estimate)
    diffuse, specular = material.diffuse_albedo, material.specular_albedo
    clipped = np.clip(diffuse / max(1 - specular, 1e-6), 0, 1)

    gltf = json.loads(interchange.gltf(estimate, "x"))["materials"][0]
    old_gltf = json.loads(json.dumps(gltf))
    old_gltf["pbrMetallicRoughness"] |= {
        "baseColorFactor": [*clipped, 1.0],
        "roughnessFactor": math.sqrt(microfacets.beckmann_alpha(material.exponent)),
    }
    old_gltf["extensions"]["KHR_materials_specular"]["specularFactor"] = specular

    scene = interchange.mitsuba_scene(estimate)
    old_scene = json.loads(json.dumps(scene))
    old_scene["sphere"]["bsdf"]["weight"] = specular
    old_scene["sphere"]["bsdf"]["base"]["reflectance"]["value"] = list(clipped)

    mtl = _numbers_of_mtl(interchange.wavefront(estimate, "x"))

    def eq4(nl, nv, nh, vh):
        lobe = shading.normaliser(material.exponent) * _power(nh, material.exponent)
        return (diffuse, nl / math.pi), (specular, lobe)

    picture = _shaded(_gltf(gltf), light, sphere)
    pictures = {
        ("Eq. 4", ""): _shaded(eq4, light, sphere),
        ("glTF", "clipped"): _shaded(_gltf(old_gltf), light, sphere),
        ("glTF", "same light"): picture,
        ("glTF", "brighter light"): picture * brighter,
        ("MTL, three.js", ""): _shaded(_three_js(mtl), light, sphere),
        ("MTL", ""): _shaded(_blinn_phong(mtl), light, sphere),
        ("MTL, Ks of the comment", ""): _shaded(
            _blinn_phong(mtl | {"Ks": mtl["peak"]}), light, sphere
        ),
    }
    size = len(sphere.whole)
    picture = _mitsuba(scene, light, size) / brighter
    pictures["Mitsuba", "clipped"] = _mitsuba(old_scene, light, size) / brighter
    pictures["Mitsuba", "same light"] = picture
    pictures["Mitsuba", "brighter light"] = picture * brighter
    return pictures


def _shaded(reflected: Any, light: Light, sphere: Sphere) -> np.ndarray:
    """Return the linear picture `(S, S, 3)` of a sphere.

    Args:
        reflected: BRDF times cosine of the light, as pairs of a colour `(3,)` or grey and a
            function `(N, T)`, of the cosines i·n, o·n, h·n and h·o, `(N, T or 1)`.
        light: light of the scene.
        sphere: samples of the picture.
    """
    values = np.zeros((len(sphere.normal), 3))
    lit = light.energy > 0
    direction, energy = light.direction[lit], light.energy[lit]
    step = max(1, 2**17 // len(energy))
    for first in range(0, len(values), step):
        normal, view = sphere.normal[first : first + step], sphere.view[first : first + step]
        nl, nv = normal @ direction.T, np.sum(normal * view, axis=-1)[:, None]
        vl = view @ direction.T
        nh = (nl + nv) / np.sqrt(np.maximum(2 + 2 * vl, _TINY))
        vh = np.sqrt(np.maximum((1 + vl) / 2, 0))
        for tint, part in reflected(
            np.maximum(nl, _TINY), np.maximum(nv, _TINY), np.clip(nh, _TINY, 1), vh
        ):
            values[first : first + step] += np.outer(
                np.where(nl > 0, part, 0) @ energy, np.broadcast_to(tint, 3)
            )
    size = len(sphere.whole)
    picture = np.zeros((2 * size, 2 * size, 3))
    picture[sphere.inside] = values
    return picture.reshape(size, 2, size, 2, 3).mean((1, 3))


def _gltf(material: dict[str, Any]) -> Any:
    """Return the BRDF times cosine of a material without metal: glTF 2.0, appendix B."""
    metallic_roughness = material["pbrMetallicRoughness"]
    base = np.array(metallic_roughness["baseColorFactor"][:3])
    square = metallic_roughness["roughnessFactor"] ** 4
    specular = material["extensions"]["KHR_materials_specular"]
    weight = specular["specularFactor"]
    f0 = float(np.minimum(0.04 * np.array(specular["specularColorFactor"]), 1).max())

    def reflected(nl, nv, nh, vh):
        distribution = square / (math.pi * (nh**2 * (square - 1) + 1) ** 2)
        visibility = 1.0
        for cosine in (nl, nv):
            visibility = visibility / (cosine + np.sqrt(square + (1 - square) * cosine**2))
        fresnel = weight * (f0 + (1 - f0) * (1 - vh) ** 5)
        return (
            (base, (1 - fresnel) / math.pi * nl),
            (1.0, fresnel * distribution * visibility * nl),
        )

    return reflected


def _numbers_of_mtl(text: str) -> dict[str, Any]:
    lines = {line.split()[0]: line.split()[1:] for line in text.splitlines()}
    peak = next(line for line in text.splitlines() if "does not normalise" in line).split()[-1]
    return {
        "Kd": np.array(lines["Kd"], float),
        "Ks": float(lines["Ks"][0]),
        "Ns": float(lines["Ns"][0]),
        "peak": float(peak),
    }


def _blinn_phong(mtl: dict[str, Any]) -> Any:
    """Return MTL's own formula (illum 2), by which a light of 1 makes a white surface white."""

    def reflected(nl, nv, nh, vh):
        return (mtl["Kd"], nl / math.pi), (mtl["Ks"], _power(nh, mtl["Ns"]) / math.pi)

    return reflected


def _three_js(mtl: dict[str, Any]) -> Any:
    """Return the BRDF times cosine of three.js' MeshPhongMaterial."""

    def reflected(nl, nv, nh, vh):
        fresnel = mtl["Ks"] + (1 - mtl["Ks"]) * (1 - vh) ** 5
        lobe = fresnel * (mtl["Ns"] / 2 + 1) / (4 * math.pi) * _power(nh, mtl["Ns"])
        return (mtl["Kd"], nl / math.pi), (1.0, lobe * nl)

    return reflected


def _power(cosine: np.ndarray, exponent: float) -> np.ndarray:
    return np.exp(exponent * np.log(cosine))


def _mitsuba(scene: dict[str, Any], light: Light, size: int) -> np.ndarray:
    """Render an exported scene; a map replaces its lights, brighter by the same factor."""
    import mitsuba as mi

    scene = json.loads(json.dumps(scene))
    scene["sensor"]["film"] |= {"width": size, "height": size, "rfilter": {"type": "box"}}
    if light.radiance is not None:
        boxes = [name for name in scene if name.startswith("light_")]
        written = scene[boxes[0]]["emitter"]["radiance"]["value"][0]
        factor = written / studio_light.LIGHTS[0][2]
        for name in boxes:
            del scene[name]
        # Camera space has x and z the other way round.
        turned = np.roll(light.radiance, light.radiance.shape[1] // 2, axis=1) * factor
        pixels = np.repeat(turned[..., None], 3, axis=-1).astype(np.float32)
        scene["map"] = {"type": "envmap", "bitmap": mi.Bitmap(pixels)}
    return np.array(mi.render(mi.load_dict(scene), spp=_SAMPLES))[..., :3]


def _flip(truth: np.ndarray, picture: np.ndarray, inside: np.ndarray) -> float:
    """Return the mean ꟻLIP of linear pictures, clipped at 1 and black beside the sphere."""
    truth_image, image = (
        oiio.ImageBuf((np.clip(one, 0, 1) * inside[..., None]).astype(np.float32))
        for one in (truth, picture)
    )
    # The images are linear with values up to 1: with hdr=0 ꟻLIP does not search for exposures.
    difference = oiio.ImageBufAlgo.FLIP_diff(truth_image, image, hdr=0, nthreads=1)
    return float(np.asarray(difference.get_pixels(oiio.FLOAT))[inside].mean())


def _draw(path: Path, sheets: list[list[np.ndarray]]) -> None:
    """Write a picture with a row for each material: Eq. 4, then the columns of the table."""
    rows = [np.concatenate(pictures, axis=1) for pictures in sheets]
    photo.write(path, colour.linear_to_srgb(np.clip(np.concatenate(rows), 0, 1)))


if __name__ == "__main__":
    main()
