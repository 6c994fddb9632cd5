"""The renderer's trade-off: error of D, S and M against time, for every setting.

    python benchmarks/quality.py --shapes DIR --environments DIR --out DIR

Scenes are sampled as for a corpus, one for each map. Errors are relative, for random object pixels,
edges included, against `--quality reference`, which is itself compared with float64 sums over every
texel of the map. Writes quality.md, table by table, and quality.png. Without folders, built-in
shapes and rooms are used. Times are processor time on one thread, divided by the time of `fast` at
the same moment. The two tables of errors come first, after some five minutes for twenty maps; those
of the settings take an hour more.
"""

import argparse
import dataclasses
import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from lime_keras import console
from lime_keras.optics import environment, shading, shininess
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.render.corpus.random_example import Sources
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene import environments, example, lights, sampling, sources
from lime_keras.render.scene.quality import FAST, QUALITIES, Quality
from lime_keras.render.shapes import meshes

LOBES = {"dull": 2.4, "middle": 42.0, "shiny": 650.0}
KNOBS: dict[str, tuple] = {
    "subsamples": (1, 2, 3, 5),
    "refined": (3, 4, 6, 9),
    "rough_above": (0.0, math.radians(1) ** 2, FAST.rough_above, math.radians(4) ** 2, 1.0),
    "cells": (1, 2, 3),
    "lobe_rough_above": (0.1, 0.3, 1.0, 10.0),
    "split_above": (2e-2, 5e-3, 2e-3, 5e-4, 1e-4),
    "finest": (64, 128, 256, 512),
    "irradiance_rows": (16, 32, 64, 128, 256),
    "negligible": (1e-3, 1e-4, 1e-6, 1e-8),
    "precision": ("float32", "float64"),
}
SIZES = (128, 256, 512)
PIXELS = 400
CHECKED_PIXELS = 8
LAYERS = ("D", "S", "M")
REFERENCE = QUALITIES["reference"]


@dataclasses.dataclass(frozen=True)
class Scene:
    """A mesh in its pose under an environment map, and the size of its image in pixels."""

    mesh: Any
    radiance: np.ndarray
    pose: sampling.Pose
    rotation: np.ndarray
    size: int


def main() -> None:
    """Measure all errors and times, print and write the tables, and draw the figure."""
    arguments = _arguments()
    variants.activate(variants.choose(), threads=1)
    console.import_tensorflow()
    arguments.out.mkdir(parents=True, exist_ok=True)
    chosen = _scenes(arguments)
    with (arguments.out / "quality.md").open("w", encoding="utf-8", buffering=1) as report:
        for table in _tables(chosen, arguments.out):
            report.write(f"{table}\n\n")
            print(table, end="\n\n", flush=True)


def _tables(chosen: list[Scene], out: Path) -> Iterable[str]:
    """Yield each table when it is measured."""
    yield _bins(chosen)
    yield _reference(chosen[:3])
    yield from _trade(chosen, out)


def _arguments() -> argparse.Namespace:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--environments", type=Path)
    options.add_argument("--shapes", type=Path)
    options.add_argument("--out", type=Path, default=Path("runs/quality"))
    options.add_argument("--maps", type=int, default=6, help="how many maps (default: 6)")
    return options.parse_args()


def _scenes(arguments: argparse.Namespace) -> list[Scene]:
    files = {
        "shapes": sources.files(arguments.shapes, "train", meshes.EXTENSIONS),
        "environments": sources.files(arguments.environments, "train", environments.EXTENSIONS),
    }
    train = Sources("train", 0, arguments.out / "rooms", files)
    rng = np.random.default_rng(0)
    names = sources.random_subset(rng, train.light_names, arguments.maps)
    out = []
    for name in tqdm(names, "scenes"):
        light = train.light(name)
        scene = _posed(train, light, rng)
        while _coverage(scene) < example.LEAST_COVERAGE:
            scene = _posed(train, light, rng)
        out.append(scene)
    return out


