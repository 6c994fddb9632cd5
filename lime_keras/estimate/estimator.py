"""The estimator of materials from photos: the public Python interface.

Example:
    from lime_keras import Estimator

    material = Estimator().estimate("photo.png")
    print(material.diffuse_albedo, material.specular_albedo, material.exponent)
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, overload

import numpy as np

from lime_keras.estimate import cautions, engines, framing, full_size
from lime_keras.estimate.framing import Square
from lime_keras.estimate.pictures import Picture, mask_of, photo_of
from lime_keras.material import Caution, Material
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file
from lime_keras.model.folder import FOR_PHOTOS
from lime_keras.optics import colour, compositing, dichromatic, highlights, shininess
from lime_keras.outputs import NEEDED, OUTPUTS, available

_PIXELS_AT_ONCE = 1 << 18
"""Number of pixels of a photo, about, whose layers are recomposed at once."""


@dataclass(frozen=True)
class View:
    """The square of a photo that the networks see, with the object found in it.

    Attributes:
        square: square of the photo; it may reach beyond the photo.
        image: its content `(S, S, 3)` float32, sRGB in [0, 1].
        mask: coverage `(S, S, 1)` in [0, 1], as the networks see it, beyond the photo too.
        coverage: share of the photo that the object covers, in [0, 1].
        confidence: `Material.mask_confidence`.
        photo: the photo `(H, W, 3)`, sRGB in [0, 1].
        given: coverage `(H, W, 1)` in [0, 1] of a mask that was not found by SegmentationNet, or
            None.
    """

    square: Square
    image: np.ndarray
    mask: np.ndarray
    coverage: float
    confidence: float | None
    photo: np.ndarray
    given: np.ndarray | None


class Estimator:
    """A trained model, loaded once and applied to many photos.

    Args:
        weights: folder of the trained model, from `lime-train` or
            `lime_keras.model.weights.save`; or name of a set that comes with the package, such
            as `live`; by default `lime_keras.model.folder.FOR_PHOTOS`.
        only: names of the estimates to make, out of `outputs.NEEDED`; only the subnetworks that
            these need are loaded and run. By default all estimates that this model can make.
        engine: `onnx` for ONNX Runtime or `keras` (`engines.load`).
        masker: function that finds the object in place of SegmentationNet, such as
            `lime_keras.runtime.masker.Masker("u2net.onnx")`: it takes a photo `(H, W, 3)`, float32
            sRGB in [0, 1], and returns coverage `(H, W)` or `(H, W, 1)` in [0, 1].
        full_size: whether the edges of the layers follow those of the photo (`full_size`); else
            the layers are interpolated from the networks' size. The mask's coverage follows.
        streaming: whether single frames follow each other, as in `lime-live`: the engine then keeps
            its memory between them, which makes them faster.

    Attributes:
        size: height and width in pixels of the square that the networks see.
        system: name of the system in words.
        gloss_calibration: what makes a probability of the estimated gloss (`optics.gloss`).
        subnetworks: names of the subnetworks that are run, in order; `segmentation` is always
            among them, but is loaded and run only for photos without a mask; with a masker, never.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, `only` is empty, or `only` names something
            that this model cannot estimate.
        console.MissingExtra: if the engine needs packages that are not installed.
    """

    def __init__(
        self,
        weights: str | Path = FOR_PHOTOS,
        only: Collection[str] | None = None,
        engine: str = engines.ENGINES[0],
        masker: Callable[[np.ndarray], np.ndarray] | None = None,
        full_size: bool = False,
        streaming: bool = False,
    ):
        self._masker = masker
        self._model = weights
        self.gloss_calibration = gloss_file.read(model_folder.find(weights))
        self._engine = engines.load(model_folder.find(weights), engine, streaming=streaming)
        self.size, self.system = self._engine.size, self._engine.system
        if isinstance(only, str):
            raise ValueError(f"only is a list of names: pass [{only!r}]")
        needed = available(self._engine.outputs)
        self._full_size = full_size
        self._only = set(needed if only is None else only)
        unknown = sorted(self._only - set(needed))
        if unknown or not self._only:
            raise ValueError(
                f"cannot estimate {unknown}: {weights} holds "
                f"{self._engine.system}; choose from {', '.join(needed)}"
            )
        self._read = sorted({output for name in self._only for output in needed[name]} - {"mask"})
        self.subnetworks = (
            *(() if masker else self._engine.subnetworks(["mask"], ["image"])),
            *self._engine.subnetworks(self._read, ["image", "mask"]),
        )

    @overload
    def __call__(
        self, photo: list[Picture], mask: list[Picture] | None = None
    ) -> list[Material]: ...

    @overload
    def __call__(self, photo: Picture, mask: Picture | None = None) -> Material: ...

    def __call__(
        self,
        photo: Picture | list[Picture],
        mask: Picture | list[Picture] | None = None,
    ) -> Material | list[Material]:
        """Estimate the material of the object in a photo, or of several in a list (`estimate`)."""
        if not isinstance(photo, list):
            if isinstance(mask, list):
                raise ValueError(
                    "one photo with a list of masks: pass one mask, or a list of photos"
                )
            return self.estimate(photo, mask)
        if mask is not None and not isinstance(mask, list):
            raise ValueError("a list of photos with one mask: pass a list of masks, one for each")
        return list(self.estimate_many(photo, mask))

    def __repr__(self) -> str:
        return (
            f"Estimator({Path(self._model).name}: {self.system}, {self.size} x {self.size} pixels)"
        )

    def estimate(self, photo: Picture, mask: Picture | None = None) -> Material:
        """Estimate the material of the object in a photo.

        Args:
            photo: photo of one object of uniform material: path of a file, its bytes, an open
                binary file, PIL image, uint8 array `(H, W, 3)`, or array of floats `(H, W, 3)`;
                arrays are sRGB, floats in [0, 1].
            mask: coverage of the object: path of a picture that is white where the object is, PIL
                image, or array `(H, W)` or `(H, W, 1)` of bools, of uint8, or of floats in [0, 1].
                None to take the transparency of a file or PIL image, if it has any, or else to find
                the object with SegmentationNet.

        Returns:
            The material, with its layers at the photo's size; albedos and layers are linear. Its
            `warnings` say why it may be wrong. Where no object was found it holds nothing but the
            mask.

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
                and masks differ; raised at the first material. Also if the model's answers are
                not finite, as its weights are damaged.
        """
        masks = [None] * len(photos) if masks is None else masks
        if len(masks) != len(photos):
            raise ValueError(f"{len(photos)} photos with {len(masks)} masks: pass one for each")
        images: list[np.ndarray] = []
        given: list[np.ndarray | None] = []
        confidences: list[float | None] = []
        of_reading: list[tuple[Caution, ...]] = []
        for picture, mask in zip(photos, masks, strict=True):
            image, known, confidence, read = self._taken(picture, mask)
            of_reading.append(read)
            images.append(image)
            given.append(known)
            confidences.append(confidence)
        if not images:
            return
        squares, seen, masks_seen = self._find(images, given)
        answer: Mapping[str, np.ndarray] = {}
        if self._read:
            answer = self._answers(self._read, {"image": seen, "mask": masks_seen})
        for index, (image, mask, square) in enumerate(zip(images, given, squares, strict=True)):
            own = {name: value[index] for name, value in answer.items()}
            if mask is None:
                confidences[index] = cautions.confidence(masks_seen[index])
                mask = self._full_mask(image, square, seen[index], masks_seen[index])
            told = (*cautions.of(image, mask, confidences[index]), *of_reading[index])
            if cautions.NO_OBJECT in told:
                yield Material(
                    mask_coverage=0.0,
                    square=square,
                    layers={"mask": mask},
                    warnings=told,
                    image_srgb=image,
                )
                continue
            material = self._material(image, mask, square, seen[index], masks_seen[index], own)
            yield replace(
                material,
                mask_confidence=confidences[index],
                warnings=told,
                image_srgb=image,
            )

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
        image, given, confidence, _ = self._taken(photo, mask)
        height, width = image.shape[:2]
        squares, seen, masks = self._find([image], [given])
        square, found = squares[0], masks[0] >= framing.THRESHOLD
        pixels = np.sum(found & framing.inside(square, height, width, len(found)))
        share = float(pixels) * (square.side / len(found)) ** 2 / (height * width)
        if given is None:
            confidence = cautions.confidence(masks[0])
        return View(square, seen[0], masks[0], min(share, 1.0), confidence, image, given)

    def read(self, view: View) -> Material:
        """Estimate the material of the object in a view.

        Returns:
            The material, with the photo's square, coverage and warnings, and with its layers in the
            pixels of the view.

        Raises:
            ValueError: if the model's answers are not finite, as its weights are damaged.
        """
        given = {"image": view.image[None], "mask": view.mask[None]}
        answer = self._answers(self._read, given) if self._read else {}
        own = {name: value[0] for name, value in answer.items()}
        whole = Square(0, 0, len(view.image))
        material = self._material(view.image, view.mask, whole, view.image, view.mask, own)
        mask = view.given
        if mask is None:
            mask = self._full_mask(view.photo, view.square, view.image, view.mask)
        return replace(
            material,
            square=view.square,
            mask_coverage=view.coverage,
            mask_confidence=view.confidence,
            warnings=cautions.of(view.photo, mask, view.confidence),
        )

    def _taken(
        self, photo: Picture, mask: Picture | None
    ) -> tuple[np.ndarray, np.ndarray | None, float | None, tuple[Caution, ...]]:
        """Return a photo, its mask if SegmentationNet is not to find it, and a masker's confidence.

        The last are what may be wrong with the photo as it was read.

        Raises:
            ValueError: if the photo or the mask is refused (see `estimate`).
        """
        image, alpha, read = photo_of(photo)
        if mask is not None:
            return image, mask_of(mask, *image.shape[:2]), None, read
        if alpha is not None or self._masker is None:
            return image, alpha, None, read
        known = mask_of(self._masker(image), *image.shape[:2])
        return image, known, cautions.confidence(known), read

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
        return self._answers(["mask"], {"image": seen})["mask"]

    def _answers(
        self, outputs: Collection[str], given: Mapping[str, np.ndarray]
    ) -> Mapping[str, np.ndarray]:
        """Return the model's outputs by name; raise ValueError if one is not finite."""
        answers = self._engine.run(outputs, given)
        for name, answer in answers.items():
            if not np.isfinite(answer).all():
                raise ValueError(
                    f"{self._model} answers {name} with NaN or infinity: its weights are damaged, "
                    "so train again or pass other --weights"
                )
        return answers

    def _full_mask(
        self, image: np.ndarray, square: Square, seen: np.ndarray, seen_mask: np.ndarray
    ) -> np.ndarray:
        """Return the mask of a square at the photo's size."""
        if self._full_size:
            return full_size.mask(image, square, seen, seen_mask)
        return framing.paste(seen_mask, square, *image.shape[:2])

    def _material(
        self,
        image: np.ndarray,
        mask: np.ndarray,
        square: Square,
        seen: np.ndarray,
        seen_mask: np.ndarray,
        answer: dict[str, np.ndarray],
    ) -> Material:
        """Return the material of one photo with the estimates that were asked for."""
        only = self._only
        fields: dict[str, Any] = {}
        if "diffuse_albedo" in answer:
            raised = dichromatic.with_saturation_of_pixels(
                answer["diffuse_albedo"], seen, seen_mask
            )
            answer = answer | {"diffuse_albedo": raised}

        def placed(name: str) -> np.ndarray:
            """Return a layer of the answer at the photo's size."""
            if not self._full_size:
                return framing.paste(answer[name], square, *image.shape[:2])
            return full_size.radiance(image, square, seen, seen_mask, answer[name], mask)

        layers = {"mask": mask}
        for asked in filter(only.__contains__, NEEDED):
            if asked == "diffuse":
                shading = layers.get("specular_shading")
                if shading is None:
                    shading = placed("specular_shading")
                layers |= _recomposed(image, mask, shading, answer)
                continue
            for name in NEEDED[asked]:
                if OUTPUTS[name].layer == "sphere":
                    # The sphere is not a part of the photo, so it keeps its own size.
                    layers[name] = answer[name]
                elif OUTPUTS[name].layer == "photo" and name != "mask":
                    layers[name] = placed(name)
        if "albedo" in only:
            fields["diffuse_albedo"] = answer["diffuse_albedo"]
            fields["specular_albedo"] = float(answer["specular_albedo"][0])
        if "exponent" in only:
            fields["exponent"] = float(10.0 ** shininess.log_of_outputs(answer))
            fields["gloss_calibration"] = self.gloss_calibration
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
    diffuse_albedo, specular_albedo = answer["diffuse_albedo"], answer["specular_albedo"]
    layers = {name: np.empty(image_srgb.shape, np.float32) for name in ("diffuse", "recomposed")}
    hidden = np.empty(image_srgb.shape[:2], bool)
    # Row by row: a large photo's intermediate images would take more memory than its layers.
    height = max(1, _PIXELS_AT_ONCE // mask.shape[1])
    parts = [slice(top, top + height) for top in range(0, len(mask), height)]

    # What the highlights leave.
    for part in parts:
        specular = specular_albedo * shading[part]
        linear = colour.srgb_to_linear(image_srgb[part])
        layers["diffuse"][part] = np.maximum(linear - specular, 0) * mask[part]
        hidden[part] = highlights.hidden(image_srgb[part], specular)

    # Where they leave nothing that can be read, what is around; never more than is seen.
    inside = mask[..., 0] >= framing.THRESHOLD
    hidden &= inside
    if hidden.any():
        likely = highlights.closed(layers["diffuse"], inside & ~hidden, hidden)
        seen = colour.srgb_to_linear(image_srgb[hidden]) * mask[hidden]
        layers["diffuse"][hidden] = np.minimum(likely, seen)

    # The grey shading that fits the diffuse part, and the highlights on it.
    for part in parts:
        # The D of a black material is NaN. It does not matter: m_d · D is 0 for every D.
        shade = np.nan_to_num(compositing.diffuse_shading(layers["diffuse"][part], diffuse_albedo))
        specular = specular_albedo * shading[part]
        layers["recomposed"][part] = shade * diffuse_albedo + specular * mask[part]
    return layers
