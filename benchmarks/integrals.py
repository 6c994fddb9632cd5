"""How exact and how fast S is: the split threshold against error and time, for three lobes.

    python benchmarks/integrals.py --environments DIR --shapes DIR

Each map lights one mesh; S of `lime_keras.render.integrals` is compared with the sum over every
texel of the 512-row map in float64, at 400 random pixels. Without folders,
built-in shapes and rooms serve.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from lime_keras import shading
from lime_keras.render import integrals, lights, scenes, sources, variants

EXPONENTS = (2.4, 42.0, 650.0)
THRESHOLDS = (2e-2, 5e-3, 2e-3, 5e-4, 1e-4)
PIXELS = 400


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--environments", type=Path)
    options.add_argument("--shapes", type=Path)
    options.add_argument("--cache", type=Path, default=Path("runs/benchmark-rooms"))
    options.add_argument("--maps", type=int, default=6, help="how many maps (default: 6)")
    arguments = options.parse_args()
    variants.activate(variants.choose(), threads=1)
    from lime_keras.render.gbuffer import Tracer

    shapes = sources.ShapeSource(arguments.shapes, "train", 0)
    maps = sources.LightSource(arguments.environments, "train", 0, arguments.cache)
    rng = np.random.default_rng(0)
    mesh = shapes.load(shapes.names()[0])
    pose = scenes.sample_pose(rng, mesh.vertices, 256)
    gbuffer = Tracer(mesh, 256).trace(pose.rotation, pose.translation, pose.camera)
    chosen = [maps.load(name) for name in maps.names()[: arguments.maps]]
    rotations = [scenes.sample_light_rotation(rng, light.strong_direction) for light in chosen]
    print(f"{len(gbuffer.representative)} pixels, {len(chosen)} maps, one thread")
    print("| exponent | split above | lights | median error | 95th | 99th | seconds |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    for exponent in EXPONENTS:
        truths = [
            _truth(gbuffer, exponent, light, rotation)
            for light, rotation in zip(chosen, rotations, strict=True)
        ]
        for threshold in THRESHOLDS:
            lights._SPLIT_ABOVE = threshold
            _row(gbuffer, exponent, threshold, chosen, rotations, truths)


def _frame(gbuffer, rotation):
    first = gbuffer.representative
    turn = rotation.astype(np.float32)
    return gbuffer.normal[first] @ turn, gbuffer.view[first] @ turn


def _truth(gbuffer, exponent, light, rotation):
    n, o = (values.astype(np.float64) for values in _frame(gbuffer, rotation))
    some = np.random.default_rng(1).choice(len(n), PIXELS)
    texels = shading.texels(light.radiance.astype(np.float64))
    return some, shading.specular(n[some], o[some], exponent, *texels)


def _row(gbuffer, exponent, threshold, chosen, rotations, truths) -> None:
    errors, seconds, counts = [], [], []
    for light, rotation, (some, truth) in zip(chosen, rotations, truths, strict=True):
        n, o = _frame(gbuffer, rotation)
        began = time.perf_counter()
        value = integrals.specular(n, o, exponent, light)
        seconds.append(time.perf_counter() - began)
        counts.append(len(light.cut(exponent)[0]))
        errors.append(np.abs(value[some] - truth) / np.maximum(truth, 1e-9))
    median, high, highest = np.percentile(np.concatenate(errors), [50, 95, 99])
    print(
        f"| {exponent:g} | {threshold:g} | {np.median(counts):.0f} | {median:.3%} | {high:.2%} "
        f"| {highest:.2%} | {np.median(seconds):.3f} |"
    )


if __name__ == "__main__":
    main()
