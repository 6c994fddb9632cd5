"""Measures on photographs whose materials nobody has measured: gloss order, m_s, colours, masks.

    python benchmarks/photographs.py PHOTOS [--weights before after] [--record photographs]

PHOTOS is a folder with photos at any depth and what a person knows about them in its `labels.csv`
(docs/how-to/photographs.md). Prints a table of the measures, a column for each model and mask, and
the photos in the order of their gloss.

An answer that is NaN (the model found no object) helps no model: it is a tie in every order, and
lies outside every tolerance. Means are taken over the answers that there are.
"""

import argparse
import csv
import functools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import record
from tqdm import tqdm

from lime_keras.estimate.estimator import Estimator
from lime_keras.eval.markdown_table import ABSENT, aligned
from lime_keras.io import photo as photo_files
from lime_keras.io import scanner, untrusted
from lime_keras.metrics import overlap, overlap_ratio
from lime_keras.optics import colour, shading
from lime_keras.outputs import available
from lime_keras.runtime import engine

CODE = 2  # since 2, m_d is as saturated as the object's pixels
LABELS = "labels.csv"
FINISHES = ("glossy", "matte")
COLUMNS = ("photo", "finish", "note", "dielectric", "pair")  # the first is needed
OWN, GIVEN = "own mask", "given mask"
DIELECTRIC = ((1.5 - 1) / (1.5 + 1)) ** 2  # Fresnel at normal incidence for n = 1.5
LEAST_SPECULAR = 1e-3  # a smaller m_s counts as this in a ratio: below 8 bits of a photo
_RESAMPLES, _SEED = 1000, 2018


def main() -> None:
    """Estimate the photographs and print the measures."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("photos", type=Path, help="folder of photos")
    options.add_argument("--weights", nargs="+", default=["best"], help="runs, or sets that ship")
    record.add_option(options)
    arguments = options.parse_args()
    photos = read_folder(arguments.photos)
    columns = answers(photos, arguments.weights)
    print(table(columns), listing(photos, columns), sep="\n\n")
    if arguments.record:
        figures = {name: measure_all(of) for name, of in columns.items()}
        record.write(
            arguments.record, figures, code=CODE, weights=arguments.weights, corpus=arguments.photos
        )


# The folder.


@dataclass(frozen=True)
class Photo:
    """A photo and its labels (docs/how-to/photographs.md).

    Attributes:
        name: path below the folder of photos, with `/`.
        path: path of the file.
        mask: path of its mask, if it has one.
        finish: `glossy` or `matte`; None without a label.
        dielectric: whether the object is known to be of no metal.
        pair: name of the photos that this one is also compared with alone.
    """

    name: str
    path: Path
    mask: Path | None = None
    finish: str | None = None
    dielectric: bool = False
    pair: str | None = None


def read_folder(folder: Path) -> list[Photo]:
    """Return the photos in a folder in the order of their names.

    The mask of `NAME.*` is `NAME_mask.png` beside it, that of `Kinput.png` is `Kmask.png`.

    Raises:
        ValueError: if there is no photo, or the labels name one that is not there, name one twice,
            or have an unknown column or value.
    """
    pictures = [path for path in scanner.inside(folder) if not scanner.is_video(str(path))]
    masks = {path: _mask(path) for path in pictures}
    photos = sorted(path for path in pictures if path not in masks.values())
    if not photos:
        raise ValueError(
            f"{folder} has no photos: their names end in {', '.join(scanner.SUFFIXES)}"
        )
    names = {path.relative_to(folder).as_posix(): path for path in photos}
    path = folder / LABELS
    labels = dict(_labels(path)) if path.is_file() else {}
    if lost := labels.keys() - names:
        raise ValueError(
            f"{path}: there is no photo {sorted(lost)[0]} in {folder}: write its path below that "
            "folder, with its suffix"
        )
    return [Photo(name, path, masks[path], **labels.get(name, {})) for name, path in names.items()]


def _mask(photo: Path) -> Path | None:
    other = photo.with_name(re.sub("input$", "mask", photo.stem) + photo.suffix)
    return scanner.mask_beside(photo) or (other if other != photo and other.is_file() else None)


def _labels(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and labels of each photo that a file of labels names."""
    seen = set()
    with untrusted.naming(path, "labels"), path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file, skipinitialspace=True)
        header = reader.fieldnames or []
        if "photo" not in header or not set(header) <= set(COLUMNS):
            raise ValueError(
                f"{path} has the columns {', '.join(header) or 'of no header'}: it needs photo and "
                f"may have {', '.join(COLUMNS[1:])}"
            )
        for row in reader:
            where = f"{path}, line {reader.line_num}"
            if None in row:
                raise ValueError(f"{where}: more fields than columns: quote a text with a comma")
            of = {name: (value or "").strip() for name, value in row.items()}
            if of["photo"] in seen:
                raise ValueError(f"{where}: {of['photo']} is named twice")
            seen.add(of["photo"])
            finish, dielectric = of.get("finish"), of.get("dielectric")
            if finish and finish not in FINISHES:
                raise ValueError(
                    f"{where}: finish is {finish!r}: write glossy or matte, or nothing"
                )
            if dielectric not in (None, "", "0", "1"):
                raise ValueError(f"{where}: dielectric is {dielectric!r}: write 1 or 0")
            yield (
                of["photo"],
                {
                    "finish": finish or None,
                    "dielectric": dielectric == "1",
                    "pair": of.get("pair") or None,
                },
            )


