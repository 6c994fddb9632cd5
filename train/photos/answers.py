"""Predictions of frozen subnetworks on kept photos: computed once, and kept beside them.

These are the masks that the objects are cut out with (`photos.masks`), by SegmentationNet, and the
layers that frozen subnetworks predict on photo and mask alone.
"""

import hashlib
from collections.abc import Collection, Mapping

import keras
import numpy as np

from lime_keras.networks.registry import QUANTITIES, estimate, is_plain
from lime_keras.networks.wiring import Networks, Wiring, predictors, required_inputs

from . import masks
from .kept import INPUT_MASK, PREDICTED, Kept
from .making import OnMaking

_BATCH = 32  # photos of one prediction: not tuned, all of them fit any device that trains


def independent(subnetworks: Networks, frozen: Collection[str]) -> dict[str, keras.Model]:
    """Return the frozen subnetworks of a stage that read no prediction of one that learns."""
    out: dict[str, keras.Model] = {}
    learnt = set(predictors({n: one for n, one in subnetworks.items() if n not in frozen}))
    for name, network in subnetworks.items():
        if name in frozen and learnt.isdisjoint(required_inputs({name: network})):
            out[name] = network
        else:
            learnt |= set(predictors({name: network}))
    images = {name for name, row in QUANTITIES.items() if row.channels == 1}
    return {name: one for name, one in out.items() if images.issuperset(predictors({name: one}))}


def read_by(learning: Networks, independent: Networks) -> dict[str, keras.Model]:
    """Return the independent subnetworks that those that learn read, or that these in turn read."""
    out = dict(learning)
    for name, network in reversed(list(independent.items())):
        if not set(required_inputs(out)).isdisjoint(predictors({name: network})):
            out = {name: network, **out}
    return {name: network for name, network in out.items() if name in independent}


def sha256(networks: Networks) -> str:
    """Return a hash of the weights of subnetworks."""
    digest = hashlib.sha256()
    for name, network in networks.items():
        digest.update(name.encode())
        for value in network.get_weights():
            digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


def features(networks: Networks) -> tuple[str, ...]:
    """Return the names of the features that are kept of these subnetworks, and the input mask."""
    return (INPUT_MASK, *(f"{PREDICTED}{quantity}" for quantity in predictors(networks)))


def predict_mask(network: keras.Model, images: np.ndarray) -> np.ndarray:
    """Return the masks that SegmentationNet finds in images, as other subnetworks read them."""
    images = np.asarray(images)
    # Of several devices under TensorFlow each answers all images, one behind the other.
    answer = network.predict_on_batch(images)[: len(images)]
    return keras.ops.convert_to_numpy(estimate("mask", network, answer, lambda name: None))


def make(
    photos: Kept, answers: Kept, networks: Networks, seed: int | None, on_making: OnMaking
) -> None:
    """Compute the answers that are missing.

    Args:
        photos: complete photos.
        answers: where the answers to the same photos are kept.
        networks: frozen subnetworks: `segmentation`, without which masks are true or
            damaged, and those whose predictions are kept (`independent`).
        seed: seed of the masks; None to cut out each object by `segmentation` alone, as in
            validation.
        on_making: function called as answers are computed.

    Raises:
        OSError: if the disk is full.
    """
    if answers.is_complete:
        return
    layers = {name: network for name, network in networks.items() if name != "segmentation"}
    masker, missing = networks.get("segmentation"), answers.begin()
    model = _joined(layers)
    done = answers.count - sum(map(len, missing))
    for part in missing:
        batch = photos.read(np.array(part), ("image", *required_inputs(layers)))
        batch["mask"] = _input_masks(batch, part, masker, seed)
        answers.write(part.start, {INPUT_MASK: batch["mask"], **_layers(batch, model)})
        answers.mark(part)
        done += len(part)
        on_making("input masks", done, answers.count)
    answers.finish({})


def _input_masks(
    batch: Mapping[str, np.ndarray], rows: range, masker: keras.Model | None, seed: int | None
) -> np.ndarray:
    """Return the input masks of some photos; SegmentationNet looks only where its mask is used."""
    drawn: list[np.ndarray | None] = [None] * len(rows)
    if seed is not None:
        drawn = [
            masks.input_mask(true, np.random.default_rng((seed, row)))
            for true, row in zip(batch["mask"], rows, strict=True)
        ]
    undrawn = [index for index, one in enumerate(drawn) if one is None]
    predicted = batch["mask"][undrawn]
    if masker is not None and undrawn:
        # Always as many photos: for another number the prediction would be compiled anew.
        whole = -(-len(undrawn) // _BATCH) * _BATCH
        images = np.split(batch["image"][np.resize(undrawn, whole)], whole // _BATCH)
        predicted = np.concatenate([predict_mask(masker, some) for some in images])[: len(undrawn)]
    for index, one in zip(undrawn, predicted, strict=True):
        drawn[index] = one
    return np.stack([one for one in drawn if one is not None])


def _layers(batch: Mapping[str, np.ndarray], model: keras.Model | None) -> dict[str, np.ndarray]:
    """Return what a model by `_joined` predicts of photos that are cut out with these masks."""
    if model is None:
        return {}
    # As the files hold the mask, so that the order of both does not matter.
    mask = np.round(batch["mask"] * 255) * np.float32(1 / 255)
    read = {name: {**batch, "mask": mask}[name] for name in model.input}
    parts = [
        model.predict_on_batch({name: value[i : i + _BATCH] for name, value in read.items()})
        for i in range(0, len(mask), _BATCH)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in model.output}


def _joined(networks: Networks) -> keras.Model | None:
    """Return subnetworks as one model of photo and mask, which is compiled; None if there are none.

    Run op by op they take 2.5 times as long in bfloat16.
    """
    if not networks:
        return None
    size = next(iter(networks.values())).inputs[0].shape[1]
    read = {"image": 3, **{name: QUANTITIES[name].channels for name in required_inputs(networks)}}
    given = {name: keras.Input((size, size, count), name=name) for name, count in read.items()}
    wiring, out = Wiring(networks, given, training=False), {}
    for quantity, name in predictors(networks).items():
        answer = wiring.raw_prediction(quantity)
        plain = QUANTITIES[quantity].plain(answer) if is_plain(networks[name]) else answer
        out[f"{PREDICTED}{quantity}"] = plain
    return keras.Model(given, out)