def _posed(train: Sources, light: Any, rng: np.random.Generator) -> Scene:
    """Return a scene of a random mesh in a random pose under a map, drawn from `rng`."""
    name = train.shape_names[rng.integers(len(train.shape_names))]
    mesh, _ = train.mesh(name, 256)
    rotation = sampling.sample_light_rotation(rng, light.strong_direction)
    pose = sampling.sample_pose(rng, mesh.vertices, 256)
    return Scene(mesh, light.radiance, pose, rotation, 256)


def _coverage(scene: Scene) -> float:
    """Return the share of the image that the object covers."""
    from lime_keras.render.scene.gbuffer import Tracer

    tracer, pose = Tracer(scene.mesh, scene.size, FAST), scene.pose
    return float(tracer.trace(pose.rotation, pose.translation, pose.camera).coverage.mean())


# ---- tables ----------------------------------------------------------------------------------


def _bins(chosen: list[Scene]) -> str:
    """Return the table of the error of `fast` in each of the eight bins."""
    errors: dict = {}
    for scene in tqdm(chosen, "fast and reference, eight bins"):
        for k in range(shininess.BIN_COUNT):
            exponent = 10.0 ** float(shininess.LOG_MEANS[k])
            for layer, values in _errors(scene, FAST, exponent).items():
                errors.setdefault((k, layer), []).append(values)
    rows = []
    for k in range(shininess.BIN_COUNT):
        cells = [_percentiles(errors[k, layer]) for layer in LAYERS]
        rows.append((k, f"{10.0 ** float(shininess.LOG_MEANS[k]):.3g}", *cells))
    return _table(
        f"Error of `fast` against `reference`, median / 95th / 99th percentile of {PIXELS} pixels "
        f"of each of {len(chosen)} scenes",
        ("bin", "exponent", *LAYERS),
        rows,
    )


def _reference(chosen: list[Scene]) -> str:
    """Return the table of `reference`'s error against plain sums over all texels."""
    rows = []
    for name, exponent in LOBES.items():
        errors: dict[str, list] = {layer: [] for layer in LAYERS}
        for scene in tqdm(chosen, f"reference and every texel, {name}"):
            for layer, values in _plain_errors(scene, exponent).items():
                errors[layer].append(values)
        rows.append((name, f"{exponent:g}", *(_percentiles(errors[layer]) for layer in LAYERS)))
    return _table(
        f"Error of `reference` against float64 sums over every texel at 9 × 9 samples a pixel, "
        f"{CHECKED_PIXELS} pixels of each of {len(chosen)} scenes",
        ("lobe", "exponent", *LAYERS),
        rows,
    )


def _trade(chosen: list[Scene], out: Path) -> Iterable[str]:
    """Draw the figure and yield a table for each setting, with all others as in `fast`."""
    measured: dict[str, list[tuple[str, float, dict]]] = {}
    for knob, values in KNOBS.items():
        for value in tqdm(values, knob):
            changes = {knob: value}
            quality = dataclasses.replace(FAST, **changes)
            label = value if isinstance(value, str) else f"{value:.3g}"
            label += " (fast)" if quality == FAST else ""
            measured.setdefault(knob, []).append((label, *_measured(chosen, quality)))
    measured["quality"] = [(name, *_measured(chosen[:2], q)) for name, q in QUALITIES.items()]
    for size in tqdm(SIZES, "size"):
        resized = [_resized(scene, size) for scene in chosen]
        label = f"{size}" + (" (fast)" if size == 256 else "")
        measured.setdefault("size", []).append((label, *_measured(resized, FAST)))
    _draw(measured, out / "quality.png")
    columns = [layer if lobe is None else f"{layer} {lobe}" for layer, lobe in _curves()]
    for knob, points in measured.items():
        rows = [
            (label, f"{relative:.2f}", *(_percentiles([errors[curve]]) for curve in _curves()))
            for label, relative, errors in points
        ]
        yield _table(f"`{knob}`", (knob, "time / fast", *columns), rows)


# ---- measuring -------------------------------------------------------------------------------


