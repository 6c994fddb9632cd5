"""The words with which tables and reports describe classes, exponents and oracles."""

from collections.abc import Collection

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


def oracle(architecture: Architecture, stage_one: Collection[str]) -> str:
    """Return the title of the oracle.

    Args:
        architecture: architecture of the system.
        stage_one: names of its encoders that have the weights of stage one (see `Evaluation`).
    """
    lone, others = _encoders(architecture, stage_one)
    whose = "Some stage-one" if lone and others else "Stage-one" if lone else "Same"
    if architecture.system == "reflectance-map":
        return f"{whose} encoder on the true reflectance map"
    return f"{whose} encoders on true layers"


def oracle_is(architecture: Architecture, stage_one: Collection[str]) -> str:
    """Return a description of the oracle: its subnetworks, their inputs and their weights.

    Args:
        architecture: architecture of the system.
        stage_one: names of its encoders that have the weights of stage one (see `Evaluation`).
    """
    lone, others = _encoders(architecture, stage_one)
    if architecture.system == "reflectance-map":
        given = "the true reflectance map"
    else:
        given = f"the true {'mask, S and M' if architecture.mirror else 'mask and S'}"
    kept = "as before joined training fitted them to estimates"
    same = (
        "as they are in the system; where joined training has fitted them to estimates, those of "
        "stage one read the truth better"
    )
    if lone and others:
        return f"{lone} given {given}, {kept}, and {others} {same}"
    return f"{lone or others} given {given}, {kept if lone else same}"


def _encoders(architecture: Architecture, stage_one: Collection[str]) -> tuple[str, str]:
    """Return in words the encoders that have the weights of stage one, and the others."""
    encoders = [name for name in subnetwork_names(architecture) if SUBNETWORKS[name].encoder]
    lone, others = (
        " and ".join(f"{name.title()}Net" for name in encoders if (name in stage_one) is kept)
        for kept in (True, False)
    )
    return lone, others
