"""A stage as a Keras model: wiring, losses, and nothing else.

Written in `keras.ops` alone, so that it trains under any Keras backend.
"""

from collections.abc import Mapping
from typing import Any

import keras
from keras import ops

from lime_keras import losses
from lime_keras.dynamic_range import compress

WEIGHTS = {
    "mask": 1.0,
    "specular": 1.0,
    "mirror": 1.0,
    "exponent": 0.1,
    "diffuse_albedo": 5.0,
    "specular_albedo": 5.0,
    "compositing": 1.0,
}
"""Weight of each term in the sum; the paper gives none (docs/decisions.md)."""

_TERMS = {
    "segmentation": ("mask",),
    "specular": ("specular",),
    "mirror": ("mirror",),
    "exponent": ("exponent",),
    "albedo": ("diffuse_albedo", "specular_albedo", "compositing"),
}


class StageModel(keras.Model):
    """Subnetworks trained together on batches of records.

    A subnetwork's input comes from another one of the stage if that is present, else from the
    truth; the true mask cuts out the object throughout.

    Args:
        subnetworks: by name; only these are trained.
    """

    def __init__(self, subnetworks: Mapping[str, keras.Model], **kwargs: Any):
        super().__init__(**kwargs)
        self.subnetworks = dict(subnetworks)
        self.terms = [term for name in subnetworks for term in _TERMS[name]]
        self._means = {term: keras.metrics.Mean(name=term) for term in self.terms}

    def call(self, batch: Mapping[str, Any], training: bool = False) -> dict[str, Any]:
        """Answers of the stage's subnetworks, S and M compressed."""
        networks = self.subnetworks
        mask = batch["mask"]
        masked_image = batch["image"] * mask
        specular = compress(batch["specular_shading"]) * mask
        mirror = compress(batch["mirror"]) * mask
        out = {}
        if "segmentation" in networks:
            out["mask"] = networks["segmentation"](batch["image"], training=training)
        if "specular" in networks:
            out["specular"] = networks["specular"](masked_image, training=training)
            specular = out["specular"] * mask
        if "mirror" in networks:
            out["mirror"] = networks["mirror"](specular, training=training)
            mirror = out["mirror"] * mask
        if "exponent" in networks:
            out["exponent"] = networks["exponent"]([specular, mirror], training=training)
        if "albedo" in networks:
            out["albedos"] = networks["albedo"]([masked_image, specular], training=training)
            out["specular_seen"] = specular
        return out

    def compute_loss(
        self, x: Any = None, y: Any = None, y_pred: Any = None, sample_weight: Any = None, **_: Any
    ) -> Any:
        """Weighted sum of the stage's terms over the batch."""
        total = 0.0
        for term in self.terms:
            value = ops.mean(_term(term, x, y_pred))
            self._means[term].update_state(value)
            total = total + WEIGHTS[term] * value
        return total


def _term(term: str, batch: Mapping[str, Any], answer: Mapping[str, Any]) -> Any:
    """One loss term, `(B,)`."""
    mask = batch["mask"]
    if term == "mask":
        return losses.mask_l2(mask, answer["mask"])
    if term == "specular":
        return losses.shading_l1(batch["specular_shading"], answer["specular"], mask)
    if term == "mirror":
        return losses.shading_l1(batch["mirror"], answer["mirror"], mask)
    if term == "exponent":
        return losses.exponent_cross_entropy(batch["exponent_bin"], answer["exponent"])
    diffuse_albedo, specular_albedo = answer["albedos"][:, :3], answer["albedos"][:, 3:]
    if term == "diffuse_albedo":
        return losses.albedo_l2(batch["diffuse_albedo"], diffuse_albedo)
    if term == "specular_albedo":
        return losses.albedo_l2(ops.expand_dims(batch["specular_albedo"], -1), specular_albedo)
    return losses.compositing_l1(
        batch["image"],
        mask,
        diffuse_albedo,
        specular_albedo,
        batch["ambient"],
        batch["diffuse_shading"],
        answer["specular_seen"],
        batch["clipped"],
    )
