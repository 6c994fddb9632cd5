"""The error of the estimated light of a scene (paper, section 7), for each bin of the exponent.

    python benchmarks/illumination.py CORPUS --weights RUN --count 100

Estimates the light of the test split's first images, with the true normals, from three sources:

- "true": the true layers D and M;
- "estimated": the layers that a run's networks estimate (with --weights). An image without light
  from the networks, such as one in which they find no object, is missing from its count;
- "…, as printed": the same layers, by section 7 as printed: M's map plus the harmonics of D, added;
- "constant": no layers, but an even light of the true mean radiance, as a baseline.

Measures of the light E against the true light E*:

- error: ∫|E − E*| / ∫E* over the sphere, of maps blurred by 5.6° (two texels), because 64 × 128
  maps hold little detail below that; "seen": the same over the directions that the object mirrors.
- relit: PSNR of the true material rendered under E against E*, by Eq. 4 as sRGB, on the object's
  own pixels; "ball": on a ball, which also shows light from other directions.
"""

import argparse
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import record
from tqdm import tqdm

from lime_keras import console
from lime_keras.data.corpus import Split
from lime_keras.eval.markdown_table import aligned
from lime_keras.lighting import illumination
from lime_keras.model import folder as model_folder
from lime_keras.optics import colour, compositing, environment, shading, shininess
from lime_keras.optics.blinn_phong import BlinnPhong

CODE = 2
_BLUR = 2 * math.pi / environment.STORED_SHAPE[0]
_BATCH = 10
_BALL = 48  # height and width in pixels of the image of the ball
_COLUMNS = ("error", "seen", "relit", "ball")
_FEATURES = ("image", "mirror", "diffuse_shading")


