"""Cases for normals as octahedral codes, and for the symmetries of the square that turn them."""

import functools
import itertools
import math

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import octahedral
from lime_keras.synthesis import symmetries
from lime_keras.synthesis.symmetries import SYMMETRIES

from ..lights import unit
from ..precisions import NUMPY_SINGLE, SINGLE, Precision
from ..refusals import refusal

_COARSE = math.radians(0.06)
"""Largest angle by which a code turns a direction."""
_AXES = {
    f"{'-' * (sign < 0)}{'xyz'[axis]}": sign * np.eye(3)[axis]
    for axis in range(3)
    for sign in (1, -1)
}
_DIRECTIONS = (
    _AXES
    | {f"corner {signs}": np.array(signs, float) for signs in itertools.product((1, -1), repeat=3)}
    | {
        "z of 1e-30": np.array([0.6, 0.8, 1e-30]),
        "z of -1e-30": np.array([0.6, 0.8, -1e-30]),
        "z of -0": np.array([0.6, -0.8, -0.0]),
        "x and y of 1e-30": np.array([1e-30, -1e-30, -1.0]),
        "length 1e-30": 1e-30 * np.array([0.3, -0.5, -0.8]),
        "length 1e30": 1e30 * np.array([-0.3, 0.5, 0.8]),
        "on the fold": np.array([0.5, 0.5, 1e-9]),
        "behind, next to the axis": np.array([1e-4, 1e-4, -1.0]),
    }
)
_UNSOUND = {"zero": 0.0, "NaN": np.nan, "infinite": np.inf}
_SIDE = 4


def cases() -> list[Case]:
    """Return the cases of codes and of symmetries."""
    out = [
        Case("normals as codes", name, precision.name, functools.partial(_coded, name, precision))
        for name in _DIRECTIONS
        for precision in (NUMPY_SINGLE, SINGLE)
    ]
    for name, value in _UNSOUND.items():
        measure = functools.partial(_refused, value)
        out.append(Case("normals as codes", f"{name}, refused", NUMPY_SINGLE.name, measure))
    for which in range(SYMMETRIES):
        measure = functools.partial(_turned, which)
        case = f"symmetry {which} of normals and camera"
        out.append(Case("symmetries", case, NUMPY_SINGLE.name, measure))
        measure = functools.partial(_back, which)
        case = f"symmetry {which}, and back"
        out.append(Case("symmetries", case, NUMPY_SINGLE.name, measure))
    return out


def _coded(name: str, precision: Precision) -> Outcome:
    """Try a direction, which comes back within the codes' steps, and an axis exactly."""
    codes = octahedral.encode(_DIRECTIONS[name][None])
    if precision.tensors:
        found = precision.value(octahedral.decode, codes)
    else:
        found = np.asarray(octahedral.decode(codes), np.float64)
    right = unit(_DIRECTIONS[name][None] / np.abs(_DIRECTIONS[name]).max())
    steps = 0.0 if name in _AXES else _COARSE
    length = np.linalg.norm(found, axis=-1)
    found, right = np.append(found, length), np.append(right, 1.0)
    tolerance = precision.tolerance(1.0) + np.array([steps] * 3 + [0.0])
    return Outcome(Compared(found, right, right, tolerance))


def _refused(value: float) -> Outcome:
    vectors = np.array([[0.0, 0.0, 1.0], [value, 0.0, 0.0]])
    return refusal(lambda: octahedral.encode(vectors), "zero or not finite", "mend the shape")


def _gbuffer() -> dict[str, np.ndarray]:
    normal = unit(np.random.default_rng(0).normal(size=(2 * _SIDE**2, 3)))
    # No pixel sees a surface that faces away.
    normal[:, 2] = np.abs(normal[:, 2])
    normal[:5] = [axis for name, axis in _AXES.items() if name != "-z"]
    return {
        "coverage": np.arange(_SIDE**2, dtype=np.float32).reshape(1, _SIDE, _SIDE),
        "share": np.ones((1, _SIDE, _SIDE), np.float32),
        "normal": octahedral.encode(normal).reshape(1, 2, _SIDE, _SIDE, 2),
        "spread": np.zeros((1, 2, _SIDE, _SIDE), np.float32),
        "camera": np.array([[5.0, 6.0, 1.5, 2.25]], np.float32),
    }


def _turned(which: int) -> Outcome:
    """Try one symmetry: pixels, the x and y of normals, and the camera must move together."""
    given = _gbuffer()
    found = symmetries.turned(given, np.array([which]))
    normal = np.asarray(octahedral.decode(given["normal"][0]), np.float64)
    coverage = given["coverage"][0]
    fx, fy, cx, cy = given["camera"][0]
    if which & 4:
        coverage, normal = coverage.T, normal.swapaxes(1, 2)
        normal = normal[..., [1, 0, 2]] * [-1, -1, 1]
        fx, fy, cx, cy = fy, fx, cy, cx
    if which & 2:
        coverage, normal, cy = coverage[::-1], normal[:, ::-1] * [1, -1, 1], _SIDE - cy
    if which & 1:
        coverage, normal, cx = coverage[:, ::-1], normal[:, :, ::-1] * [-1, 1, 1], _SIDE - cx
    decoded = np.asarray(octahedral.decode(found["normal"][0]), np.float64)
    numbers = [coverage, (fx, fy, cx, cy), normal]
    right = np.concatenate([np.ravel(part) for part in numbers])
    answers = np.concatenate(
        [np.ravel(part) for part in (found["coverage"], found["camera"], decoded)]
    )
    return Outcome(Compared(answers, right, right, NUMPY_SINGLE.tolerance(1.0)))


def _back(which: int) -> Outcome:
    """Try a symmetry and its inverse: quarter turns are each other's, the rest their own."""
    given = _gbuffer()
    inverse = {5: 6, 6: 5}.get(which, which)
    there = symmetries.turned(given, np.array([which]))
    found = symmetries.turned(there, np.array([inverse]))
    names = ("coverage", "normal", "camera")
    answers, right = (
        np.concatenate([np.asarray(part[name], np.float64).ravel() for name in names])
        for part in (found, given)
    )
    return Outcome(Compared(answers, right, right, 0.0))
