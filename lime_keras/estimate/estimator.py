"""The estimator of materials from photos: the public Python interface.

Example:
    from lime_keras import Estimator

    material = Estimator().estimate("photo.png")
    print(material.diffuse_albedo, material.specular_albedo, material.exponent)
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, overload

import numpy as np

from lime_keras.estimate import cautions, framing, full_size, recomposition
from lime_keras.estimate.framing import Square
from lime_keras.estimate.pictures import Picture, mask_of, photo_of
from lime_keras.material import Caution, Material
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file
from lime_keras.model.folder import ENGINES, FOR_PHOTOS, PRECISIONS
from lime_keras.optics import dichromatic, shininess
from lime_keras.outputs import NEEDED, OUTPUTS, available
from lime_keras.runtime import engine as runtime
from lime_keras.runtime.engine import Engine


@dataclass(frozen=True)
class View:
    """The square of a photo that the networks see, with the object found in it.

    Attributes:
        square: square of the photo; it may reach beyond the photo.
        image: its content `(S, S, 3)` float32, sRGB in [0, 1].
        mask: coverage `(S, S, 1)` in [0, 1], as the networks see it, beyond the photo too.
        confidence: `Material.mask_confidence`.
        photo: the photo `(H, W, 3)`, sRGB in [0, 1].
        supplied_mask: coverage `(H, W, 1)` in [0, 1] of the photo, unless SegmentationNet finds it.
        doubts: what may be wrong with the photo as it was read.
    """

    square: Square
    image: np.ndarray
    mask: np.ndarray
    confidence: float | None
    photo: np.ndarray
    supplied_mask: np.ndarray | None
    doubts: tuple[Caution, ...] = ()

    @property
    def coverage(self) -> float:
        """The share of the photo that the object covers, in [0, 1]."""
        height, width = self.photo.shape[:2]
        size = len(self.mask)
        inside = framing.inside(self.square, height, width, size)
        pixels = np.sum((self.mask >= framing.THRESHOLD) & inside)
        return min(float(pixels) * (self.square.side / size) ** 2 / (height * width), 1.0)


class Estimator:
    """A trained model, loaded once and applied to many photos: `estimator(photo)`.

    A call takes a photo, or a list of photos, and returns a `Material`, or a list.
    `estimate` finds the object (`view`), estimates its material in the square that the networks see
    (`read`), and brings the layers to the photo's size (`place`). A program that shows the layers
    in the square alone calls the first two.

    Args:
        weights: folder of the trained model, from `lime-train` or
            `lime_keras.model.weights.save`; or name of a set that comes with the package, such
            as `live`; by default `lime_keras.model.folder.FOR_PHOTOS`.
        only: names of the estimates to make, out of `outputs.NEEDED`; only the subnetworks that
            these need are loaded and run. By default all estimates that this model can make.
        engine: `onnx` for ONNX Runtime or `keras` (`runtime.engine.load`); or a loaded engine.
        masker: function that finds the object in place of SegmentationNet, such as
            `lime_keras.runtime.masker.Masker("u2net.onnx")`: it takes a photo `(H, W, 3)`, float32
            sRGB in [0, 1], and returns coverage `(H, W)` or `(H, W, 1)` in [0, 1].
        full_size: whether the edges of the layers follow those of the photo (`full_size`); else
            the layers are interpolated from the networks' size. The mask's coverage follows.
        streaming: whether single frames follow each other, as in `lime-live`: the engine then keeps
            its memory between them, which makes them faster.
        precision: precision of the graphs that ONNX Runtime runs: `float32`, `float16` or `int8`.
            Others than float32 are written by `lime-export --format graphs --precision …`.

    Attributes:
        size: height and width in pixels of the square that the networks see.
        system: name of the system in words.
        gloss_calibration: what makes a probability of the estimated gloss (`optics.gloss`).
        subnetworks: names of the subnetworks that are run, in order; `segmentation` is always
            among them, but is loaded and run only for photos without a mask; with a masker, never.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, its graphs are missing, `only` is empty, or
            `only` names something that this model cannot estimate.
        console.MissingExtra: if the engine needs packages that are not installed.
    """

    def __init__(
        self,
        weights: str | Path = FOR_PHOTOS,
        only: Collection[str] | None = None,
        engine: str | Engine = ENGINES[0],
        masker: Callable[[np.ndarray], np.ndarray] | None = None,
        full_size: bool = False,
        streaming: bool = False,
        precision: str = PRECISIONS[0],
    ):
        self._masker = masker
        self._model = weights
        run = model_folder.find(weights)
        self.gloss_calibration = gloss_file.read(run)
        self._doubts = (cautions.PRINTED_LOBE,) if model_folder.lobe(run) == "printed" else ()
        if isinstance(engine, str):
            engine = runtime.load(run, engine, precision=precision, streaming=streaming)
        self._engine = engine
        self.size, self.system = self._engine.size, self._engine.system
        if isinstance(only, str):
            raise ValueError(f"only is a list of names: pass [{only!r}]")
        self._needed = available(self._engine.outputs)
        self._full_size = full_size
        self._only = set(self._needed if only is None else only)
        unknown = sorted(self._only - set(self._needed))
        if unknown or not self._only:
            raise ValueError(
                f"cannot estimate {unknown}: {weights} holds "
                f"{self._engine.system}; choose from {', '.join(self._needed)}"
            )
        self._outputs = self._outputs_of(self._only)
        self.subnetworks = (
            *(() if masker else self._engine.subnetworks(["mask"], ["image"])),
            *self._engine.subnetworks(self._outputs, ["image", "mask"]),
        )

    @overload
    def __call__(
        self, photo: list[Picture], mask: list[Picture] | None = None
    ) -> list[Material]: ...

    @overload
    def __call__(self, photo: Picture, mask: Picture | None = None) -> Material: ...

    def __call__(
        self, photo: Picture | list[Picture], mask: Picture | list[Picture] | None = None
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
                or leaves [0, 1]; or if the model's answers are not finite, as its weights are
                damaged.
        """
        view = self.view(photo, mask)
        return self.place(view, self.read(view))

    def estimate_many(
        self, photos: Sequence[Picture], masks: Sequence[Picture | None] | None = None
    ) -> Iterator[Material]:
        """Estimate the materials of several photos, of any sizes, one after the other.

        Args:
            photos: photos, each as `estimate` takes it.
            masks: mask of each photo, as `estimate` takes it, or None; by default None for all.

        Yields:
            The material of each photo, in order (see `estimate`).

        Raises:
            ValueError: if the numbers of photos and masks differ, raised at the first material; and
                as `estimate`, at the material of the photo.
        """
        masks = [None] * len(photos) if masks is None else masks
        if len(masks) != len(photos):
            raise ValueError(f"{len(photos)} photos with {len(masks)} masks: pass one for each")
        yield from map(self.estimate, photos, masks)

    def view(self, photo: Picture, mask: Picture | None = None) -> View:
        """Find the object in a photo, and return the square that the networks see.

        Args:
            photo: photo, as `estimate` takes it.
            mask: coverage of the object, as `estimate` takes it, or None.

        Raises:
            ValueError: if the photo or the mask is refused (see `estimate`).
        """
        image, full, doubts = photo_of(photo)
        confidence = None
        if mask is not None:
            full = mask_of(mask, *image.shape[:2])
            doubts = tuple(one for one in doubts if one.code != "alpha-ignored")
        elif full is None and self._masker is not None:
            full = mask_of(self._masker(image), *image.shape[:2])
            confidence = cautions.confidence(full)
        if full is None:
            return replace(self._find(image), doubts=doubts)
        view = self._cut(image, framing.around_mask(full))
        low = framing.cut_layer(full, view.square, self.size)
        return replace(view, mask=low, supplied_mask=full, confidence=confidence, doubts=doubts)

    def look(self, frame: np.ndarray, square: Square | None) -> View:
        """Find the object in a frame of a stream, first where it was in the frame before.

        Args:
            frame: frame `(H, W, 3)`, uint8 sRGB, which stays as it is.
            square: square in which to look (`framing.following`); None to look as `view` does.

        Returns:
            The view of `square`, if the mask there shows an object that lies in it; else that of
            the whole frame, or closer, as `view` has it.
        """
        if square is not None:
            view = self._segment(frame, square)
            if framing.following(view.mask, square, *frame.shape[:2]) is not None:
                return view
        return self._find(frame)

    def doubts(self, view: View) -> tuple[Caution, ...]:
        """Return the warnings of the estimate of a view: why it may be wrong (`cautions`)."""
        return self._warnings(view, self._place_mask(view))

    def read(self, view: View, only: Collection[str] | None = None) -> Material:
        """Estimate the material of the object in a view.

        Args:
            view: view that `view` or `look` returned.
            only: names of the estimates to make, out of the estimator's own; by default all.

        Returns:
            The material, with the view's coverage, confidence and square, and with its layers in
            the pixels of the view: the mask, and the networks' layers that the estimates need. It
            has no warnings.

        Raises:
            ValueError: if the model's answers are not finite, as its weights are damaged.
        """
        outputs = self._outputs if only is None else self._outputs_of(self._only & set(only))
        answer = self._run(outputs, image=view.image, mask=view.mask) if outputs else {}
        fields: dict[str, Any] = {}
        layers = {name: value for name, value in answer.items() if OUTPUTS[name].layer}
        if "diffuse_albedo" in answer:
            fields["diffuse_albedo"] = dichromatic.with_saturation_of_pixels(
                answer["diffuse_albedo"], view.image, view.mask
            )
        if "specular_albedo" in answer:
            fields["specular_albedo"] = float(answer["specular_albedo"][0])
        if {"exponent_bin_probabilities", "log_exponent"} & set(answer):
            fields["exponent"] = float(10.0 ** shininess.log_of_outputs(answer))
            fields["gloss_calibration"] = self.gloss_calibration
        if "exponent_bin_probabilities" in answer:
            probabilities = answer["exponent_bin_probabilities"]
            fields["exponent_bin_probabilities"] = probabilities
            fields["exponent_entropy"] = float(shininess.entropy(probabilities))
        return Material(
            mask_coverage=view.coverage,
            mask_confidence=view.confidence,
            square=view.square,
            layers={"mask": view.mask} | layers,
            **fields,
        )

    def place(self, view: View, material: Material) -> Material:
        """Bring the material of a view to its photo.

        Args:
            view: view that `view` returned.
            material: material that `read` returned for it.

        Returns:
            The material with the layers that were asked for at the photo's size, the coverage and
            the warnings; where no object was found, with nothing but the mask.
        """
        mask = self._place_mask(view)
        warnings = self._warnings(view, mask)
        if cautions.NO_OBJECT in warnings:
            return Material(
                mask_coverage=0.0,
                square=view.square,
                layers={"mask": mask},
                warnings=warnings,
                image_srgb=view.photo,
            )
        layers = {"mask": mask}
        for asked in filter(self._only.__contains__, NEEDED):
            if asked == "diffuse":
                shading = layers.get("specular_shading")
                if shading is None:
                    shading = self._place_layer(view, material.layers["specular_shading"], mask)
                layers["diffuse"] = recomposition.diffuse(view.photo, mask, shading, material)
                layers["recomposed"] = recomposition.recompose(
                    layers["diffuse"], mask, shading, material
                )
                continue
            for name in NEEDED[asked]:
                if OUTPUTS[name].layer == "sphere":
                    # The sphere is not a part of the photo, so it keeps its own size.
                    layers[name] = material.layers[name]
                elif OUTPUTS[name].layer == "photo" and name != "mask":
                    layers[name] = self._place_layer(view, material.layers[name], mask)
        if "albedo" not in self._only:
            material = replace(material, diffuse_albedo=None, specular_albedo=None)
        coverage = float(np.mean(mask >= framing.THRESHOLD))
        return replace(
            material,
            mask_coverage=coverage,
            layers=layers,
            warnings=warnings,
            image_srgb=view.photo,
        )

    def _cut(self, photo: np.ndarray, square: Square) -> View:
        """Return the view of a square in which nothing was looked for yet."""
        nothing = np.zeros((self.size, self.size, 1), np.float32)
        return View(square, framing.cut(photo, square, self.size), nothing, None, photo, None)

    def _find(self, photo: np.ndarray) -> View:
        """Return the view of a photo with its object's mask, a closer one of a small object."""
        view = self._segment(photo, framing.whole(*photo.shape[:2]))
        square = framing.around(view.mask, view.square)
        if square != view.square:
            closer = self._segment(photo, square)
            # If the closer view shows no object, keep the whole photo.
            if np.any(closer.mask >= framing.THRESHOLD):
                return closer
        return view

    def _segment(self, photo: np.ndarray, square: Square) -> View:
        """Return the view of a square with SegmentationNet's mask and its confidence."""
        view = self._cut(photo, square)
        mask = self._run(["mask"], image=view.image)["mask"]
        return replace(view, mask=mask, confidence=cautions.confidence(mask))

    def _outputs_of(self, only: Collection[str]) -> list[str]:
        """Return the names of the outputs, all but the mask, that estimates need."""
        return sorted({output for name in only for output in self._needed[name]} - {"mask"})

    def _run(self, outputs: Collection[str], **inputs: np.ndarray) -> dict[str, np.ndarray]:
        """Return the model's outputs of a view by name; raise ValueError if one is not finite."""
        answers = self._engine.run(outputs, {name: value[None] for name, value in inputs.items()})
        for name, answer in answers.items():
            if not np.isfinite(answer).all():
                raise ValueError(
                    f"{self._model} answers {name} with NaN or infinity: its weights are damaged, "
                    "so train again or pass other --weights"
                )
        return {name: answer[0] for name, answer in answers.items()}

    def _warnings(self, view: View, mask: np.ndarray) -> tuple[Caution, ...]:
        """Return why the estimate of a view may be wrong, by its mask at the photo's size."""
        photo = view.photo / np.float32(255) if view.photo.dtype == np.uint8 else view.photo
        return (*cautions.of(photo, mask, view.confidence), *view.doubts, *self._doubts)

    def _place_mask(self, view: View) -> np.ndarray:
        """Return the mask of a view at the photo's size."""
        if view.supplied_mask is not None:
            return view.supplied_mask
        if self._full_size:
            placed = full_size.mask(view.photo, view.square, view.image, view.mask)
        else:
            placed = framing.paste(view.mask, view.square, *view.photo.shape[:2])
        return np.minimum(placed, 1)  # interpolation rounds

    def _place_layer(self, view: View, layer: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """Return a layer of radiance at the photo's size, with the photo's mask `(H, W, 1)`."""
        if self._full_size:
            return full_size.radiance(view.photo, view.square, view.image, view.mask, layer, mask)
        return framing.paste(layer, view.square, *view.photo.shape[:2])
