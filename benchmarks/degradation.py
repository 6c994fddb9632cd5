"""Accuracy over what the person with the camera can control: how the answer gets worse.

    python benchmarks/degradation.py CORPUS --weights best --out degradation --record degradation

CORPUS has a test split. Of the same scenes, each knob makes ten photos: the size of the object in
the photo, JPEG quality, exposure, white balance, and the error of a given mask. Prints a table, and
writes degradation.md and degradation.png. The first row of a knob is the photo at its best.
"""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import record
import scenes
from PIL import Image
from tqdm import tqdm

from lime_keras import Estimator, console
from lime_keras.data.corpus import Split
from lime_keras.eval.accuracy.evaluate import check_lobe
from lime_keras.eval.markdown_table import aligned
from lime_keras.metrics import overlap, overlap_ratio
from lime_keras.model import folder as model_folder
from lime_keras.optics import camera_law, colour, shininess
from lime_keras.train.photos import paint

matplotlib.use("Agg")

CODE = 1
MEASURES = ("log10 s", "right or neighbouring bin", "m_d", "m_s", "IoU")


@dataclasses.dataclass(frozen=True)
class Photo:
    """A photo of a scene.

    Attributes:
        image: linear radiance `(H, W, 3)`, not clipped.
        mask: true coverage `(H, W, 1)`.
        given: mask that is given to the estimator, or None.
        quality: JPEG quality, or None.
    """

    image: np.ndarray
    mask: np.ndarray
    given: np.ndarray | None = None
    quality: int | None = None


def smaller(photo: Photo, to: float) -> Photo:
    """Return the photo as the middle `to` of a larger one, whose edges go on: seen from afar."""
    size = len(photo.image)
    around = round(size * (1 / to - 1) / 2)
    mask = np.pad(photo.mask, ((around, around), (around, around), (0, 0)))
    # Mirrored objects would be others: only the frame's edge goes on.
    rows = np.clip(np.arange(-around, size + around), 0, size - 1)
    both = np.concatenate([photo.image[rows][:, rows], mask], -1).astype(np.float32)
    small = [
        Image.fromarray(np.ascontiguousarray(channel)).resize((size, size), Image.Resampling.BOX)
        for channel in np.moveaxis(both, -1, 0)
    ]
    whole = np.stack([np.asarray(channel) for channel in small], axis=-1)
    return dataclasses.replace(photo, image=whole[..., :3], mask=whole[..., 3:])


def tinted(photo: Photo, to: float) -> Photo:
    """Return the photo with red over blue off by a share."""
    logarithms = np.array([[np.log1p(to), 0.0, 0.0, 0.0]])
    gains = camera_law.balance(logarithms, camera_law.places(len(photo.image)))[0]
    return dataclasses.replace(photo, image=photo.image * gains)


def moved(photo: Photo, to: float) -> Photo:
    """Return the photo with a given mask: the true one, with its edge moved by some pixels."""
    if to == 0:
        return dataclasses.replace(photo, given=photo.mask)
    radius = int(np.ceil(abs(to)))
    blurred = paint.blurred(photo.mask, radius)
    level = 0.5 - 0.5 * to / (radius + 0.5)
    return dataclasses.replace(photo, given=np.asarray(blurred >= level, np.float32))


KNOBS: dict[str, tuple[Callable[..., Photo], tuple[float, ...]]] = {
    "object's share of the frame": (smaller, (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.15)),
    "JPEG quality": (
        lambda photo, to: dataclasses.replace(photo, quality=round(to)),
        (98, 95, 90, 85, 80, 70, 60, 45, 30, 15),
    ),
    "exposure, stops": (
        lambda photo, to: dataclasses.replace(photo, image=photo.image * 2.0**to),
        (0, -3, -2, -1.5, -1, -0.5, 0.5, 1, 1.5, 2),
    ),
    "cast, red over blue": (tinted, (0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.125, 0.15, 0.175, 0.2)),
    "given mask's edge, pixels": (moved, (0, -4, -3, -2, -1, 1, 2, 3, 4, 6)),
}
"""By the name of a knob, a function that turns it, and its ten settings, the best first."""


