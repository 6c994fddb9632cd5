"""Whole systems shown the strangest images: precisions, batches, exported formats, refusals.

Answers are held against `double_precision`; how much they may differ is learnt there from random
rounding errors of the precision's size.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras import weights

from .extremes_photos import images
from .precisions import BRAIN, HALF, SINGLE, TENSORS, Precision
from .trial_systems import FRESH, Answers, TrialSystem
from .verdicts import Case, Compared, Outcome, joined, refusal

FORMATS = {"savedmodel": "SavedModel", "onnx": "ONNX"}
_SQUARABLE = 1e15
"""What the optimiser can square in single precision."""
_BATCH = 64
_IN_A_BATCH = f"all images, in a batch of {_BATCH}"
_BESIDE_NAN = f"{_IN_A_BATCH}, the last of which is NaN"
_UNSOUND: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "a NaN pixel": lambda image: _with_pixel(image, np.nan),
    "an infinite pixel": lambda image: _with_pixel(image, np.inf),
    "a pixel of -0.1": lambda image: _with_pixel(image, -0.1),
    "levels up to 255": lambda image: 255 * image,
    "no colours": lambda image: image[..., 0],
    "an alpha channel": lambda image: np.concatenate([image, image[..., :1]], axis=-1),
    "no pixels": lambda image: image[:0],
}


def cases(model_dir: Path | None = None) -> list[Case]:
    """Every case of these parts.

    Args:
        model_dir: of a trained system; without one, those of `trial_systems.FRESH` are tried.
    """
    if model_dir is not None:
        system = TrialSystem(model_dir)
        return _cases("trained system", system) + _exports("trained system", system)
    systems = {f"fresh {name}": TrialSystem(architecture=a) for name, a in FRESH.items()}
    # The baseline is made of the same layers: that is enough of compiling and exporting.
    out = _cases("fresh LIME", systems["fresh LIME"])
    out += _cases("fresh baseline", systems["fresh baseline"], (SINGLE, HALF, BRAIN))
    return out + _exports("fresh LIME", systems["fresh LIME"])


def check(model_dir: Path) -> None:
    """Refuse a folder that holds no model, before anything is tried.

    Raises:
        FileNotFoundError: if it holds none.
        ValueError: if the model cannot be read.
    """
    weights.load(model_dir)


def _cases(part: str, system: TrialSystem, precisions: Sequence[Precision] = TENSORS) -> list[Case]:
    out = []

    def add(name: str, precision: Precision, measure: Callable[..., Outcome], *more: Any) -> None:
        measure = functools.partial(measure, system, *more)
        out.append(Case(part, name, precision.name, measure))

    for precision in precisions:
        for image in images(2):
            add(image, precision, _alone, precision, image)
        answer = functools.partial(system.answers, precision)
        add(_IN_A_BATCH, precision, _in_a_batch, answer, precision)
        add(_BESIDE_NAN, precision, _in_a_batch, answer, precision, np.nan)
        if not precision.compiled:
            add("derivatives by the weights, all images", precision, _derivatives, precision)
    for image in images(2):
        add(f"{image}, estimated", SINGLE, _estimated, image)
    for name, spoil in _UNSOUND.items():
        add(f"{name}, refused", SINGLE, _refused, spoil)
    return out


def _exports(part: str, system: TrialSystem) -> list[Case]:
    out = []
    for model_format, title in FORMATS.items():
        answer = functools.partial(system.served, model_format)
        measures = {
            image: functools.partial(_exported, system, model_format, image) for image in images(2)
        }
        measures["an image alone"] = functools.partial(_exported_alone, system, answer)
        measures[_IN_A_BATCH] = functools.partial(_in_a_batch, system, answer)
        measures[_BESIDE_NAN] = functools.partial(_in_a_batch, system, answer, last=np.nan)
        out += [Case(part, name, title, measure) for name, measure in measures.items()]
    return out


def _alone(system: TrialSystem, precision: Precision, image: str) -> Outcome:
    """A batch of one."""
    found = system.answers(precision, system.images[image][None])
    tolerance = system.tolerance(image, precision.epsilon)
    return Outcome(_compared(found, system.exact(image), tolerance))


def _derivatives(system: TrialSystem, precision: Precision) -> Outcome:
    """Small enough for the optimiser, which squares them."""
    steepest = system.steepest(precision)
    return Outcome(gradient=Compared(steepest, 0.0, _SQUARABLE, 0.0))


def _in_a_batch(
    system: TrialSystem,
    answer: Callable[[np.ndarray], Answers],
    precision: Precision = SINGLE,
    last: float | None = None,
) -> Outcome:
    """Every image, wherever it stands in the batch, and whatever the last one is."""
    names = list(system.images)
    order = [names[position % len(names)] for position in range(_BATCH)]
    batch = np.stack([system.images[image] for image in order])
    if last is not None:
        batch[-1], order = last, order[:-1]
    found = answer(batch)
    parts = []
    for position, image in enumerate(order):
        here = {name: x[position : position + 1] for name, x in found.items()}
        tolerance = system.tolerance(image, precision.epsilon)
        parts.append(_compared(here, system.exact(image), tolerance))
    return Outcome(joined(parts))


def _exported(system: TrialSystem, model_format: str, image: str) -> Outcome:
    """In a batch of all, against Keras, which sees one; both may err."""
    return _beside_keras(system, image, system.served_images(model_format)[image])


def _exported_alone(system: TrialSystem, answer: Callable[[np.ndarray], Answers]) -> Outcome:
    image = "in steps of 16 bits"
    return _beside_keras(system, image, answer(system.images[image][None]))


def _beside_keras(system: TrialSystem, image: str, found: Answers) -> Outcome:
    right = system.answers(SINGLE, system.images[image][None])
    twice = {name: 2 * x for name, x in system.tolerance(image, SINGLE.epsilon).items()}
    return Outcome(_compared(found, right, twice))


def _estimated(system: TrialSystem, image: str) -> Outcome:
    """What the public interface answers, and that it is within its ranges."""
    material = system.estimator.estimate(system.images[image])
    found: Answers = {name: np.asarray(layer)[None] for name, layer in material.layers.items()}
    found["diffuse_albedo"] = np.asarray(material.diffuse_albedo)[None]
    found["specular_albedo"] = np.array([[material.specular_albedo]])
    exact, tolerance = system.exact(image), system.tolerance(image, SINGLE.epsilon)
    shared = found.keys() & exact.keys()
    parts = [_compared(*({name: x[name] for name in shared} for x in (found, exact, tolerance)))]
    if "diffuse" in found:
        parts.append(Compared(found["diffuse"], 0.0, 1.0, 0.0))
    parts.append(Compared(np.array(material.mask_coverage), 0.0, 1.0, 0.0))
    parts.append(Compared(np.array(material.exponent), 1.0, 1000.0, 1e-3))
    return Outcome(joined(parts))


def _refused(system: TrialSystem, spoil: Callable[[np.ndarray], np.ndarray]) -> Outcome:
    photo = spoil(system.images["in steps of 16 bits"])
    return refusal(lambda: system.estimator.estimate(photo), "photo")


def _with_pixel(image: np.ndarray, value: float) -> np.ndarray:
    out = image.copy()
    out[1, 2, 0] = value
    return out


def _compared(
    found: Mapping[str, np.ndarray], right: Mapping[str, np.ndarray], tolerance: Answers
) -> Compared:
    """All answers in one row."""
    if set(found) != set(right):
        raise ValueError(f"answers {sorted(found)}, expected {sorted(right)}")
    return joined([Compared(found[name], x, x, tolerance[name]) for name, x in right.items()])
