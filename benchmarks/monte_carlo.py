"""A comparison of this package's D and S with Mitsuba's Monte Carlo integrator: error and time.

    python benchmarks/monte_carlo.py --environments DIR --maps 3

The scene is a sphere under each map, 256 × 256 pixels. Seconds are processor time on one thread.
Mitsuba's `direct` integrator uses multiple importance sampling of light and lobe. D is its
`diffuse` material, S a material whose value is the lobe of Eq. 3. Mitsuba's error is its noise,
from two independent images; our error is the difference from `--quality reference`. Both are
medians over fully covered pixels. Noise falls with the square root of the samples, so the time
that Mitsuba needs for our error is computed from the largest number of samples. The last column is
the median ratio of Mitsuba's mean to our value; it is near 1, as both compute the same integral.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from lime_keras.optics.shading import normaliser
from lime_keras.render.corpus.random_example import Sources
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene import environments, integrals, lights, sampling, sources
from lime_keras.render.scene.quality import FAST, QUALITIES, Quality
from lime_keras.render.shapes import meshes

SIZE = 256
SAMPLES = (16, 64, 256)
LOBES = {"D": None, "S, s = 2.4": 2.4, "S, s = 42": 42.0, "S, s = 650": 650.0}
POSE = sampling.Pose(
    np.eye(3), np.array([0.0, 0.0, -6.0]), np.array([650.0, 650.0, SIZE / 2, SIZE / 2])
)


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--environments", type=Path)
    options.add_argument("--maps", type=int, default=3, help="how many maps (default: 3)")
    options.add_argument("--cache", type=Path, default=Path("runs/benchmark-rooms"))
    arguments = options.parse_args()
    variants.activate(variants.choose(), threads=1)
    _register_lobe()
    files = sources.files(arguments.environments, "train", environments.EXTENSIONS)
    train = Sources("train", 0, arguments.cache / "train-0", {"environments": files})
    ball = trimesh.creation.icosphere(subdivisions=6)
    mesh = meshes.normalised(ball.vertices, ball.faces, ball.vertices)
    print(
        "| map | layer | ours: error | seconds | "
        + " | ".join(f"Mitsuba, {count} samples: error | seconds" for count in SAMPLES)
        + " | seconds at our error | ratio | mean over ours |"
    )
    print("|---|---|" + "---:|" * (5 + 2 * len(SAMPLES)))
    for name in train.light_names[: arguments.maps]:
        radiance = train.light(name).radiance
        for layer, exponent in LOBES.items():
            print(f"| {name} | {layer} | " + _row(mesh, radiance, exponent) + " |", flush=True)


def _row(mesh: meshes.Mesh, radiance: np.ndarray, exponent: float | None) -> str:
    truth, whole, _ = _ours(mesh, radiance, exponent, QUALITIES["reference"])
    found, _, seconds = _ours(mesh, radiance, exponent, FAST)
    error = float(np.median(np.abs(found - truth)[whole] / truth[whole]))
    cells = [f"{error:.3%}", f"{seconds:.3f}"]
    for count in SAMPLES:
        images, took = _monte_carlo(mesh, radiance, exponent, count)
        mean = (images[0] + images[1]) / 2
        noise = np.median(np.abs(images[0] - images[1])[whole] / np.sqrt(2) / mean[whole])
        cells += [f"{noise:.2%}", f"{took:.2f}"]
    equal = took * (noise / error) ** 2
    ratio = np.median(mean[whole] / found[whole])
    return " | ".join([*cells, f"{equal:.3g}", f"{equal / seconds:.3g}", f"{ratio:.4f}"])


def _ours(
    mesh: meshes.Mesh, radiance: np.ndarray, exponent: float | None, quality: Quality
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return a layer `(SIZE, SIZE)`, the mask of fully covered pixels, and seconds with tracing."""
    from lime_keras.render.scene.gbuffer import Tracer

    tracer = Tracer(mesh, SIZE, quality)
    light = lights.prepare("", radiance, quality=quality)
    for _ in range(2):  # the first time compiles
        began = time.process_time()
        seen = tracer.trace(POSE.rotation, POSE.translation, POSE.camera)
        if exponent is None:
            values = seen.pixel_means(integrals.diffuse(seen.normal, light))
        else:
            values = _specular(seen, exponent, light)
        seconds = time.process_time() - began
        if quality is not FAST:
            break
    return seen.image(values)[..., 0], seen.coverage == 1, seconds


def _specular(seen, exponent: float, light: lights.Light) -> np.ndarray:
    chosen, weights = seen.lobe_samples(light.quality.lobe_rough_above / (exponent + 2))
    precision = light.quality.precision
    normal, view = (part[chosen].astype(precision) for part in (seen.normal, seen.view))
    return seen.pixel_means(integrals.specular(normal, view, exponent, light), chosen, weights)


