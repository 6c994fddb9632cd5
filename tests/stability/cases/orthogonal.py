"""Cases for Muon's Newton–Schulz steps, which make a kernel's momentum orthogonal.

The optimiser's state stays in single precision, and there the steps are compared with the same
polynomial of the singular values, in double precision. In half precision noise of a relative size
of epsilon is amplified like any small singular value; what must hold is that nothing is NaN or
infinite and that no direction grows beyond what the polynomial reaches. In float16 the squares of
small numbers are 0, and a matrix of them is not divided by its norm: these are not tried, and are
why the optimiser does not compute in float16.
"""

import functools
from typing import Any

import keras
import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome

from ..precisions import ROUNDINGS, TENSORS, Precision

_STEPS = 5
_A, _B, _C = 3.4445, -4.7750, 2.0315
_HIGHEST = 1.22  # A bound of the polynomial's value on [0, 1], whatever the number of steps
_FLOOR = 1e-7  # added to the norm that a matrix is divided by, so that one of zeros stays so


def _matrices() -> dict[str, np.ndarray]:
    """Return matrices `(72, 8)` by name: those of kernels `(3, 3, 8, 8)`."""
    rng = np.random.default_rng(3)
    drawn = rng.normal(size=(72, 8))
    left, _, right = np.linalg.svd(drawn, full_matrices=False)
    single = np.zeros((72, 8))
    single[17, 3] = 1.0
    return {
        "zero": 0 * drawn,
        "random": drawn,
        "of 1e-30": 1e-30 * drawn,
        "of 1e-7": 1e-7 * drawn,
        "of 1e15": 1e15 * drawn,
        "orthogonal": left @ right,
        "rank one": np.outer(left[:, 0], right[0]),
        "equal entries": np.full((72, 8), 0.1),
        "one entry": single,
        "singular values from 1 to 1e-6": left * np.logspace(0, -6, 8) @ right,
        "one entry 1e4 times the others": 1e-2 * drawn + 1e2 * single,
    }


def cases() -> list[Case]:
    """Return the cases of Newton–Schulz steps."""
    out = []
    for name, tall in _matrices().items():
        for shape, matrix in (("tall", tall), ("wide", tall.T)):
            for precision in TENSORS:
                largest = float(np.abs(matrix).max())
                normed = precision.least < _FLOOR**2 or precision.holds(largest**2)
                if precision.holds(largest) and normed:
                    measure = functools.partial(_made_orthogonal, matrix, precision)
                    case = f"{shape} matrix, {name}"
                    out.append(Case("Newton-Schulz steps", case, precision.name, measure))
    return out


@functools.cache
def _muon() -> keras.optimizers.Muon:
    return keras.optimizers.Muon()


def _steps(matrix: Any) -> Any:
    return _muon().zeropower_via_newtonschulz5(matrix, _STEPS)


def _made_orthogonal(matrix: np.ndarray, precision: Precision) -> Outcome:
    found = precision.value(_steps, matrix)
    size = np.sqrt(matrix.size)
    if precision.dtype != "float32":
        finite = np.where(np.isfinite(found), found, 0.0)
        sizes = np.append(np.linalg.svd(finite, compute_uv=False), np.abs(found).max())
        return Outcome(Compared(sizes, 0.0, _HIGHEST, ROUNDINGS * precision.epsilon * size))
    left, values, right = np.linalg.svd(precision.rounded(matrix), full_matrices=False)
    values = values / (np.linalg.norm(values) + _FLOOR)
    slope = np.ones_like(values)
    for _ in range(_STEPS):
        slope = slope * np.abs(_A + 3 * _B * values**2 + 5 * _C * values**4)
        values = _A * values + _B * values**3 + _C * values**5
    expected = left * values @ right
    # Where the matrix has nothing, rounding errors grow as small singular values do.
    steepest = max(_A**_STEPS, slope.max())
    tolerance = precision.tolerance(steepest * min(1.0, np.abs(values).max()), terms=matrix.size)
    return Outcome(Compared(found, expected, expected, tolerance))