def _errors(scene: Scene, quality: Quality, exponent: float) -> dict[str, np.ndarray]:
    """Return the relative errors, at most `(PIXELS,)`, of D, S and M against the reference."""
    truth = _reference_layers(scene, exponent)
    seen, light = _prepared(scene, quality)
    pixels = np.intersect1d(truth[0], seen.covered_pixels)
    found = _at(_some(seen, pixels), light, scene.rotation, exponent, pixels)
    kept = np.isin(truth[0], pixels)
    return {layer: _relative(found[layer], truth[1][layer][kept]) for layer in LAYERS}


def _plain_errors(scene: Scene, exponent: float) -> dict[str, np.ndarray]:
    """Return the relative errors of the reference against sums over every texel."""
    seen, light = _prepared(scene, REFERENCE)
    pixels = _chosen(seen, CHECKED_PIXELS)
    few = _some(seen, pixels)
    turn = scene.rotation.astype(np.float64)
    normal, view = few.normal @ turn, few.view @ turn
    texels = shading.texels(light.radiance)
    plain = {
        "D": few.pixel_means(shading.diffuse(normal, *texels)),
        "S": few.pixel_means(shading.specular(normal, view, exponent, *texels)),
        "M": few.pixel_means(environment.lookup(light.radiance, shading.reflect(normal, view))),
    }
    found = _at(few, light, scene.rotation, exponent, pixels)
    return {layer: _relative(found[layer], plain[layer]) for layer in LAYERS}


def _measured(chosen: list[Scene], quality: Quality) -> tuple[float, dict]:
    """Return the time of a whole example divided by that of `fast`, and the errors by curve."""
    errors: dict = {}
    times = []
    for scene in chosen:
        for layer, lobe in _curves():
            exponent = LOBES[lobe or "middle"]
            values = _errors(scene, quality, exponent)[layer]
            errors.setdefault((layer, lobe), []).append(values)
        light = _prepared(scene, quality)[1]
        base = _resized(scene, 256)
        fast_light = _prepared(base, FAST)[1]
        for exponent in LOBES.values():
            # `fast` is timed at the same moment, so that other programs disturb both alike.
            fast = _seconds(base, FAST, fast_light, exponent)
            times.append(_seconds(scene, quality, light, exponent) / fast)
    return float(np.median(times)), {key: np.concatenate(v) for key, v in errors.items()}


def _seconds(scene: Scene, quality: Quality, light: lights.Light, exponent: float) -> float:
    """Return the processor seconds of a whole example, after another one for compilation."""
    _cached(
        ("compiled", id(scene.mesh), scene.size, _sampling(quality)),
        lambda: _example(scene, quality, light, exponent),
    )
    began = time.process_time()
    _example(scene, quality, light, exponent)
    return time.process_time() - began


def _curves() -> list[tuple[str, str | None]]:
    return [("D", None), *(("S", lobe) for lobe in LOBES), ("M", None)]


def _example(scene: Scene, quality: Quality, light: lights.Light, exponent: float) -> bytes:
    """Trace, light, compose and encode an example, and return its record."""
    from lime_keras.data import records

    material = BlinnPhong(np.full(3, 0.4), 0.5, exponent, 0.02)
    background = np.full((scene.size, scene.size, 3), 0.5, np.float32)
    features = example.render(
        _tracer(scene, quality), light, scene.pose, scene.rotation, material, background
    )
    return records.encode(features | {"shape": "", "light": "", "seed": 0, "index": 0})


def _sampling(quality: Quality) -> tuple:
    """Return the settings that a G-buffer depends on."""
    return quality.subsamples, quality.refined, quality.rough_above, quality.cells


_CACHE: dict = {}


def _cached(key: tuple, make) -> Any:
    """Return a cached value, made on first request; values are never dropped, as scenes are few."""
    if key not in _CACHE:
        _CACHE[key] = make()
    return _CACHE[key]


def _tracer(scene: Scene, quality: Quality):
    from lime_keras.render.scene.gbuffer import Tracer

    key = ("tracer", id(scene.mesh), scene.size, _sampling(quality))
    return _cached(key, lambda: Tracer(scene.mesh, scene.size, quality))


