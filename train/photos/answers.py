"""What subnetworks that stand still predict of kept photos: computed once, and kept beside them.

These are the masks that the objects are cut out with (`photos.masks`), by SegmentationNet, and the
layers that frozen subnetworks predict on photo and mask alone.
"""

import hashlib
from collections.abc import Collection, Mapping
from typing import Any

import keras
import numpy as np

from lime_keras.networks.registry import DERIVED, QUANTITIES, estimate, is_plain
from lime_keras.networks.wiring import Wiring, quantities

from . import masks
from .kept import INPUT_MASK, PREDICTED, Kept
from .making import OnMaking

_BATCH = 32
"""Photos of one prediction: not tuned, all of them fit any device that trains."""


def independent(
    subnetworks: Mapping[str, keras.Model], frozen: Collection[str]
) -> dict[str, keras.Model]:
    """Return the frozen subnetworks of a stage that read no prediction of one that learns."""
    out: dict[str, keras.Model] = {}
    learnt = set(quantities({n: one for n, one in subnetworks.items() if n not in frozen}))
    for name, network in subnetworks.items():
        read = {tensor.name for tensor in network.inputs}
        if name in frozen and not read & learnt:
            out[name] = network
        else:
            learnt |= set(quantities({name: network}))
    images = {name for name, row in QUANTITIES.items() if row.channels == 1}
    return {name: one for name, one in out.items() if images.issuperset(quantities({name: one}))}


def reads(networks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Return the layers that these subnetworks read and none of them predicts."""
    read = {tensor.name for network in networks.values() for tensor in network.inputs}
    return tuple(sorted(read - set(quantities(networks)) - {"image", "mask", *DERIVED}))


def sha256(networks: Mapping[str, keras.Model]) -> str:
    """Return a hash of the weights of subnetworks."""
    digest = hashlib.sha256()
    for name, network in networks.items():
        digest.update(name.encode())
        for value in network.get_weights():
            digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


def features(networks: Mapping[str, keras.Model]) -> tuple[str, ...]:
    """Return the names of the features that are kept of these subnetworks, and the input mask."""
    return (INPUT_MASK, *(f"{PREDICTED}{quantity}" for quantity in quantities(networks)))


def predict_mask(network: keras.Model, images: np.ndarray) -> np.ndarray:
    """Return the masks that SegmentationNet finds in images, as other subnetworks read them."""
    answer = network.predict_on_batch(np.asarray(images))
    return keras.ops.convert_to_numpy(estimate("mask", network, answer, lambda name: None))


def make(
    photos: Kept,
    answers: Kept,
    networks: Mapping[str, keras.Model],
    seed: int | None,
    title: str,
    on_making: OnMaking,
) -> None:
    """Compute the answers that are missing.

    Args:
        photos: complete photos.
        answers: where the answers to the same photos are kept.
        networks: subnetworks that stand still: `segmentation`, without which masks are true or
            damaged, and those whose predictions are kept (`independent`).
        seed: seed of the masks; None to cut out each object by `segmentation` alone, as in
            validation.
        title: name of the answers, for `on_making`.
        on_making: function called as answers are computed.

    Raises:
        OSError: if the disk is full.
    """
    if answers.is_complete:
        return
    layers = {name: network for name, network in networks.items() if name != "segmentation"}
    masker, missing = networks.get("segmentation"), answers.begin()
    done = answers.count - sum(map(len, missing))
    for part in missing:
        found: dict[str, list[np.ndarray]] = {name: [] for name in answers.features}
        for first in range(part.start, part.stop, _BATCH):
            rows = np.arange(first, min(first + _BATCH, part.stop))
            for name, value in _answer(photos, rows, masker, layers, seed).items():
                found[name].append(value)
        answers.write(part.start, {name: np.concatenate(all_) for name, all_ in found.items()})
        answers.mark(part)
        done += len(part)
        on_making(title, done, answers.count)
    answers.finish({})


def _answer(
    photos: Kept,
    rows: np.ndarray,
    masker: keras.Model | None,
    networks: Mapping[str, keras.Model],
    seed: int | None,
) -> dict[str, np.ndarray]:
    """Return the input masks of some photos, and what the subnetworks predict of them."""
    batch = photos.read(rows, ("image", "mask", *reads(networks)))
    predicted = None if masker is None else predict_mask(masker, batch["image"])
    if seed is None:
        cut_out = batch["mask"] if predicted is None else predicted
    else:
        cut_out = np.stack(
            [
                masks.input_mask(
                    true,
                    None if predicted is None else predicted[index],
                    np.random.default_rng((seed, int(row))),
                )
                for index, (row, true) in enumerate(zip(rows, batch["mask"], strict=True))
            ]
        )
    out: dict[str, Any] = {INPUT_MASK: cut_out}
    if networks:
        # As the files hold the mask, so that the order of both does not matter.
        given = {name: keras.ops.convert_to_tensor(value) for name, value in batch.items()}
        mask = keras.ops.convert_to_tensor(np.round(cut_out * 255) * np.float32(1 / 255))
        wiring = Wiring(networks, given | {"mask": mask}, training=False)
        for quantity, name in quantities(networks).items():
            answer = wiring.answer(quantity)
            if is_plain(networks[name]):
                answer = QUANTITIES[quantity].plain(answer)
            out[f"{PREDICTED}{quantity}"] = keras.ops.convert_to_numpy(answer)
    return out
