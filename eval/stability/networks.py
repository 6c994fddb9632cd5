"""Cases for whole systems with extreme images: precisions, batches, exported formats.

Outputs are compared with `double_precision`. Its random rounding errors of each precision determine
the tolerance.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .photos import extreme_photos
from .precisions import SINGLE, TENSORS, Precision
from .systems import BATCH, Answers, TrialSystem
from .verdicts import Case, Compared, Outcome, joined

FORMATS = {"savedmodel": "SavedModel", "onnx": "ONNX"}
_SQUARABLE = 1e15
"""Largest derivative accepted, so that the optimiser can square it in single precision."""
_IN_A_BATCH = f"all images, in a batch of {BATCH} that ends in NaN"


def cases(part: str, system: TrialSystem, precisions: Sequence[Precision] = TENSORS) -> list[Case]:
    """Return the cases of a system that Keras runs: images, batches and derivatives.

    Its name in the tables is `part`.
    """
    out = []

    def add(name: str, precision: Precision, measure: Callable[..., Outcome], *more: Any) -> None:
        measure = functools.partial(measure, system, *more)
        out.append(Case(part, name, precision.name, measure))

    for precision in precisions:
        for image in extreme_photos(2):
            add(image, precision, _alone, precision, image)
        add(_IN_A_BATCH, precision, _in_a_batch, precision)
        if not precision.compiled:
            add("derivatives by the weights, all images", precision, _derivatives, precision)
    for image in extreme_photos(2):
        add(f"{image}, estimated", SINGLE, _estimated, image)
    return out


def exports(part: str, system: TrialSystem) -> list[Case]:
    """Return the cases of a system in the formats that `lime-export` writes."""
    out = []
    for model_format, title in FORMATS.items():
        measures = {
            image: functools.partial(_exported, system, model_format, image)
            for image in extreme_photos(2)
        }
        measures["an image alone"] = functools.partial(_exported_alone, system, model_format)
        measures[_IN_A_BATCH] = functools.partial(_exported_batch, system, model_format)
        out += [Case(part, name, title, measure) for name, measure in measures.items()]
    return out


def _alone(system: TrialSystem, precision: Precision, image: str) -> Outcome:
    """Try an image in a batch of one."""
    found = system.answers(precision, system.images[image][None])
    return Outcome(system.compared(image, found, precision.epsilon))


def _derivatives(system: TrialSystem, precision: Precision) -> Outcome:
    """Try the derivatives by the weights: the optimiser must be able to square them."""
    steepest = system.steepest(precision)
    return Outcome(gradient=Compared(steepest, 0.0, _SQUARABLE, 0.0))


def _in_a_batch(system: TrialSystem, precision: Precision) -> Outcome:
    """Try all images in one batch: position and other images must not change an output."""
    return _every(system, system.answers(precision, system.batch[1]), precision)


def _exported_batch(system: TrialSystem, model_format: str) -> Outcome:
    return _every(system, system.served_batch(model_format), SINGLE)


def _every(system: TrialSystem, found: Answers, precision: Precision) -> Outcome:
    return Outcome(
        joined(
            system.compared(image, _at(position, found), precision.epsilon)
            for position, image in enumerate(system.batch[0])
        )
    )


def _at(position: int, found: Answers) -> Answers:
    """Return the outputs of one image in a batch."""
    return {name: x[position : position + 1] for name, x in found.items()}


def _exported(system: TrialSystem, model_format: str, image: str) -> Outcome:
    """Compare an exported model on a batch with Keras on one image; both may have errors."""
    position = system.batch[0].index(image)
    return _beside_keras(system, image, _at(position, system.served_batch(model_format)))


def _exported_alone(system: TrialSystem, model_format: str) -> Outcome:
    image = "in steps of 16 bits"
    return _beside_keras(system, image, system.served(model_format, system.images[image][None]))


def _beside_keras(system: TrialSystem, image: str, found: Answers) -> Outcome:
    right = system.answers(SINGLE, system.images[image][None])
    return Outcome(system.compared(image, found, SINGLE.epsilon, right))


def _estimated(system: TrialSystem, image: str) -> Outcome:
    """Try the public interface: its outputs must be correct and within their ranges."""
    material = system.estimator.estimate(system.images[image])
    found: Answers = {name: np.asarray(layer)[None] for name, layer in material.layers.items()}
    # Where no object is found, nothing else is estimated.
    if material.mask_coverage:
        found["diffuse_albedo"] = np.asarray(material.diffuse_albedo)[None]
        found["specular_albedo"] = np.array([[material.specular_albedo]])
    exact, tolerance = system.exact(image), system.tolerance(image, SINGLE.epsilon)
    parts = [
        Compared(found[name], exact[name], exact[name], tolerance[name])
        for name in exact.keys() & found.keys()
    ]
    if "diffuse" in found:
        parts.append(Compared(found["diffuse"], 0.0, 1.0, 0.0))
    parts.append(Compared(np.array(material.mask_coverage), 0.0, 1.0, 0.0))
    if material.mask_coverage:
        parts.append(Compared(np.array(material.exponent), 1.0, 1000.0, 1e-3))
    return Outcome(joined(parts))
