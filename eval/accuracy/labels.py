"""Words for what tables and reports show."""

import numpy as np

from lime_keras.networks import Architecture
from lime_keras.optics import shininess


def bin_label(k: int) -> str:
    """The exponents of class `k`, such as "s 13.3–31.6"."""
    low, high = np.round(10.0 ** shininess.LOG_EDGES[k : k + 2], 1)
    return f"s {low:g}–{high:g}"


def exponent(architecture: Architecture) -> str:
    """How an exponent is read off the answer."""
    if architecture.exponent == "regression":
        return "the system answers log10 s itself; its bin is the one that s falls into"
    return "log10 s is the expected value over the eight classes, or that of the winning bin"


def oracle(architecture: Architecture, stage_one: bool) -> str:
    """What `Evaluation.oracle` is, in few words.

    Args:
        architecture: of the system.
        stage_one: as of `Evaluation`.
    """
    whose = "Stage-one" if stage_one else "Same"
    if architecture.system == "reflectance-map":
        return f"{whose} encoder on the true reflectance map"
    return f"{whose} encoders on true layers"


def oracle_is(architecture: Architecture, stage_one: bool) -> str:
    """Which subnetworks `Evaluation.oracle` is, what they are given, and what to make of it.

    Args:
        architecture: of the system.
        stage_one: as of `Evaluation`.
    """
    if architecture.system == "reflectance-map":
        which, given = "MaterialNet", "the true reflectance map"
    else:
        which = "ExponentNet and AlbedoNet"
        given = f"the true {'mask, S and M' if architecture.mirror else 'mask and S'}"
    if stage_one:
        return f"{which} given {given}, as before joined training fitted them to estimates"
    return (
        f"{which} given {given}, as they are in the system; where joined training has fitted them "
        "to estimates, those of stage one read the truth better"
    )
