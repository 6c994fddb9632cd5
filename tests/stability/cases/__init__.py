"""The cases of plain functions and small systems, a module for each part of the package."""

from lime_keras.eval.stability.verdicts import Case

from . import (
    camera,
    colour,
    compositing,
    environment,
    exponent,
    hue,
    losses,
    materials,
    metrics,
    networks,
    orthogonal,
    page,
    reflectance,
    reflectance_map,
    runtime,
    shading,
)

_MODULES = (
    reflectance,
    shading,
    environment,
    reflectance_map,
    colour,
    compositing,
    losses,
    exponent,
    metrics,
    materials,
    camera,
    hue,
    orthogonal,
    page,
    networks,
    runtime,
)
"""The modules in the order of the tables."""


def every_case() -> list[Case]:
    """Return the cases of all modules, without computing anything."""
    return [case for module in _MODULES for case in module.cases()]