def _monte_carlo(
    mesh: meshes.Mesh, radiance: np.ndarray, exponent: float | None, samples: int
) -> tuple[list[np.ndarray], float]:
    """Return two independent images `(SIZE, SIZE)`, and the seconds that one of them takes."""
    import mitsuba as mi

    from lime_keras.render.scene.gbuffer import mitsuba_mesh

    material = (
        {"type": "diffuse", "reflectance": {"type": "spectrum", "value": 1.0}}
        if exponent is None
        else {"type": "cosine_free_lobe", "exponent": exponent}
    )
    shape = mitsuba_mesh(mesh)
    shape.set_bsdf(
        mi.load_dict({"type": "twosided", "bsdf": material} if exponent is None else material)
    )
    pixels = np.repeat(radiance[..., None].astype(np.float32), 3, axis=2)
    turn = mi.ScalarTransform4f().look_at([0, 0, 6], [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict(
        {
            "type": "scene",
            "shape": shape,
            "light": {"type": "envmap", "bitmap": mi.Bitmap(pixels), "scale": 1.0},
            "sensor": {
                "type": "perspective",
                "to_world": turn,
                "fov": 2 * np.degrees(np.arctan(SIZE / 2 / POSE.camera[0])),
                "film": {
                    "type": "hdrfilm",
                    "width": SIZE,
                    "height": SIZE,
                    "rfilter": {"type": "box"},
                    "pixel_format": "luminance",
                    "component_format": "float32",
                },
            },
            "integrator": {"type": "direct", "hide_emitters": True},
        }
    )
    images, seconds = [], []
    for seed in range(3):
        began = time.process_time()
        # Mitsuba's type stub asks for a UInt32 as the seed; a plain number works.
        image = np.array(mi.render(scene, spp=samples, seed=seed))  # type: ignore[arg-type]
        seconds.append(time.process_time() - began)
        images.append(image.reshape(SIZE, SIZE, -1)[..., 0])
    return images[1:], min(seconds[1:])  # the first compiles


def _register_lobe() -> None:
    """Register a Mitsuba material whose value is c(s) (h·n)^s, sampled by its half vector."""
    import drjit as dr
    import mitsuba as mi

    class CosineFreeLobe(mi.BSDF):
        def __init__(self, properties):
            super().__init__(properties)
            exponent: Any = properties["exponent"]
            self.exponent: Any = mi.Float(exponent)
            self.scale: Any = mi.Float(float(normaliser(float(exponent))))
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(self, context, surface, sample1, sample2, active=True):
            o = surface.wi
            cosine = dr.power(sample2.x, dr.rcp(self.exponent + 1))
            sine = dr.safe_sqrt(1 - cosine * cosine)
            sin_phi, cos_phi = dr.sincos(2 * dr.pi * sample2.y)
            half = mi.Vector3f(sine * cos_phi, sine * sin_phi, cosine)
            i = 2 * dr.dot(o, half) * half - o
            result: Any = mi.BSDFSample3f()
            result.wo = i
            result.pdf = self.pdf(context, surface, i, active)
            result.eta = 1.0
            result.sampled_type = +mi.BSDFFlags.GlossyReflection
            result.sampled_component = 0
            usable = active & (result.pdf > 0)
            value = self.eval(context, surface, i, usable) / dr.maximum(result.pdf, 1e-20)
            return result, dr.select(usable, value, 0)

        def eval(self, context, surface, i, active=True):
            half = dr.normalize(i + surface.wi)
            lit = active & (i.z > 0) & (surface.wi.z > 0)
            value = self.scale * dr.power(dr.maximum(half.z, 1e-20), self.exponent)
            return dr.select(lit, mi.Color3f(value), 0)

        def pdf(self, context, surface, i, active=True):
            half = dr.normalize(i + surface.wi)
            lit = active & (i.z > 0) & (surface.wi.z > 0)
            lobe = (
                (self.exponent + 1)
                / (2 * dr.pi)
                * dr.power(dr.maximum(half.z, 1e-20), self.exponent)
            )
            return dr.select(lit, lobe / dr.maximum(4 * dr.dot(surface.wi, half), 1e-6), 0)

        def eval_pdf(self, context, surface, i, active=True):
            return self.eval(context, surface, i, active), self.pdf(context, surface, i, active)

        def to_string(self):
            return "CosineFreeLobe"

    mi.register_bsdf("cosine_free_lobe", CosineFreeLobe)


if __name__ == "__main__":
    main()
