"""The estimator of materials from photos: the public Python interface.

Example:
    from lime_keras import Estimator
    from lime_keras.photo import read_srgb

    material = Estimator().estimate(read_srgb("photo.png"))
    print(material.diffuse_albedo, material.specular_albedo, material.exponent)
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square
from lime_keras.material import Material
from lime_keras.networks import answers, assemble, weights
from lime_keras.optics import colour, compositing, shininess
from lime_keras.outputs import NEEDED, OUTPUTS


class Estimator:
    """A trained model, loaded once and applied to many photos.

    Args:
        weights_folder: folder of the trained model, from `lime-train` or
            `lime_keras.networks.weights.save`; by default the model that comes with the package
            (`lime_keras.networks.weights.SHIPPED`).
        only: names of the estimates to make, out of `outputs.NEEDED`; only the subnetworks that
            these need are run. By default all estimates that this model can make.

    Attributes:
        architecture: architecture of the model.
        subnetworks: names of the subnetworks that are run, in order; `segmentation` is always
            among them, but runs only for photos without a mask.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, `only` is empty, or `only` names something
            that this model cannot estimate.
    """

    def __init__(
        self,
        weights_folder: str | Path = weights.SHIPPED,
        only: Collection[str] | None = None,
    ):
        self.architecture, subnetworks = weights.load(Path(weights_folder))
        needed = available(subnetworks)
        self._only = set(needed if only is None else only)
        unknown = sorted(self._only - set(needed))
        if unknown or not self._only:
            raise ValueError(
                f"cannot estimate {unknown}: {weights_folder} holds "
                f"{self.architecture.description}; choose from {', '.join(needed)}"
            )
        outputs = {output for name in self._only for output in needed[name]} - {"mask"}
        self._finder = assemble(subnetworks, ["mask"])
        self._reader = assemble(subnetworks, sorted(outputs), given={"mask"}) if outputs else None
        used = self._reader.layers if self._reader is not None else []
        self.subnetworks = tuple(
            name for name, part in subnetworks.items() if name == "segmentation" or part in used
        )

    def estimate(self, image_srgb: np.ndarray, mask: np.ndarray | None = None) -> Material:
        """Estimate the material of the object in a photo.

        Args:
            image_srgb: photo `(H, W, 3)`, sRGB in [0, 1], of one object of uniform material.
            mask: coverage `(H, W)` or `(H, W, 1)` in [0, 1], 1 where the object is; None to find
                the object with SegmentationNet.

        Returns:
            The material, with its layers at the photo's size; albedos and layers are linear.

        Raises:
            ValueError: if the photo or the mask has another shape, is not finite, or leaves [0, 1].
        """
        return next(self.estimate_many([image_srgb], [mask]))

    def estimate_many(
        self, images_srgb: Sequence[np.ndarray], masks: Sequence[np.ndarray | None] | None = None
    ) -> Iterator[Material]:
        """Estimate the materials of several photos, of any sizes, as one batch.

        The networks run once, for all photos together. The layers of a material are made when the
        iterator reaches it, so that the layers of all photos are never in memory together.

        Args:
            images_srgb: photos, each `(H, W, 3)`, sRGB in [0, 1].
            masks: for each photo coverage `(H, W)` or `(H, W, 1)` in [0, 1], or None to find the
                object with SegmentationNet; by default None for all photos.

        Yields:
            The material of each photo, in order (see `estimate`).

        Raises:
            ValueError: if a photo or a mask has another shape, is not finite, or leaves [0, 1], or
                if the numbers of photos and masks differ; raised at the first material.
        """
        images = [_checked(image) for image in images_srgb]
        given = [None] * len(images) if masks is None else list(masks)
        if len(given) != len(images):
            raise ValueError(f"{len(images)} photos with {len(given)} masks: pass one for each")
        given = [
            None if mask is None else _checked_mask(mask, image)
            for mask, image in zip(given, images, strict=True)
        ]
        if not images:
            return
        squares, seen, masks_seen = self._find(images, given)
        answer: Mapping[str, np.ndarray] = {}
        if self._reader is not None:
            answer = _run(self._reader, {"image": seen, "mask": masks_seen})
        for index, (image, mask, square) in enumerate(zip(images, given, squares, strict=True)):
            own = {name: value[index] for name, value in answer.items()}
            if mask is None:
                mask = framing.paste(masks_seen[index], square, *image.shape[:2])
            yield self._material(image, mask, square, own)

    def _find(
        self, images: list[np.ndarray], given: list[np.ndarray | None]
    ) -> tuple[list[Square], np.ndarray, np.ndarray]:
        """Return each photo's square, and its content `(N, S, S, 3)` and mask `(N, S, S, 1)`."""
        size = self.architecture.size
        squares = [
            framing.whole(*image.shape[:2]) if mask is None else framing.around_given(mask)
            for image, mask in zip(images, given, strict=True)
        ]
        seen = np.stack([framing.cut(*pair, size) for pair in zip(images, squares, strict=True)])
        masks = np.zeros((len(images), size, size, 1), np.float32)
        for index, mask in enumerate(given):
            if mask is not None:
                masks[index] = framing.cut_layer(mask, squares[index], size)
        looked = [index for index, mask in enumerate(given) if mask is None]
        masks[looked] = self._masks(seen[looked])
        closer = [framing.around(mask, square) for mask, square in zip(masks, squares, strict=True)]
        again = [index for index in looked if closer[index] != squares[index]]
        near = [framing.cut(images[index], closer[index], size) for index in again]
        for index, view, mask in zip(again, near, self._masks(np.array(near)), strict=True):
            # If the closer view shows no object, keep the whole photo.
            if np.any(mask >= framing.THRESHOLD):
                squares[index], seen[index], masks[index] = closer[index], view, mask
        return squares, seen, masks

    def _masks(self, seen: np.ndarray) -> np.ndarray:
        """Return SegmentationNet's masks `(N, S, S, 1)` of images `(N, S, S, 3)`; N may be 0."""
        size = self.architecture.size
        return _run(self._finder, seen)["mask"] if len(seen) else np.empty((0, size, size, 1))

    def _material(
        self, image: np.ndarray, mask: np.ndarray, square: Square, answer: dict[str, np.ndarray]
    ) -> Material:
        """Return the material of one photo with the estimates that were asked for."""
        only = self._only
        fields: dict[str, Any] = {}
        layers = {"mask": mask}
        for asked in filter(only.__contains__, NEEDED):
            if asked == "diffuse":
                shading = layers.get("specular_shading")
                if shading is None:
                    shading = framing.paste(answer["specular_shading"], square, *image.shape[:2])
                layers |= _recomposed(image, mask, shading, answer)
                continue
            for name in NEEDED[asked]:
                if OUTPUTS[name].layer == "sphere":
                    # The sphere is not a part of the photo, so it keeps its own size.
                    layers[name] = answer[name]
                elif OUTPUTS[name].layer == "photo" and name != "mask":
                    layers[name] = framing.paste(answer[name], square, *image.shape[:2])
        if "albedo" in only:
            fields["diffuse_albedo"] = answer["diffuse_albedo"]
            fields["specular_albedo"] = float(answer["specular_albedo"][0])
        if "exponent" in only:
            fields["exponent"] = float(10.0 ** shininess.log_of_outputs(answer))
        if "exponent_bin_probabilities" in answer:
            probabilities = answer["exponent_bin_probabilities"]
            fields["exponent_bin_probabilities"] = probabilities
            fields["exponent_entropy"] = float(shininess.entropy(probabilities))
        coverage = float(np.mean(mask >= framing.THRESHOLD))
        return Material(mask_coverage=coverage, square=square, layers=layers, **fields)


