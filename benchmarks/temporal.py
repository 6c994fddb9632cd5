"""The gain of fusion over a video's frames: variance over time, and error, raw and fused.

    python benchmarks/temporal.py --weights RUN
    python benchmarks/temporal.py --weights RUN --shapes DIR --environments DIR

Renders short sequences, each with one test shape, one material and one light. In even sequences the
object turns before the camera. In odd ones the camera turns about the object, so that the light
turns too in camera space. The exponents are the means of every second bin. Each frame is estimated
alone ("raw") and then fused as `lime-estimate` fuses a video's frames. Variance is over a
sequence's frames, error is the mean of |estimate − truth| over them. Both are means over channels
and sequences.
"""

import argparse
import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
import record
from tqdm import tqdm

from lime_keras import console
from lime_keras.eval.markdown_table import aligned
from lime_keras.optics import material_law, shininess
from lime_keras.render.corpus.random_example import Sources
from lime_keras.render.mitsuba_setup import variants
from lime_keras.render.scene import environments, example, sampling, sources
from lime_keras.render.shapes import meshes
from lime_keras.video import cuts
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import parameters

CODE = 1
_DISTANCE = 6.0
_FILL = 0.8
"""Share of the image's width that the object's bounding sphere fills: the object can turn without
leaving the image."""
_TURN = math.radians(90)  # angle of the turn from the first frame to the last, in radians
_PARAMETERS = {
    "diffuse albedo": slice(0, 3),
    "specular albedo": slice(3, 4),
    "log10 exponent": slice(4, 5),
}
_HEAD = ("parameter", "variance, raw", "fused", "error, raw", "fused", "fused, last frame")
_NAMES = ("raw variance", "fused variance", "raw error", "fused error", "last error")


@dataclasses.dataclass(frozen=True)
class Sequence:
    """A sequence: frames `(T, S, S, 3)` uint8 sRGB, and the true m_d, m_s and log10 s, `(5,)`."""

    name: str
    frames: np.ndarray
    truth: np.ndarray


def main() -> None:
    """Print a table of the means over the sequences."""
    arguments = _arguments()
    variants.activate(variants.choose(), threads=1)
    sequences = [render(arguments, k) for k in tqdm(range(arguments.sequences), unit="sequence")]
    console.import_tensorflow()
    from lime_keras import Estimator

    estimator = Estimator(arguments.weights, ["albedo", "exponent"])
    rows: dict[str, list[list[float]]] = {}
    for sequence in sequences:
        raw = estimates(estimator, sequence)
        found = int(np.sum(np.isfinite(raw[:, 0])))
        print(f"{sequence.name}: an object in {found} of {len(raw)} frames")
        fused = fuse(raw)
        for name, part in _PARAMETERS.items():
            row = _measures(raw[:, part], fused[:, part], sequence.truth[part])
            rows.setdefault(name, []).append(row)
    means = {name: np.nanmean(of_sequences, axis=0) for name, of_sequences in rows.items()}
    lines = [
        [name, *(f"{x:.2e}" for x in row[:2]), *(f"{x:.3f}" for x in row[2:])]
        for name, row in means.items()
    ]
    print(f"\n{aligned([_HEAD, *lines])}\n\n{distances(sequences)}")
    if arguments.record:
        count = sum(len(sequence.frames) for sequence in sequences)
        columns = {
            name: {
                measure: record.Figure(float(value), None, count)
                for measure, value in zip(_NAMES, row, strict=True)
            }
            for name, row in means.items()
        }
        weights = [str(arguments.weights)]
        record.write(arguments.record, columns, code=CODE, weights=weights)


