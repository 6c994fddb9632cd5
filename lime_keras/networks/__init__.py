"""The subnetworks of the paper's section 5 as functional Keras models, and their assembly."""

from lime_keras.networks.architecture import PRESETS, Architecture
from lime_keras.networks.registry import SUBNETWORKS
from lime_keras.networks.system import assemble, build, output_names, subnetwork_names

__all__ = [
    "PRESETS",
    "SUBNETWORKS",
    "Architecture",
    "assemble",
    "build",
    "output_names",
    "subnetwork_names",
]
