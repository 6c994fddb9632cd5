"""Error of the layers that are made where the training runs, by bin, and its cost.

    python benchmarks/synthesis_error.py --shapes DIR --environments DIR --out DIR

Scenes are sampled as for a corpus, one for each map, and traced at 128². Errors of D, S and M are
relative, for random object pixels, edges included, against `--quality reference`, beside those of
`fast`. The layers come from what a bank stores (quantised normals, two surfaces at edges) and maps
of 256 rows. The knob is `coarseness`; the last row leaves out the second surfaces. Cost is in pairs
of a surface and a light, and in time over that of the default in the same run. Writes
synthesis_error.md and synthesis_error.png. Without folders, built-in shapes and rooms are used.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from lime_keras import console
from lime_keras.optics import environment, octahedral, shininess
from lime_keras.render.bank.entries import quantised
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene import environments, example, lights, sampling, sources
from lime_keras.render.scene.gbuffer import Tracer
from lime_keras.render.scene.quality import FAST, QUALITIES

SIZE = 128
PIXELS = 300
COARSENESSES = (1.0, 2.0, 4.0, 8.0, 16.0)
LAYERS = ("D", "S", "M")
_SMOOTH_BELOW = 1e-4
EXPONENTS = 10.0 ** np.asarray(shininess.LOG_MEANS, float)


@dataclass(frozen=True)
class Scene:
    """One scene: its layers by the renderer at some pixels, and what a bank stores.

    Attributes:
        pixels: row-major indices of the pixels, `(N,)`.
        reference: D, S and M of each bin, `(8, 3, N)`, converged.
        fast: the same at quality `fast`.
        coverage: coverage, share, normals and spread as a bank holds them.
        camera: fx, fy, cx, cy in pixels.
        rotation: from the map's frame to camera space, `(3, 3)`.
        radiance: the map, `(256, 512)`.
    """

    pixels: np.ndarray
    reference: np.ndarray
    fast: np.ndarray
    stored: tuple[np.ndarray, ...]
    camera: np.ndarray
    rotation: np.ndarray
    radiance: np.ndarray


def main() -> None:
    """Measure, print and write the tables, and draw the figure."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--environments", type=Path)
    options.add_argument("--shapes", type=Path)
    options.add_argument("--out", type=Path, default=Path("runs/synthesis"))
    options.add_argument("--maps", type=int, default=16, help="how many maps (default: 16)")
    arguments = options.parse_args()
    variants.activate(variants.choose(), threads=1)
    console.import_tensorflow()
    arguments.out.mkdir(parents=True, exist_ok=True)
    scenes = list(_scenes(arguments))
    from lime_keras.synthesis.shading import COARSENESS

    rows: dict[tuple[float, bool], tuple[float, float, dict]] = {}
    for coarseness in COARSENESSES:
        rows[coarseness, True] = _measured(scenes, coarseness, two=True)
    rows[COARSENESS, False] = _measured(scenes, COARSENESS, two=False)
    default = rows[COARSENESS, True][2]
    text = "\n\n".join((_bins(scenes, default), _smooth(scenes, default), _trade(rows, COARSENESS)))
    (arguments.out / "synthesis_error.md").write_text(text + "\n", encoding="utf-8")
    _draw(rows, arguments.out / "synthesis_error.png")
    print(text)


def _scenes(arguments: argparse.Namespace) -> Any:
    """Yield the scenes, rendered at both qualities."""
    shapes = sources.ShapeSource(arguments.shapes, "train", 0)
    maps = sources.LightSource(arguments.environments, "train", 0, arguments.out / "rooms")
    reference = QUALITIES["reference"]
    rng = np.random.default_rng(0)
    for name in tqdm(sources.random_subset(rng, maps.names(), arguments.maps), "scenes"):
        mesh = shapes.load(shapes.names()[rng.integers(len(shapes.names()))])
        fast_light = maps.load(name)
        light = lights.prepare(name, fast_light.radiance, quality=reference)
        rotation = sampling.sample_light_rotation(rng, light.strong_direction)
        pose = sampling.sample_pose(rng, mesh.vertices, SIZE)
        place = pose.rotation, pose.translation, pose.camera
        fine, fast = (Tracer(mesh, SIZE, q).trace(*place) for q in (reference, FAST))
        both = np.intersect1d(fine.covered_pixels, fast.covered_pixels)
        pixels = np.sort(rng.choice(both, min(PIXELS, len(both)), replace=False))
        kept = np.zeros(SIZE * SIZE, bool)
        kept[pixels] = True
        found = [
            [
                [layer.reshape(-1)[pixels] for layer in example.layers(part, lit, rotation, s)]
                for s in EXPONENTS
            ]
            for part, lit in ((fine.part(kept), light), (fast.part(kept), fast_light))
        ]
        radiance = fast_light.radiance
        if len(radiance) > 256:
            radiance = environments.resized(radiance, 256)
        yield Scene(
            pixels,
            np.array(found[0]),
            np.array(found[1]),
            quantised(fast, pose.camera),
            pose.camera,
            rotation,
            radiance,
        )


