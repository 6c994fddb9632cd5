"""The estimator of materials from photos: the public Python interface.

Example:
    from lime_keras import Estimator

    material = Estimator().estimate("photo.png")
    print(material.diffuse_albedo, material.specular_albedo, material.exponent)
"""

import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.estimate import engines, framing
from lime_keras.estimate.framing import Square
from lime_keras.estimate.pictures import Picture, mask_of, photo_of
from lime_keras.io import model_folder
from lime_keras.io.model_folder import SHIPPED
from lime_keras.material import Material
from lime_keras.optics import colour, compositing, shininess
from lime_keras.outputs import NEEDED, OUTPUTS, available


@dataclass(frozen=True)
class View:
    """The square of a photo that the networks see, with the object found in it.

    Attributes:
        square: square of the photo; it may reach beyond the photo.
        image: its content `(S, S, 3)` float32, sRGB in [0, 1].
        mask: coverage `(S, S, 1)` in [0, 1], as the networks see it, beyond the photo too.
        coverage: share of the photo that the object covers, in [0, 1].
    """

    square: Square
    image: np.ndarray
    mask: np.ndarray
    coverage: float


class Estimator:
    """A trained model, loaded once and applied to many photos.

    Args:
        weights: folder of the trained model, from `lime-train` or
            `lime_keras.networks.weights.save`; or name of a set that comes with the package, such
            as `live`; by default `lime_keras.io.model_folder.DEFAULT`.
        only: names of the estimates to make, out of `outputs.NEEDED`; only the subnetworks that
            these need are loaded and run. By default all estimates that this model can make.
        engine: `onnx` for ONNX Runtime or `keras` (`engines.load`).

    Attributes:
        size: height and width in pixels of the square that the networks see.
        system: name of the system in words.
        subnetworks: names of the subnetworks that are run, in order; `segmentation` is always
            among them, but is loaded and run only for photos without a mask.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, `only` is empty, or `only` names something
            that this model cannot estimate.
        console.MissingExtra: if the engine needs packages that are not installed.
    """

    def __init__(
        self,
        weights: str | Path = SHIPPED,
        only: Collection[str] | None = None,
        engine: str = engines.ENGINES[0],
    ):
        self._engine = engines.load(model_folder.find(weights), engine)
        self.size, self.system = self._engine.size, self._engine.system
        needed = available(self._engine.outputs)
        self._only = set(needed if only is None else only)
        unknown = sorted(self._only - set(needed))
        if unknown or not self._only:
            raise ValueError(
                f"cannot estimate {unknown}: {weights} holds "
                f"{self._engine.system}; choose from {', '.join(needed)}"
            )
        self._read = sorted({output for name in self._only for output in needed[name]} - {"mask"})
        self.subnetworks = (
            *self._engine.subnetworks(["mask"], ["image"]),
            *self._engine.subnetworks(self._read, ["image", "mask"]),
        )

    def estimate(self, photo: Picture, mask: Picture | None = None) -> Material:
        """Estimate the material of the object in a photo.

        Args:
            photo: photo of one object of uniform material: path of a file, PIL image, uint8 array
                `(H, W, 3)`, or array of floats `(H, W, 3)`; arrays are sRGB, floats in [0, 1].
            mask: coverage of the object: path of a picture that is white where the object is, PIL
                image, or array `(H, W)` or `(H, W, 1)` of bools, of uint8, or of floats in [0, 1].
                None to take the transparency of a file or PIL image, if it has any, or else to find
                the object with SegmentationNet.

        Returns:
            The material, with its layers at the photo's size; albedos and layers are linear.

        Raises:
            ValueError: if the photo or the mask cannot be read, has another shape, is not finite,
                or leaves [0, 1].
        """
        return next(self.estimate_many([photo], [mask]))

    def estimate_many(
        self, photos: Sequence[Picture], masks: Sequence[Picture | None] | None = None
    ) -> Iterator[Material]:
        """Estimate the materials of several photos, of any sizes, as one batch.

        The networks run once, for all photos together. The layers of a material are made when the
        iterator reaches it, so that the layers of all photos are never in memory together.

        Args:
            photos: photos, each as `estimate` takes it.
            masks: mask of each photo, as `estimate` takes it, or None; by default None for all.

        Yields:
            The material of each photo, in order (see `estimate`).

        Raises:
            ValueError: if a photo or a mask is refused (see `estimate`), or the numbers of photos
                and masks differ; raised at the first material.
        """
        masks = [None] * len(photos) if masks is None else masks
        if len(masks) != len(photos):
            raise ValueError(f"{len(photos)} photos with {len(masks)} masks: pass one for each")
        images, given = [], []
        for picture, mask in zip(photos, masks, strict=True):
            image, alpha = photo_of(picture)
            images.append(image)
            given.append(alpha if mask is None else mask_of(mask, *image.shape[:2]))
        if not images:
            return
        squares, seen, masks_seen = self._find(images, given)
        answer: Mapping[str, np.ndarray] = {}
        if self._read:
            answer = self._engine.run(self._read, {"image": seen, "mask": masks_seen})
        for index, (image, mask, square) in enumerate(zip(images, given, squares, strict=True)):
            own = {name: value[index] for name, value in answer.items()}
            if mask is None:
                mask = framing.paste(masks_seen[index], square, *image.shape[:2])
            yield self._material(image, mask, square, own)

    def view(self, photo: Picture, mask: Picture | None = None) -> View:
        """Find the object in a photo, and return the square that the networks see.

        `view` and `read` are the two halves of `estimate` for who shows the layers in the square
        alone: nothing is brought to the photo's size.

        Args:
            photo: photo, as `estimate` takes it.
            mask: coverage of the object, as `estimate` takes it, or None.

        Raises:
            ValueError: if the photo or the mask is refused (see `estimate`).
        """
        image, alpha = photo_of(photo)
        height, width = image.shape[:2]
        given = alpha if mask is None else mask_of(mask, height, width)
        squares, seen, masks = self._find([image], [given])
        square, found = squares[0], masks[0] >= framing.THRESHOLD
        pixels = np.sum(found & framing.inside(square, height, width, len(found)))
        share = float(pixels) * (square.side / len(found)) ** 2 / (height * width)
        return View(square, seen[0], masks[0], min(share, 1.0))

    def read(self, view: View) -> Material:
        """Estimate the material of the object in a view.

        Returns:
            The material, with the photo's square and coverage, and with its layers in the pixels of
            the view.
        """
        given = {"image": view.image[None], "mask": view.mask[None]}
        answer = self._engine.run(self._read, given) if self._read else {}
        own = {name: value[0] for name, value in answer.items()}
        material = self._material(view.image, view.mask, Square(0, 0, len(view.image)), own)
        return dataclasses.replace(material, square=view.square, mask_coverage=view.coverage)

    def _find(
        self, images: list[np.ndarray], given: list[np.ndarray | None]
    ) -> tuple[list[Square], np.ndarray, np.ndarray]:
        """Return each photo's square, and its content `(N, S, S, 3)` and mask `(N, S, S, 1)`."""
        size = self._engine.size
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
        if not len(seen):
            return np.empty((0, self._engine.size, self._engine.size, 1), np.float32)
        return self._engine.run(["mask"], {"image": seen})["mask"]

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
