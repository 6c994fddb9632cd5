"""The words with which tables and reports describe classes, exponents and oracles."""

import numpy as np

from lime_keras.networks import SUBNETWORKS, Architecture, subnetwork_names
from lime_keras.optics import shininess


def bin_label(k: int) -> str:
    """Return the range of exponents of class `k` as text, such as "s 13.3–31.6"."""
    low, high = np.round(10.0 ** shininess.LOG_EDGES[k : k + 2], 1)
    return f"s {low:g}–{high:g}"


def exponent(architecture: Architecture) -> str:
    """Return how log10 s and its bin are computed from the system's outputs, in words."""
    if architecture.exponent == "regression":
        return "the system answers log10 s itself; its bin is the one that s falls into"
    return "log10 s is the expected value over the eight classes, or that of the winning bin"


def oracle(architecture: Architecture) -> str:
    """Return the title of the oracle."""
    if architecture.system == "reflectance-map":
        return "Same encoder on the true reflectance map"
    return "Same encoders on true layers"


def oracle_is(architecture: Architecture) -> str:
    """Return a description of the oracle: its subnetworks, their inputs and their weights."""
    names = [name for name in subnetwork_names(architecture) if SUBNETWORKS[name].encoder]
    encoders = " and ".join(f"{name.title()}Net" for name in names)
    if architecture.system == "reflectance-map":
        given = "the true reflectance map"
    else:
        given = f"the true {'mask, S and M' if architecture.mirror else 'mask and S'}"
    return (
        f"{encoders} given {given}, as they are in the system; where joined training has fitted "
        "them to estimates, those of stage one read the truth better"
    )