def _measured(scenes: list[Scene], coarseness: float, two: bool) -> tuple[float, float, dict]:
    """Return pairs a scene, seconds a scene, and the relative errors by bin and layer."""
    import tensorflow as tf

    from lime_keras.synthesis.geometry import ONE_SURFACE, variance_of
    from lime_keras.synthesis.shading import LEVEL_ROWS, layers, pieces, rows_for

    compiled = tf.function(layers, jit_compile=True, autograph=False)
    errors: dict = {}
    seconds, pairs = [], []
    for scene in scenes:
        coverage, share, normal, spread = scene.stored
        if not two:
            share = np.full_like(share, ONE_SURFACE)
        there = np.stack([coverage > 0, (coverage > 0) & (share < ONE_SURFACE)])
        work = pieces(_repeated(there), EXPONENTS, coarseness)
        radiance = scene.radiance * (
            lights.MEAN_RADIANCE / environment.spherical_mean(scene.radiance)
        )
        given = [
            _repeated(octahedral.decode(normal)),
            _repeated(variance_of(spread)),
            _repeated(share / np.float32(ONE_SURFACE)),
            _repeated(scene.camera),
            _repeated(radiance),
            _repeated(scene.rotation),
            EXPONENTS.astype(np.float32),
        ]
        tensors = [tf.constant(values, tf.float32) for values in given]
        compiled(*tensors, work)
        began = time.perf_counter()
        images = [image.numpy() for image in compiled(*tensors, work)]
        seconds.append((time.perf_counter() - began) / len(EXPONENTS))
        counts = 2 * np.array(LEVEL_ROWS)[rows_for(EXPONENTS, coarseness)] ** 2
        pairs.append(float(there.sum() * counts.mean()))
        for k in range(shininess.BIN_COUNT):
            for index, layer in enumerate(LAYERS):
                truth = scene.reference[k, index]
                seen = images[index][k].reshape(-1)[scene.pixels]
                errors.setdefault((k, layer), []).append(_relative(seen, truth))
    return float(np.mean(pairs)), float(np.median(seconds)), errors


def _repeated(values: np.ndarray) -> np.ndarray:
    return np.repeat(np.asarray(values)[None], shininess.BIN_COUNT, axis=0)


def _relative(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return relative errors; a thousandth of the mean is the least that is divided by."""
    return np.abs(found - truth) / np.maximum(truth, 1e-3 * truth.mean() + 1e-12)


def _percentiles(errors: list[np.ndarray]) -> str:
    median, most = np.percentile(np.concatenate(errors), [50, 95])
    return f"{median:.2%} / {most:.1%}"


def _bins(scenes: list[Scene], errors: dict) -> str:
    """Return the table of errors by bin, beside those of `fast`."""
    lines = [
        f"Error against `reference`, median / 95th percentile of {PIXELS} pixels of each of "
        f"{len(scenes)} scenes at {SIZE}²",
        "",
        "| bin | exponent | D | S | M | `fast`: D | S | M |",
        "|---:|---:|---|---|---|---|---|---|",
    ]
    for k in range(shininess.BIN_COUNT):
        cells = [_percentiles(errors[k, layer]) for layer in LAYERS]
        for index in range(3):
            fast = [_relative(s.fast[k, index], s.reference[k, index]) for s in scenes]
            cells.append(_percentiles(fast))
        lines.append(f"| {k} | {EXPONENTS[k]:.3g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _smooth(scenes: list[Scene], errors: dict) -> str:
    """Return the error of M on the pixels that see one surface that hardly bends."""
    from lime_keras.synthesis.geometry import ONE_SURFACE, variance_of

    smooth, kept = [], []
    for scene, found in zip(scenes, errors[0, "M"], strict=True):
        _, share, _, spread = scene.stored
        one = share.reshape(-1)[scene.pixels] == ONE_SURFACE
        variance = variance_of(spread[0].reshape(-1)[scene.pixels])
        smooth.append(one & (variance < _SMOOTH_BELOW))
        kept.append(found[smooth[-1]])
    return (
        f"M on the {np.concatenate(smooth).mean():.0%} of the pixels that see one surface, of a "
        f"variance below {_SMOOTH_BELOW:g}: {_percentiles(kept)}"
    )


def _trade(rows: dict, default: float) -> str:
    """Return the table of errors, over all bins, against cost."""
    base = rows[default, True]
    lines = [
        "Cost against error, all bins; median / 95th percentile",
        "",
        "| coarseness | surfaces | million pairs a scene | time | D | S | M |",
        "|---:|---:|---:|---:|---|---|---|",
    ]
    for (coarseness, two), (pairs, seconds, errors) in rows.items():
        cells = [
            _percentiles([e for k in range(shininess.BIN_COUNT) for e in errors[k, layer]])
            for layer in LAYERS
        ]
        lines.append(
            f"| {coarseness:g}{' (default)' * (coarseness == default and two)} | {1 + two} | "
            f"{pairs / 1e6:.1f} | × {seconds / base[1]:.2f} | {' | '.join(cells)} |"
        )
    return "\n".join(lines)


def _draw(rows: dict, path: Path) -> None:
    """Draw the errors of S against cost: median and 95th percentile."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    for quantile, style in ((50, "o-"), (95, "s--")):
        points = []
        for (_, two), (pairs, _, errors) in rows.items():
            if two:
                values = [e for k in range(shininess.BIN_COUNT) for e in errors[k, "S"]]
                points.append((pairs / 1e6, np.percentile(np.concatenate(values), quantile)))
        axes.plot(*zip(*points, strict=True), style, label=f"{quantile}th percentile")
    axes.set(
        xscale="log", yscale="log", xlabel="million pairs a scene", ylabel="relative error of S"
    )
    axes.legend()
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
