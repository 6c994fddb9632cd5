"""A stage as a Keras model: wiring, losses and measures, and nothing else.

Written in `keras.ops` alone, so that it trains under any Keras backend.
"""

from collections.abc import Mapping
from typing import Any

import keras
from keras import ops

from lime_keras import losses
from lime_keras.data import pipeline
from lime_keras.optics.dynamic_range import compress
from lime_keras.optics.masking import masked_mean
from lime_keras.optics.reflectance_map import disc, reflectance_map

from . import measures

WEIGHTS = {
    "mask": 1.0,
    "specular": 1.0,
    "mirror": 1.0,
    "exponent": 0.1,
    "log_exponent": 0.3,
    "diffuse_albedo": 5.0,
    "specular_albedo": 5.0,
    "compositing": 1.0,
    "reflectance_map": 1.0,
}
"""Weight of each term in the sum; the paper gives none (docs/decisions.md)."""

_TERMS = {
    "segmentation": ("mask",),
    "specular": ("specular",),
    "mirror": ("mirror",),
    "exponent": ("exponent",),
    "albedo": ("diffuse_albedo", "specular_albedo", "compositing"),
    "reflectance_map": ("reflectance_map",),
    "material": ("diffuse_albedo", "specular_albedo", "exponent"),
}


class StageModel(keras.Model):
    """Subnetworks trained together on batches of records.

    A subnetwork's input comes from another one of the stage if that is present, else from the
    truth; the true mask cuts out the object throughout.

    Args:
        subnetworks: by name; only these are trained.
        compositing: whether AlbedoNet is also held to Eq. 5.
        replicas: how many parts of one batch are seen apart, their gradients added up.
    """

    def __init__(
        self, subnetworks: Mapping[str, keras.Model], compositing: bool = True, replicas: int = 1
    ):
        # Truth and losses in single precision, whatever the subnetworks compute in.
        super().__init__(dtype="float32")
        self.subnetworks = dict(subnetworks)
        self._replicas = replicas
        self.terms = [term for name in subnetworks for term in _TERMS[name]]
        if not compositing and "compositing" in self.terms:
            self.terms.remove("compositing")
        if "exponent" in subnetworks and subnetworks["exponent"].output_shape[-1] == 1:
            self.terms[self.terms.index("exponent")] = "log_exponent"
        self._means = {term: keras.metrics.Mean(name=term) for term in self.terms}
        self._measures = measures.of(subnetworks)
        self.built = True

    @property
    def features(self) -> tuple[str, ...]:
        """What a batch must hold, by the names of `pipeline`."""
        more = {
            "exponent": ("shininess",),
            "log_exponent": ("shininess",),
            "reflectance_map": ("environment", "shininess"),
        }
        wanted = list(pipeline.LEARNT_FROM)
        if "material" in self.subnetworks:
            wanted += more["reflectance_map"]
        for term in self.terms:
            wanted += more.get(term, ())
        return tuple(dict.fromkeys(wanted))

    def call(self, batch: Mapping[str, Any], training: bool = False) -> dict[str, Any]:
        """Answers of the stage's subnetworks, S, M and the reflectance map compressed."""
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
            seen = [specular, mirror] if len(networks["exponent"].inputs) == 2 else [specular]
            out["exponent"] = networks["exponent"](seen, training=training)
        if "albedo" in networks:
            out["albedos"] = networks["albedo"]([masked_image, specular], training=training)
            out["specular_seen"] = specular
        if "reflectance_map" in networks or "material" in networks:
            sphere = out["true_reflectance_map"] = _true_reflectance_map(batch)
        if "reflectance_map" in networks:
            sphere = networks["reflectance_map"](masked_image, training=training)
            sphere = out["reflectance_map"] = sphere * disc(sphere.shape[1])
        if "material" in networks:
            out["albedos"], out["exponent"] = networks["material"](sphere, training=training)
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
        return total / self._replicas

    def compute_metrics(
        self, x: Any, y: Any, y_pred: Any, sample_weight: Any = None
    ) -> dict[str, Any]:
        """The losses of the batch, by name; one that comes with weights is measured too.

        Training passes none, and so has no part in the measures, nor does it pay for them.
        """
        if sample_weight is not None:
            measures.update(self._measures, x, y_pred, sample_weight)
        return {metric.name: metric.result() for metric in self._of_a_batch()}

    def reset_metrics(self) -> None:
        """Start the losses anew, which Keras asks for before each batch; measures are kept."""
        for metric in self._of_a_batch():
            metric.reset_state()

    def reset_measures(self) -> None:
        """Start the measures anew."""
        for metric in self._measures.values():
            metric.reset_state()

    def measured(self) -> dict[str, float]:
        """The measures by name, over all batches with weights since the last `reset_measures`."""
        return {
            name: float(ops.convert_to_numpy(metric.result()))
            for name, metric in self._measures.items()
        }

    def _of_a_batch(self) -> list[keras.metrics.Metric]:
        return [metric for metric in self.metrics if metric.name not in self._measures]


def _true_reflectance_map(batch: Mapping[str, Any]) -> Any:
    """Compressed, `(B, S, S, 3)`."""
    linear = reflectance_map(
        batch["environment"],
        batch["shininess"],
        batch["diffuse_albedo"],
        batch["specular_albedo"],
        batch["ambient"],
        batch["image"].shape[1],
    )
    return compress(ops.stop_gradient(linear))


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
    if term == "log_exponent":
        return losses.log_exponent_l2(batch["shininess"], answer["exponent"])
    if term == "reflectance_map":
        truth = answer["true_reflectance_map"]
        inside = ops.broadcast_to(
            disc(truth.shape[1])[None], (ops.shape(truth)[0], *truth.shape[1:3], 1)
        )
        return masked_mean(ops.abs(answer["reflectance_map"] - truth), inside)
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
