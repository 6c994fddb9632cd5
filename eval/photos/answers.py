"""The answers of models for photos, with their own masks and with given ones."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lime_keras.console import Bar
from lime_keras.estimate.estimator import Estimator
from lime_keras.io import photo as photo_files
from lime_keras.material import Material
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.outputs import available
from lime_keras.runtime import engine as runtime

from . import measures
from .folder import Photo

OWN, GIVEN = "own mask", "given mask"
"""Masks with which a model answers: the one it finds; the given one of the photos that have one."""


Answers = dict[tuple[str, str], dict[str, np.ndarray]]
"""The answers of some models for some photos, in one order: for each model and mask (`OWN`,
`GIVEN`) the columns of all photos, by name.

`mask_given` `(N,)` says whether the row is of a given mask, `found` `(N,)` whether there is an
answer. Without one the numbers are NaN: `diffuse_albedo` `(N, 3)` linear, `specular_albedo`,
`exponent`, `log_exponent` and `lobe_peak` (`measures.lobe_peak`) `(N,)`. Of the mask `coverage`
`(N,)` and, of an own mask where one is given, `iou` `(N,)`. Of the photo, `object_colour` and
`frame_colour` `(N, 3)`: mean linear RGB of the object, inside the given mask or else the own one,
and of the whole photo. In the columns of `GIVEN`, photos without a mask have the row of `OWN`; if
no photo has one, these columns are left out.
"""


def answer(photos: Sequence[Photo], runs: Mapping[str, Path]) -> Answers:
    """Estimate photos with each of the runs, with and without their given masks.

    A photo that is partly transparent brings its mask, unless it has a file of one.

    Args:
        photos: photos to estimate.
        runs: folder of each trained model, by the name of the model.

    Raises:
        FileNotFoundError: if a folder holds no trained model.
        ValueError: if a photo or a mask cannot be read, or a mask has another size than its photo.
    """
    estimators = {name: _estimator(run) for name, run in runs.items()}
    rows: dict[tuple[str, str], list[dict[str, object]]] = {
        (name, mask): [] for name in runs for mask in (OWN, GIVEN)
    }
    with Bar("estimating", "photo") as bar:
        bar.move(0, len(photos))
        for position, photo in enumerate(photos):
            image, mask = photo_files.read(photo.path)
            if photo.mask is not None:
                mask = photo_files.read_mask(photo.mask, *image.shape[:2])
            for name, estimator in estimators.items():
                own = estimator.estimate(image)
                rows[name, OWN].append(_row(image, own, mask, given=False))
                if mask is None:
                    rows[name, GIVEN].append(rows[name, OWN][-1])
                else:
                    by_mask = estimator.estimate(image, mask)
                    rows[name, GIVEN].append(_row(image, by_mask, mask, given=True))
            bar.move(position + 1, len(photos))
    columns = {
        key: {name: np.array([row[name] for row in of_key]) for name in of_key[0]}
        for key, of_key in rows.items()
    }
    if not any(columns[name, GIVEN]["mask_given"].any() for name in runs):
        columns = {key: of_key for key, of_key in columns.items() if key[1] == OWN}
    return columns


def _estimator(run: Path) -> Estimator:
    """Return the estimator of the mask and of what a model can tell of the material's numbers."""
    outputs = runtime.load(run).outputs
    asked = ("mask", "albedo", "exponent")
    return Estimator(run, [name for name in available(outputs) if name in asked])


def _row(
    image: np.ndarray, material: Material, mask: np.ndarray | None, *, given: bool
) -> dict[str, object]:
    """Return the numbers of one answer (see `Answers`)."""
    answered = _answered(material)
    nothing = BlinnPhong(np.full(3, np.nan), np.nan, np.nan)
    numbers = nothing if answered is None else answered
    own = material.layers["mask"]
    return {
        "mask_given": given,
        "found": answered is not None,
        "coverage": material.mask_coverage,
        "iou": np.nan if given or mask is None else measures.overlap(mask, own),
        "diffuse_albedo": numbers.diffuse_albedo,
        "specular_albedo": numbers.specular_albedo,
        "exponent": numbers.exponent,
        "log_exponent": np.log10(np.maximum(numbers.exponent, 1e-6)),
        "lobe_peak": measures.lobe_peak(numbers.specular_albedo, numbers.exponent),
        "object_colour": measures.mean_colour(image, own if mask is None else mask),
        "frame_colour": measures.mean_colour(image, np.ones_like(own)),
    }


def _answered(material: Material) -> BlinnPhong | None:
    """Return the estimated numbers; None if no object was found or one of them is not finite."""
    whole = material.whole()
    if whole is None or not material.mask_coverage:
        return None
    numbers = [*whole.diffuse_albedo, whole.specular_albedo, whole.exponent]
    return whole if np.all(np.isfinite(numbers)) else None