def main() -> None:
    """Print a Markdown table for each source of the layers."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path, help="of lime-render, without --lobe printed")
    options.add_argument("--weights", help="run of lime-train, or a set that ships")
    options.add_argument("--count", type=int, default=100, help="images (default: 100)")
    record.add_option(options)
    arguments = options.parse_args()
    console.import_tensorflow()
    if Split(arguments.corpus, "test").lobe != "furnace":
        options.error(f"{arguments.corpus} has --lobe printed: render another")
    rows: dict[str, list[tuple[int, list[float]]]] = {}
    run = model_folder.find(arguments.weights) if arguments.weights else None
    examples = _examples(arguments.corpus, run, arguments.count)
    for truth, estimate in tqdm(examples, total=arguments.count):
        exponent_bin = int(shininess.bin_of(truth["shininess"]))
        for name, row in _measured(truth, estimate).items():
            rows.setdefault(name, []).append((exponent_bin, row))
    for name, found in rows.items():
        print(_table(name, found))
    if arguments.record:
        record.write(
            arguments.record,
            {name: _figures(found) for name, found in rows.items()},
            code=CODE,
            weights=[arguments.weights] if arguments.weights else [],
            corpus=arguments.corpus,
        )


def _examples(
    corpus: Path, run: Path | None, count: int
) -> Iterator[tuple[dict[str, np.ndarray], dict[str, np.ndarray] | None]]:
    """Yield the test split's first examples, and the networks' outputs for each."""
    from lime_keras.data import pipeline
    from lime_keras.eval.accuracy import relighting
    from lime_keras.runtime.keras_engine import KerasEngine

    engine = KerasEngine(run) if run is not None else None
    size = 128 if engine is None else engine.size
    features = (*relighting.FEATURES, *_FEATURES)
    batches = pipeline.evaluation(
        Split(corpus, "test").shard_paths(), size=size, batch_size=_BATCH, features=features
    )
    left = count
    for batch in batches.as_numpy_iterator():
        found = engine.run(engine.outputs, {"image": batch["image"]}) if engine else None
        for index in range(min(left, len(batch["mask"]))):
            truth = {name: values[index] for name, values in batch.items()}
            yield truth, found and {name: values[index] for name, values in found.items()}
        left -= len(batch["mask"])
        if left <= 0:
            return


def _measured(
    truth: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray] | None
) -> dict[str, list[float]]:
    """Return the four measures by source of the layers."""
    true = truth["environment"][..., 0].astype(np.float64)
    view = shading.view_directions(truth["camera"], *truth["mask"].shape[:2])

    def observed(mirror: np.ndarray, diffuse: np.ndarray, mask: np.ndarray):
        # True normals exist only inside the true mask.
        known = (truth["mask"] > 0) * mask
        return illumination.observe(truth["normal"], view, mirror, diffuse, known)

    evidence = observed(truth["mirror"], truth["diffuse_shading"], truth["mask"])
    lights = {"true": illumination.estimate(evidence), "true, as printed": as_printed(evidence)}
    if estimate is not None:
        mask = estimate["mask"] * (estimate["mask"] >= 0.5)
        specular = estimate["specular_albedo"] * estimate["specular_shading"]
        layer = np.maximum(colour.srgb_to_linear(truth["image"]) - specular, 0)
        diffuse = compositing.diffuse_shading(layer, estimate["diffuse_albedo"])
        found = observed(np.maximum(estimate["mirror"], 0), diffuse, mask)
        if found.diffuse_weight.any() or found.mirror_weight.any():
            lights["estimated"] = illumination.estimate(found)
            lights["estimated, as printed"] = as_printed(found)
    lights["constant"] = np.full(true.shape, environment.spherical_mean(true))
    seen = is_observed(evidence)
    return {
        name: [*_errors(light, true, seen), *_relit(truth, light, true)]
        for name, light in lights.items()
    }


def as_printed(evidence: illumination.Evidence) -> np.ndarray:
    """Return the light `(64, 128)` of section 7 as printed: M's map plus the harmonics of D, added.

    M counts at the texels that a pixel mirrors, and nowhere else; the spherical harmonics up to
    order 2 that explain D count everywhere. So light that shows in both counts twice, and gaps
    between mirrored texels stay. `illumination.estimate`, which is compared with this, counts no
    light twice. The light is 0 without evidence.
    """
    mirrored = evidence.mirror / np.where(evidence.mirror_weight > 0, evidence.mirror_weight, 1)
    shaded = evidence.diffuse_weight > 0
    if not shaded.any():
        return mirrored
    weight = evidence.diffuse_weight[shaded]
    values = evidence.diffuse[shaded] / weight
    return np.maximum(mirrored + illumination.explaining(values, weight, shaded), 0)


def is_observed(evidence: illumination.Evidence) -> np.ndarray:
    """Return the directions, `(64, 128)` bool, of which more than half of the light was seen."""
    return illumination.filled(evidence)[1] < 0.5


def _errors(light: np.ndarray, true: np.ndarray, seen: np.ndarray) -> list[float]:
    """Return the relative error of the blurred map over the sphere and over seen directions."""
    solid_angle = environment.solid_angles(*true.shape)
    light, true = environment.blur(light, _BLUR), environment.blur(true, _BLUR)
    return [
        float(np.sum(weight * np.abs(light - true)) / np.sum(weight * true))
        for weight in (solid_angle, solid_angle * seen)
    ]


def _relit(truth: Mapping[str, np.ndarray], light: np.ndarray, true: np.ndarray) -> list[float]:
    """Return the PSNR in dB of the true material under `light` against `true`: object and ball."""
    from lime_keras.eval.accuracy import relighting

    material = BlinnPhong(
        truth["diffuse_albedo"], float(truth["specular_albedo"]), float(truth["shininess"])
    )
    return [
        relighting.psnr(*(relighting.Lit(shape, map_).photo(material) for map_ in (true, light)))
        for shape in (truth, {**truth, **_ball()})
    ]


def _ball() -> dict[str, np.ndarray]:
    """Return mask, normals and camera of a ball seen from afar."""
    down, across = (np.mgrid[:_BALL, :_BALL] + 0.5) * (2 / _BALL) - 1
    inside = np.hypot(across, down) < 0.97
    towards = np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    normal = np.stack([across, -down, towards], axis=-1) * inside[..., None]
    camera = np.array([10 * _BALL, 10 * _BALL, _BALL / 2, _BALL / 2])
    return {"mask": inside[..., None].astype(np.float32), "normal": normal, "camera": camera}


def _bins(found: list[tuple[int, list[float]]]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the name and the rows `(N, 4)` of the measures of each bin, and of all images."""
    bins = np.array([exponent_bin for exponent_bin, _ in found])
    rows = np.array([row for _, row in found])
    edges = 10.0**shininess.LOG_EDGES
    groups = [(f"{edges[k]:.3g}–{edges[k + 1]:.3g}", bins == k) for k in range(len(edges) - 1)]
    for label, chosen in [*groups, ("all", bins >= 0)]:
        if chosen.any():
            yield label, rows[chosen]


def _table(name: str, found: list[tuple[int, list[float]]]) -> str:
    """Return a Markdown table of the means for each bin and for all images."""
    lines = [["s", "count", *_COLUMNS]]
    for label, rows in _bins(found):
        error, seen, relit, ball = rows.mean(axis=0)
        numbers = f"{error:.3f}", f"{seen:.3f}", f"{relit:.2f} dB", f"{ball:.2f} dB"
        lines.append([label, f"{len(rows)}", *numbers])
    return f"\n{name}\n\n{aligned(lines)}"


def _figures(found: list[tuple[int, list[float]]]) -> dict[str, record.Figure]:
    """Return the means by bin and column, such as `all, relit`."""
    return {
        f"{label}, {column}": record.Figure(float(mean), None, len(rows))
        for label, rows in _bins(found)
        for column, mean in zip(_COLUMNS, rows.mean(axis=0), strict=True)
    }


if __name__ == "__main__":
    main()
