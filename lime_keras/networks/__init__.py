"""The subnetworks of section 5, each a functional Keras model, and their assembly."""

from lime_keras.networks.architecture import PRESETS, Architecture
from lime_keras.networks.registry import SUBNETWORKS
from lime_keras.networks.system import answers, assemble, build, names

__all__ = [
    "PRESETS",
    "SUBNETWORKS",
    "Architecture",
    "answers",
    "assemble",
    "build",
    "names",
]
