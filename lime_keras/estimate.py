"""From one photo to its material: the public Python interface.

Example:
    from lime_keras import Estimator
    from lime_keras.photo import read_srgb

    material = Estimator("runs/quickstart").estimate(read_srgb("photo.png"))
    print(material.diffuse_albedo, material.specular_albedo, material.exponent)
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras import colour, shininess, weights
from lime_keras.material import Material
from lime_keras.networks import answers, assemble
from lime_keras.photo import fit_square

NEEDED = {
    "mask": ("mask",),
    "specular": ("mask", "specular_shading"),
    "mirror": ("mask", "mirror"),
    "albedo": ("mask", "diffuse_albedo", "specular_albedo"),
    "exponent": ("mask", "exponent_bin_probabilities"),
    "diffuse": ("mask", "specular_shading", "specular_albedo"),
    "reflectance_map": ("mask", "reflectance_map"),
}
"""What can be asked for, and the outputs of the joined network that it takes.

Under regression the exponent takes `log_exponent`. Not every system has them all.
"""


class Estimator:
    """A trained model, loaded once and applied to many photos.

    Args:
        weights_folder: run of `lime-train` or folder of `lime_keras.weights.save`.
        only: what to estimate, out of `NEEDED`; only the subnetworks it takes are run. By default
            everything that this model can.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if `only` names nothing, or something that this model cannot estimate.
    """

    def __init__(self, weights_folder: str | Path, only: Collection[str] | None = None):
        self.architecture, subnetworks = weights.load(Path(weights_folder))
        needed = available(subnetworks)
        self._only = set(needed if only is None else only)
        unknown = sorted(self._only - set(needed))
        if unknown or not self._only:
            raise ValueError(
                f"cannot estimate {unknown}: {weights_folder} holds "
                f"{self.architecture.description}; choose from {', '.join(needed)}"
            )
        outputs = {output for name in self._only for output in needed[name]}
        self._network = assemble(subnetworks, sorted(outputs))

    def estimate(self, image_srgb: np.ndarray) -> Material:
        """Estimate the material of the object in a photo.

        Args:
            image_srgb: `(H, W, 3)` sRGB in [0, 1]; one object of uniform material, near the middle.

        Returns:
            The material; its layers are `S` × `S`, the network's size, over the photo fitted into a
            square (`lime_keras.photo.fit_square`).

        Raises:
            ValueError: if the image has another shape, is not finite or leaves [0, 1].
        """
        image_srgb = np.asarray(image_srgb, np.float32)
        if image_srgb.ndim != 3 or image_srgb.shape[-1] != 3 or image_srgb.size == 0:
            raise ValueError(f"a photo has shape (H, W, 3), got {image_srgb.shape}")
        if not np.all((image_srgb >= 0) & (image_srgb <= 1)):
            raise ValueError("a photo's values are finite and in [0, 1]: divide 8-bit ones by 255")
        square = fit_square(image_srgb, self.architecture.size)
        answer = {name: np.array(v)[0] for name, v in self._network(square[None]).items()}
        return self._material(square, answer)

    def _material(self, square: np.ndarray, answer: dict[str, np.ndarray]) -> Material:
        """Gather what was asked for."""
        only = self._only
        fields: dict[str, Any] = {}
        layers = {"mask": answer["mask"]}
        if "specular" in only:
            layers["specular_shading"] = answer["specular_shading"]
        if "mirror" in only:
            layers["mirror"] = answer["mirror"]
        if "albedo" in only:
            fields["diffuse_albedo"] = answer["diffuse_albedo"]
            fields["specular_albedo"] = float(answer["specular_albedo"][0])
        if "diffuse" in only:
            specular = answer["specular_albedo"] * answer["specular_shading"]
            diffuse = np.maximum(colour.srgb_to_linear(square) - specular, 0)
            layers["diffuse"] = diffuse * answer["mask"]
        if "reflectance_map" in only:
            # Nothing was ever asked of the network beside the sphere.
            layers["reflectance_map"] = answer["reflectance_map"]
        if "log_exponent" in answer:
            fields["exponent"] = float(10.0 ** answer["log_exponent"][0])
        elif "exponent" in only:
            probabilities = answer["exponent_bin_probabilities"]
            fields["exponent"] = float(10.0 ** shininess.log_expected(probabilities))
            fields["exponent_bin_probabilities"] = probabilities
            fields["exponent_entropy"] = float(shininess.entropy(probabilities))
        coverage = float(np.mean(answer["mask"] >= 0.5))
        return Material(mask_coverage=coverage, layers=layers, **fields)


def available(subnetworks: Mapping[str, keras.Model]) -> dict[str, tuple[str, ...]]:
    """`NEEDED` of these subnetworks, without what they cannot estimate."""
    known = answers(subnetworks)
    regression = {"exponent": ("mask", "log_exponent")} if "log_exponent" in known else {}
    needed = NEEDED | regression
    return {name: outputs for name, outputs in needed.items() if set(outputs) <= set(known)}