# The answers.

Answers = Mapping[str, np.ndarray]
"""The answers of one model with one kind of mask, a column `(N, …)` for each number, NaN without.

Labels: `labelled`, `glossy`, `paired`, `pair`, `dielectric`, `masked` (a mask is given). Of the
model: `diffuse_albedo` `(N, 3)` linear RGB, `specular_albedo`, `exponent`, `iou` of its own mask.
Of the photo: `pixels` `(N, 3)`, the object's mean colour (`mean_colour`) inside the given mask, or
else the model's own.
"""


def answers(photos: Sequence[Photo], weights: Sequence[str]) -> dict[str, Answers]:
    """Return the answers of each model by its column's title, with its own and with given masks.

    A photo without a given mask is answered with the model's own in both columns.

    Args:
        photos: photos to estimate.
        weights: folders of trained models, or names of sets that ship.
    """
    columns: dict[str, Answers] = {}
    for model in weights:
        outputs = available(engine.load(record.model_folder.find(model)).outputs)
        wanted = [name for name in outputs if name in ("mask", "albedo", "exponent")]
        estimator = Estimator(model, wanted)
        rows = [_rows(estimator, photo) for photo in tqdm(photos, desc=model, unit="photo")]
        for kind, of_kind in zip((OWN, GIVEN), zip(*rows, strict=True), strict=True):
            columns[f"{model}, {kind}"] = {
                name: np.array([row[name] for row in of_kind]) for name in of_kind[0]
            }
        if all(own is given for own, given in rows):
            del columns[f"{model}, {GIVEN}"]
    return columns


def _rows(estimator: Estimator, photo: Photo) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the numbers of a photo with the model's own mask and with the given one."""
    image, given = photo_files.read(photo.path)
    if photo.mask is not None:
        given = photo_files.read_mask(photo.mask, *image.shape[:2])
    labels = {
        "labelled": photo.finish is not None,
        "paired": bool(photo.finish and photo.pair),
        "masked": given is not None,
        "glossy": photo.finish == FINISHES[0],
        "dielectric": photo.dielectric,
        "pair": photo.pair or "",
    }

    def row(mask: np.ndarray | None) -> dict[str, Any]:
        material = estimator.estimate(image, mask)
        own = material.layers["mask"]
        whole = material.whole() if material.mask_coverage else None
        return labels | {
            "diffuse_albedo": np.full(3, np.nan) if whole is None else whole.diffuse_albedo,
            "specular_albedo": np.nan if whole is None else whole.specular_albedo,
            "exponent": np.nan if whole is None else whole.exponent,
            "iou": np.nan
            if given is None or mask is not None
            else float(overlap_ratio(*overlap(given[None], own[None]))[0]),
            "pixels": mean_colour(image, own if given is None else given),
        }

    first = row(None)
    return first, first if given is None else row(given)