def main() -> None:
    """Print and write the tables, and draw the figure."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", nargs="+", default=["live"])
    options.add_argument("--count", type=console.count, default=160)
    options.add_argument("--knobs", nargs="+", choices=KNOBS, default=list(KNOBS))
    options.add_argument("--out", type=Path, default=Path("degradation"))
    record.add_option(options)
    arguments = options.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    chosen = list(scenes.scenes(arguments.corpus, "test", count=arguments.count))
    found: dict[str, dict[str, np.ndarray]] = {}
    columns: dict[str, dict[str, record.Figure]] = {}
    tables = []
    for weights in arguments.weights:
        check_lobe(model_folder.find(weights), Split(arguments.corpus, "test"))
        estimator, of_weights = Estimator(weights), columns.setdefault(weights, {})
        for knob in arguments.knobs:
            turn, settings = KNOBS[knob]
            rows = [
                _measured(estimator, chosen, turn, to)
                for to in tqdm(settings, desc=f"{weights}, {knob}", unit="setting")
            ]
            found.setdefault(knob, {})[weights] = np.array([means for means, _ in rows])
            for to, (means, counts) in zip(settings, rows, strict=True):
                for measure, value, count in zip(MEASURES, means, counts, strict=True):
                    figure = record.Figure(float(value), None, int(count))
                    of_weights[f"{knob} {to:g}, {measure}"] = figure
            lines = [
                [f"{to:g}", *(f"{value:.3f}" for value in means), str(min(counts))]
                for to, (means, counts) in zip(settings, rows, strict=True)
            ]
            tables.append(aligned([[f"`{weights}`, {knob}", *MEASURES, "answered"], *lines]))
    text = "\n\n".join(tables)
    (arguments.out / "degradation.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    _draw(found, arguments.out / "degradation.png")
    if arguments.record:
        record.write(
            arguments.record, columns, code=CODE, weights=arguments.weights, corpus=arguments.corpus
        )


def _measured(
    estimator: Estimator, chosen: list[dict[str, np.ndarray]], turn: Callable[..., Photo], to: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of each measure, and of how many photos.

    Where no object was found, all but the IoU are left out.
    """
    rows: list[tuple[float, ...]] = []
    for scene in chosen:
        # A stored image is clipped; what is left of it is what a camera has.
        photo = turn(Photo(colour.srgb_to_linear(scene["image"]), scene["mask"]), to)
        levels = scenes.levels(colour.linear_to_srgb(np.clip(photo.image, 0, 1)))
        if photo.quality is not None:
            levels = scenes.jpeg(levels, photo.quality)
        material = estimator.estimate(levels, photo.given)
        probabilities = material.exponent_bin_probabilities
        if material.exponent is None or material.specular_albedo is None or probabilities is None:
            rows.append((np.nan, np.nan, np.nan, np.nan, 0.0))
            continue
        distance = np.argmax(probabilities) - shininess.bin_of(scene["shininess"])
        rows.append(
            (
                abs(np.log10(material.exponent) - np.log10(scene["shininess"])),
                abs(int(distance)) <= 1,
                np.abs(np.asarray(material.diffuse_albedo) - scene["diffuse_albedo"]).mean(),
                abs(material.specular_albedo - float(scene["specular_albedo"])),
                overlap_ratio(*overlap(photo.mask[None], material.layers["mask"][None]))[0],
            )
        )
    values = np.asarray(rows, float)
    return np.nanmean(values, axis=0), np.isfinite(values).sum(axis=0)


def _draw(found: dict[str, dict[str, np.ndarray]], path: Path) -> None:
    """Draw each measure over the settings of each knob, a line a set of weights."""
    size = (2.5 * len(found), 10)
    figure, axes = plt.subplots(
        len(MEASURES), len(found), figsize=size, sharex="col", sharey="row", squeeze=False
    )
    for column, (knob, of_weights) in enumerate(found.items()):
        settings = np.array(KNOBS[knob][1])
        order = np.argsort(settings)
        for row, measure in enumerate(MEASURES):
            axis = axes[row, column]
            for weights, values in of_weights.items():
                axis.plot(settings[order], values[order, row], "o-", markersize=3, label=weights)
            axis.grid(alpha=0.3)
            axes[row, 0].set_ylabel(measure)
        axes[-1, column].set_xlabel(knob)
    axes[0, 0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