def render(arguments: argparse.Namespace, number: int) -> Sequence:
    """Render a sequence, whose shape, light, material and pose follow from the seed and number."""
    rng = np.random.default_rng([arguments.seed, number])
    files = {
        "shapes": sources.files(arguments.shapes, "test", meshes.EXTENSIONS),
        "environments": sources.files(arguments.environments, "test", environments.EXTENSIONS),
    }
    cache = arguments.cache / f"test-{arguments.seed}"
    test = Sources("test", arguments.seed, cache, files)
    shape, light_name = rng.choice(test.shape_names), rng.choice(test.light_names)
    (_, tracer), light = test.mesh(shape, arguments.size), test.light(light_name)
    exponent = float(10 ** shininess.LOG_MEANS[(2 * number + 1) % shininess.BIN_COUNT])
    material = dataclasses.replace(material_law.sample_material(rng), exponent=exponent)
    start = sampling.sample_rotation(rng)
    light_start = sampling.sample_light_rotation(rng, light.strong_direction)
    background = test.background(rng, arguments.size)
    camera_moves = number % 2 == 1
    frames = []
    for angle in np.linspace(0, _TURN, arguments.frames):
        turn = _turn(angle)
        pose = sampling.Pose(turn @ start, np.array([0, 0, -_DISTANCE]), _camera(arguments.size))
        light_rotation = turn @ light_start if camera_moves else light_start
        features = example.render(tracer, light, pose, light_rotation, material, background)
        frames.append(np.rint(255 * np.asarray(features["image"])).astype(np.uint8))
    truth = [*material.diffuse_albedo, material.specular_albedo, math.log10(exponent)]
    mover = "camera" if camera_moves else "object"
    name = f"{shape}, {light_name}, {mover} turns, s = {exponent:.3g}"
    return Sequence(name, np.stack(frames), np.array(truth))


def estimates(estimator, sequence: Sequence) -> np.ndarray:
    """Estimate each frame alone: the parameters `(T, 5)`, NaN of frames without an object."""
    materials = [estimator.estimate(frame / np.float32(255)) for frame in sequence.frames]
    return np.stack([parameters(material) for material in materials])


def fuse(estimated: np.ndarray) -> np.ndarray:
    """Return the fused estimate after each frame, `(T, ...)`."""
    fusion = Fusion()
    return np.stack([fusion.update(estimate) for estimate in estimated])


def distances(sequences: list[Sequence]) -> str:
    """Return a sentence on the cut detector's distances within and between sequences."""
    seen = [[cuts.histogram(frame) for frame in sequence.frames] for sequence in sequences]
    within = [cuts.distance(*pair) for s in seen for pair in itertools.pairwise(s)]
    between = [cuts.distance(a[-1], b[0]) for a, b in itertools.permutations(seen, 2)]
    return (
        f"Colours differ by at most {max(within, default=0):.3f} between the successive frames of "
        f"a sequence, by at least {min(between, default=1):.3f} between two sequences; a cut is "
        f"told from {cuts.THRESHOLD}."
    )


def _measures(raw: np.ndarray, fused: np.ndarray, truth: np.ndarray) -> list[float]:
    """Return variances and errors of `(T, C)` estimates, in the order of the table's columns."""
    seen = np.isfinite(raw[:, 0])
    raw, fused = raw[seen], fused[seen]
    if not len(raw):
        return [math.nan] * 5
    return [
        float(np.mean(np.var(raw, axis=0))),
        float(np.mean(np.var(fused, axis=0))),
        float(np.mean(np.abs(raw - truth))),
        float(np.mean(np.abs(fused - truth))),
        float(np.mean(np.abs(fused[-1] - truth))),
    ]


def _turn(angle: float) -> np.ndarray:
    """Return the rotation `(3, 3)` by `angle` about the camera's vertical axis."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])


def _camera(size: int) -> np.ndarray:
    focal = _FILL * size / 2 / math.tan(math.asin(1 / _DISTANCE))
    return np.array([focal, focal, size / 2, size / 2])


def _arguments() -> argparse.Namespace:
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--weights", type=Path, required=True, metavar="RUN")
    options.add_argument("--shapes", type=Path, help="(default: built-in shapes)")
    options.add_argument("--environments", type=Path, help="(default: built-in rooms)")
    options.add_argument("--cache", type=Path, default=Path("runs/benchmark-rooms"))
    options.add_argument("--sequences", type=int, default=4, help="(default: 4)")
    options.add_argument("--frames", type=int, default=40, help="of each (default: 40)")
    options.add_argument("--size", type=int, default=128, help="in pixels (default: 128)")
    options.add_argument("--seed", type=int, default=0, help="(default: 0)")
    record.add_option(options)
    return options.parse_args()


if __name__ == "__main__":
    main()
