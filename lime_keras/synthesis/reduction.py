"""Batches at a smaller size, for networks that see fewer pixels than a bank has."""

from collections.abc import Mapping
from typing import Any

from keras import ops

from lime_keras.optics import colour

_LAYERS = ("diffuse_shading", "specular_shading", "mirror", "normal")


def reduced(batch: Mapping[str, Any], size: int) -> dict[str, Any]:
    """Reduce a batch's images to `size` × `size` by area averaging, as `pipeline.resize` does.

    The image is averaged in linear light. `clipped` is 1 where any part of an area was clipped.
    Layers are averaged over the covered part of each area. The camera is scaled with the images.

    Args:
        batch: features of a batch, with all images or some of them and the mask; with `image` also
            `clipped`.
        size: height and width in pixels; a divisor of those of the images.

    Raises:
        ValueError: if `size` does not divide the images' size.
    """
    count, whole = batch["mask"].shape[:2]
    if whole % size:
        raise ValueError(f"images of {whole} pixels cannot be averaged to {size}: pass a divisor")
    factor = whole // size
    out = dict(batch)
    if factor == 1:
        return out

    def blocks(image: Any) -> Any:
        return ops.reshape(image, (count, size, factor, size, factor, image.shape[-1]))

    def area_mean(image: Any) -> Any:
        return ops.mean(blocks(image), axis=(2, 4))

    mask = out["mask"] = area_mean(batch["mask"])
    if "image" in batch:
        linear = area_mean(colour.srgb_to_linear(batch["image"]))
        out["image"] = colour.linear_to_srgb(linear)
    if "clipped" in batch:
        out["clipped"] = ops.max(blocks(batch["clipped"]), axis=(2, 4))
    for name in filter(batch.__contains__, _LAYERS):
        covered = area_mean(batch[name] * batch["mask"])
        out[name] = ops.where(mask > 0, covered / ops.where(mask > 0, mask, 1.0), 0.0)
    if "normal" in batch:
        square = ops.sum(ops.square(out["normal"]), axis=-1, keepdims=True)
        out["normal"] = out["normal"] / ops.sqrt(ops.maximum(square, 1e-12))
    if "camera" in batch:
        out["camera"] = batch["camera"] / factor
    return out