def _prepared(scene: Scene, quality: Quality):
    """Return the G-buffer and the light of a scene in a quality."""
    sampling = _sampling(quality)
    seen = _cached(
        ("seen", id(scene.pose), scene.size, sampling),
        lambda: _tracer(scene, quality).trace(
            scene.pose.rotation, scene.pose.translation, scene.pose.camera
        ),
    )
    lighting = dataclasses.replace(quality, subsamples=1, refined=1)
    light = _cached(
        ("light", id(scene.radiance), lighting),
        lambda: lights.prepare("", scene.radiance, quality=lighting),
    )
    return seen, light


def _reference_layers(scene: Scene, exponent: float) -> tuple[np.ndarray, dict]:
    def make():
        seen, light = _prepared(scene, REFERENCE)
        pixels = _chosen(seen, PIXELS)
        return pixels, _at(_some(seen, pixels), light, scene.rotation, exponent, pixels)

    return _cached(("truth", id(scene.pose), scene.size, exponent), make)


def _chosen(seen, count: int) -> np.ndarray:
    covered = seen.covered_pixels
    return np.sort(np.random.default_rng(1).choice(covered, min(count, len(covered)), False))


def _some(seen, pixels: np.ndarray):
    """Return the part of a G-buffer that lies in the given pixels."""
    kept = np.zeros(seen.coverage.size, bool)
    kept[pixels] = True
    return seen.part(kept)


def _at(few, light, rotation, exponent, pixels) -> dict[str, np.ndarray]:
    images = example.layers(few, light, rotation, exponent)
    return {layer: image.reshape(-1)[pixels] for layer, image in zip(LAYERS, images, strict=True)}


def _resized(scene: Scene, size: int) -> Scene:
    if size == scene.size:
        return scene
    key = ("pose", id(scene.pose), size)
    camera = scene.pose.camera * (size / scene.size)
    pose = _cached(key, lambda: dataclasses.replace(scene.pose, camera=camera))
    return dataclasses.replace(scene, pose=pose, size=size)


def _relative(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.abs(found - truth) / np.maximum(truth, 1e-6)


# ---- showing ---------------------------------------------------------------------------------


def _percentiles(errors: list[np.ndarray]) -> str:
    median, high, highest = np.percentile(np.concatenate(errors), [50, 95, 99])
    return f"{median:.2%} / {high:.1%} / {highest:.1%}"


def _table(title: str, header: tuple, rows: list[tuple]) -> str:
    lines = [title, "", "| " + " | ".join(header) + " |", "|" + "---:|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def _draw(measured: dict, path: Path) -> None:
    """Draw median (solid line) and 99th percentile (dotted) over time, a panel for each setting."""
    from matplotlib.figure import Figure

    across = 3
    down = -(-len(measured) // across)
    figure = Figure(figsize=(5 * across, 3.6 * down), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False)
    for panel in panels.flat[len(measured) :]:
        panel.set_axis_off()
    for (knob, points), panel in zip(measured.items(), panels.flat, strict=False):
        times = [point[1] for point in points]
        for number, curve in enumerate(_curves()):
            for percentile, style in ((50, "o-"), (99, ":")):
                errors = [100 * np.percentile(point[2][curve], percentile) for point in points]
                label = " ".join(filter(None, curve)) if percentile == 50 else None
                panel.plot(times, np.maximum(errors, 1e-4), style, color=f"C{number}", label=label)
        for label, relative, _ in points:
            panel.annotate(
                label,
                (relative, 1),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                xytext=(2, -3),
                rotation=90,
                va="top",
                fontsize=7,
            )
        panel.set(title=knob, yscale="log", ylim=(1e-3, 1e3))
        if max(times) - min(times) < 0.3:
            panel.set_xlim(min(times) - 0.15, max(times) + 0.15)
        panel.set_xlabel("time of an example / that of fast")
        panel.set_ylabel("relative error, %")
        panel.grid(alpha=0.3)
    panels.flat[0].legend(fontsize=7, loc="lower left")
    figure.suptitle("Error of D, S and M: median (lines) and 99th percentile (dotted)")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