# The measures: NumPy alone.


def lobe_peak(specular_albedo: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Return m_s · c(s), the height of the specular lobe per steradian, of the same shape.

    It is what a gloss meter (ISO 2813) reads: its receptor, 1.8° to 4.4° wide, lies inside the lobe
    for every s up to 1000, where the lobe is 8.5° wide at half its height. s alone would call a
    sharp lobe of no strength glossy.
    """
    exponent = np.asarray(exponent, np.float64)
    height = specular_albedo * shading.normaliser(np.where(np.isnan(exponent), 0, exponent))
    return np.where(np.isnan(exponent), np.nan, height)


def couples(
    score: np.ndarray, glossy: np.ndarray, pair: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how right each couple of a glossy and a matte photo is, and whether it counts.

    Args:
        score: estimated gloss `(N,)`; NaN is a tie with every other.
        glossy: whether each photo is glossy `(N,)`; the others are matte.
        pair: names `(N,)`; if given, only photos of the same name are compared, those of "" never.

    Returns:
        1, ½ for a tie, or 0; and 1 or 0; each `(glossy, matte)`.
    """
    high, low = score[glossy][:, None], score[~glossy][None]
    counted = np.ones((high.size, low.size))
    if pair is not None:
        counted = np.equal(pair[glossy][:, None], pair[~glossy]) & (pair[~glossy] != "")
    return counted * np.where(high > low, 1.0, np.where(high < low, 0.0, 0.5)), counted * 1.0


def gloss_order(
    score: np.ndarray, glossy: np.ndarray, pair: np.ndarray | None = None
) -> tuple[float, np.ndarray]:
    """Return the share of couples in which the glossy photo has the higher score, the AUC.

    Args:
        score: as `couples` takes it, like the rest.
        glossy: whether each photo is glossy.
        pair: names of the photos that are compared.

    Returns:
        The share, NaN without couples; and its 1,000 bootstrap samples, which draw glossy and matte
        photos separately. Samples are NaN if there are less than two photos of a finish.
    """
    right, counted = couples(score, glossy, pair)
    value = right.sum() / counted.sum() if counted.any() else np.nan
    if min(right.shape) < 2:
        return value, np.full(_RESAMPLES, np.nan)
    rng = np.random.default_rng(_SEED)
    one, other = (_draw(rng, count) for count in right.shape)
    total, correct = (np.sum((one @ of) * other, axis=1) for of in (counted, right))
    return value, np.divide(correct, total, out=np.full(_RESAMPLES, np.nan), where=total > 0)


def mean(values: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the mean of the values `(N,)` that are not NaN, and its 1,000 bootstrap samples.

    As many values always get the same samples, so differences of two models are paired.
    """
    known = ~np.isnan(values)
    value = values[known].mean() if known.any() else np.nan
    if np.count_nonzero(known) < 2:
        return value, np.full(_RESAMPLES, np.nan)
    drawn = _draw(np.random.default_rng(_SEED), len(values))
    total, count = drawn @ np.where(known, values, 0), drawn @ known
    return value, np.divide(total, count, out=np.full(_RESAMPLES, np.nan), where=count > 0)


def _draw(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return how often each of `count` photos is in each sample, `(1000, count)`."""
    return rng.multinomial(count, np.full(count, 1 / count), size=_RESAMPLES).astype(float)


def mean_colour(image_srgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the mean linear RGB `(3,)` of an object's pixels that the camera did not clip, or NaN.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        mask: coverage `(H, W, 1)` in [0, 1]; pixels of at least one half count.
    """
    counted = (mask[..., 0] >= 0.5) & (image_srgb.max(-1) < colour.CLIPPED)
    if not counted.any():
        return np.full(3, np.nan)
    return colour.srgb_to_linear(image_srgb[counted].astype(np.float64)).mean(0)


def angle(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the angle between linear colours `(..., 3)` in degrees; NaN if one is black."""
    one, other = _unit(one), _unit(other)
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.degrees(np.arctan2(across, np.sum(one * other, axis=-1)))


def unexplained_angle(albedo: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the angle from m_d to the nearest colour that Eq. 4 allows, in degrees, `(...)`.

    By Eq. 4, an object's mean pixel is m_d · D̄ plus something grey, m_a + m_s · S̄. So m_d lies on
    the arc that begins at the mean pixel and leads away from grey, to where a channel is 0. A right
    m_d has an angle of 0 whatever the object's gloss, if the photo's light is white.

    Args:
        albedo: m_d, linear RGB `(..., 3)`.
        pixels: mean of the object's pixels, linear RGB `(..., 3)`.
    """
    m_d, begin = _unit(albedo), _unit(pixels)
    end = begin - begin.min(axis=-1, keepdims=True)
    length = np.linalg.norm(end, axis=-1, keepdims=True)
    # Grey pixels have no direction away from grey: their arc is a point.
    end = np.where(length > 1e-9, end / np.maximum(length, 1e-9), begin)
    normal = np.cross(begin, end)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.maximum(size, 1e-12)
    # Inside the arc: past its begin and not past its end, both in the direction of the arc.
    inside = (np.sum(np.cross(normal, begin) * m_d, axis=-1) >= 0) & (
        np.sum(np.cross(normal, end) * m_d, axis=-1) <= 0
    )
    to_ends = np.minimum(angle(m_d, begin), angle(m_d, end))
    to_arc = np.degrees(np.arcsin(np.minimum(np.abs(np.sum(m_d * normal, axis=-1)), 1)))
    return np.where(inside & (size[..., 0] > 1e-12), to_arc, to_ends)


def _unit(rgb: np.ndarray) -> np.ndarray:
    """Return colours at length 1; NaN for black, NaN and infinite ones."""
    rgb = np.asarray(rgb, np.float64)
    length = np.linalg.norm(rgb, axis=-1, keepdims=True)
    usable = np.isfinite(length) & (length > 0)
    return np.divide(rgb, length, out=np.full_like(rgb, np.nan), where=usable)


# The table.


@dataclass(frozen=True)
class Measure:
    """A row of the table: title, format, and direction (1 more, −1 less, 0 neither is better).

    `of` takes the answers of the photos that count, those of the column `counted`, and returns the
    value with its bootstrap samples.
    """

    title: str
    form: str
    better: int
    counted: str | None
    of: Callable[[Answers], tuple[float, np.ndarray]]

    def measure(self, answers: Answers) -> tuple[float, np.ndarray, int]:
        """Return the value, its samples, and the number of photos."""
        counted = np.full(len(answers["pair"]), True) if not self.counted else answers[self.counted]
        chosen = {name: column[counted] for name, column in answers.items()}
        return *self.of(chosen), int(counted.sum())


def _order(of: Answers, score: Callable[[Answers], np.ndarray], *, paired: bool = False) -> Any:
    return gloss_order(score(of), of["glossy"], of["pair"] if paired else None)


def _peak(of: Answers) -> np.ndarray:
    return lobe_peak(of["specular_albedo"], of["exponent"])


def _log_ratio(of: Answers) -> np.ndarray:
    return np.log(np.maximum(of["specular_albedo"], LEAST_SPECULAR) / DIELECTRIC)


def _geometric_mean(of: Answers) -> tuple[float, np.ndarray]:
    value, samples = mean(_log_ratio(of))
    return np.exp(value), np.exp(samples)


def _within_factor_of_2(of: Answers) -> tuple[float, np.ndarray]:
    return mean((np.abs(_log_ratio(of)) <= np.log(2) + 1e-9).astype(float))


_BY_PEAK = functools.partial(_order, score=_peak)
_BY_EXPONENT = functools.partial(_order, score=lambda of: np.log10(of["exponent"]))
MEASURES = {
    "order_exponent": Measure("Gloss order by log10 s", ".2f", 1, "labelled", _BY_EXPONENT),
    "order_peak": Measure("Gloss order by m_s · c(s)", ".2f", 1, "labelled", _BY_PEAK),
    "pairs_peak": Measure(
        "in pairs, by m_s · c(s)", ".2f", 1, "paired", functools.partial(_BY_PEAK, paired=True)
    ),
    "specular_ratio": Measure(
        f"m_s of dielectrics over {DIELECTRIC:.2f}", ".1f", 0, "dielectric", _geometric_mean
    ),
    "within_2": Measure("within a factor of 2", ".0%", 1, "dielectric", _within_factor_of_2),
    "colour": Measure(
        "m_d to mean pixel, °", ".1f", -1, None,
        lambda of: mean(angle(of["diffuse_albedo"], of["pixels"])),
    ),
    "colour_grey": Measure(
        "a grey answer, °", ".1f", 0, None, lambda of: mean(angle(np.ones(3), of["pixels"]))
    ),
    "unexplained": Measure(
        "m_d to what pixels allow, °", ".1f", -1, None,
        lambda of: mean(unexplained_angle(of["diffuse_albedo"], of["pixels"])),
    ),
    "iou": Measure("IoU with the given mask", ".1%", 1, "masked", lambda of: mean(of["iou"])),
    "unanswered": Measure(
        "photos without an answer", ".0%", -1, None,
        lambda of: mean(np.isnan(of["exponent"]).astype(float)),
    ),
}  # fmt: skip


def measure_all(answers: Answers) -> dict[str, record.Figure]:
    """Return all measures of a column; those that cannot be told are NaN."""
    figures = {}
    for name, measure in MEASURES.items():
        value, samples, count = measure.measure(answers)
        figures[name] = record.Figure(float(value), _interval(samples), count)
    return figures


def _interval(samples: np.ndarray) -> tuple[float, float] | None:
    """Return the 95 % interval of bootstrap samples; None if they are all NaN."""
    known = samples[~np.isnan(samples)]
    if not known.size:
        return None
    low, high = np.percentile(known, (2.5, 97.5))
    return float(low), float(high)


def table(columns: Mapping[str, Answers]) -> str:
    """Return the measures as a Markdown table.

    + and − mark what is better and worse than the first model by more than the 95 % interval of the
    difference on the same photos.
    """
    first = next(iter(columns)).removesuffix(f", {OWN}")
    lines = [["measure", "photos", *columns]]
    for measure in MEASURES.values():
        cells = []
        for name, of in columns.items():
            reference = columns.get(f"{first}, {name.rpartition(', ')[2]}", of)
            _, baseline, _ = measure.measure(reference)
            value, samples, count = measure.measure(of)
            difference = _interval(measure.better * (samples - baseline))
            mark = "" if not difference else "+" if difference[0] > 0 else "−" * (difference[1] < 0)
            figure = record.Figure(float(value), _interval(samples))
            text = ABSENT if np.isnan(value) else f"{figure:{measure.form}[]} {mark}"
            cells.append(text.rstrip())
        lines.append([measure.title, str(count), *cells])
    return aligned(lines)


def listing(photos: Sequence[Photo], columns: Mapping[str, Answers]) -> str:
    """Return the photos with the answers of each model's own mask, the glossiest first."""
    own = {name: of for name, of in columns.items() if name.endswith(OWN)}
    order = np.argsort(-np.nan_to_num(_peak(next(iter(own.values()))), nan=-1), kind="stable")
    header = ["photo", "finish"]
    lines = [[photos[k].name, photos[k].finish or ABSENT] for k in order]
    for name, of in own.items():
        header += [f"{name.removesuffix(f', {OWN}')}: m_s · c(s)", "s", "m_s"]
        numbers = np.stack([_peak(of), of["exponent"], of["specular_albedo"]], axis=-1)
        for line, k in zip(lines, order, strict=True):
            line += [ABSENT if np.isnan(one) else f"{one:.3g}" for one in numbers[k]]
    return aligned([header, *lines], (0, 1))


if __name__ == "__main__":
    main()