def available(subnetworks: Mapping[str, keras.Model]) -> dict[str, tuple[str, ...]]:
    """Return the estimates that subnetworks can make, by name, with the outputs that each needs.

    Args:
        subnetworks: models by name, such as `lime_keras.networks.build` returns them.

    Returns:
        The part of `outputs.NEEDED` that these subnetworks can give; `exponent` needs
        `log_exponent` if they regress the exponent.
    """
    known = answers(subnetworks)
    regression = {"exponent": ("mask", "log_exponent")} if "log_exponent" in known else {}
    needed = NEEDED | regression
    return {name: outputs for name, outputs in needed.items() if set(outputs) <= set(known)}


def _recomposed(
    image_srgb: np.ndarray, mask: np.ndarray, shading: np.ndarray, answer: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the layers `diffuse`, the photo's diffuse part, and `recomposed`, Eq. 4 of the fit."""
    diffuse_albedo = answer["diffuse_albedo"]
    specular = answer["specular_albedo"] * shading
    diffuse = np.maximum(colour.srgb_to_linear(image_srgb) - specular, 0) * mask
    # The D of a black material is NaN. It does not matter: m_d · D is 0 for every D.
    shade = np.nan_to_num(compositing.diffuse_shading(diffuse, diffuse_albedo))
    return {"diffuse": diffuse, "recomposed": shade * diffuse_albedo + specular * mask}


def _run(network: keras.Model, inputs: Any) -> dict[str, np.ndarray]:
    return {name: np.array(value) for name, value in network.predict_on_batch(inputs).items()}


def _checked(image_srgb: Any) -> np.ndarray:
    image = np.asarray(image_srgb, np.float32)
    if image.ndim != 3 or image.shape[-1] != 3 or image.size == 0:
        raise ValueError(f"a photo has shape (H, W, 3), got {image.shape}")
    if not np.all((image >= 0) & (image <= 1)):
        raise ValueError("a photo's values are finite and in [0, 1]: divide 8-bit ones by 255")
    return image


def _checked_mask(mask: Any, image: np.ndarray) -> np.ndarray:
    found = np.asarray(mask, np.float32)
    if found.shape not in (image.shape[:2], (*image.shape[:2], 1)):
        raise ValueError(
            f"a mask has its photo's shape, {image.shape[:2]} or {(*image.shape[:2], 1)}, got "
            f"{found.shape}"
        )
    if not np.all((found >= 0) & (found <= 1)):
        raise ValueError("a mask's values are finite and in [0, 1]: divide 8-bit ones by 255")
    return found.reshape(*image.shape[:2], 1)
