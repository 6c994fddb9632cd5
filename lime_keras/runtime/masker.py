"""Masks from a network of another project: an ONNX file of the U²-Net family, run as it is.

Such files (U²-Net, IS-Net, BiRefNet, those of rembg) take one picture `(1, 3, h, w)`, float, its
colours normalised, stretched to h × w whatever its shape; their first output is `(1, 1, h, w)`, the
coverage in [0, 1] or its logits. Nothing is downloaded.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from lime_keras.runtime.sessions import Session


@dataclass(frozen=True)
class Family:
    """The way in which a family of networks sees pictures.

    Attributes:
        mean: subtracted from the sRGB channels in [0, 1].
        deviation: what the channels are divided by then.
        by_maximum: whether the picture is first divided by its largest value.
        size: height and width in pixels, where the file leaves them open.
    """

    mean: tuple[float, float, float]
    deviation: tuple[float, float, float]
    by_maximum: bool
    size: int


FAMILIES = {
    "u2net": Family((0.485, 0.456, 0.406), (0.229, 0.224, 0.225), True, 320),
    "birefnet": Family((0.485, 0.456, 0.406), (0.229, 0.224, 0.225), False, 1024),
    "isnet": Family((0.5, 0.5, 0.5), (1.0, 1.0, 1.0), False, 1024),
}
"""Families by name: `u2net` (U²-Net, U²-NetP, silueta), `birefnet`, `isnet` (IS-Net of DIS)."""
_DTYPES = {"tensor(float16)": np.float16}  # NumPy types of inputs that are not float32
_LARGEST = 4096  # largest height and width of a network's picture in pixels
_ROUNDING = 1e-3  # largest distance of a coverage from [0, 1], which float16 may cause


class Masker:
    """A network that finds the object in a photo.

    Args:
        path: ONNX file of the network.
        family: how it sees pictures, a name out of `FAMILIES`.

    Raises:
        ValueError: if there is no such family, or the file is missing, is not ONNX, or is no
            network from one picture.
    """

    def __init__(self, path: str | Path, family: str = "u2net"):
        if family not in FAMILIES:
            raise ValueError(f"no family {family!r} of maskers: choose from {', '.join(FAMILIES)}")
        self._path, self._family = Path(path), FAMILIES[family]
        if not self._path.is_file():
            raise ValueError(
                f"{path} is no file: pass the ONNX file of a masker; none is downloaded"
            )
        try:
            self._session = Session(lambda: str(path))
        except Exception as error:  # ONNX Runtime's own classes have no common base.
            raise ValueError(f"{path} cannot be opened as an ONNX network: {error}") from error
        inputs = self._session.opened().get_inputs()
        shape = inputs[0].shape if len(inputs) == 1 else []
        if len(shape) != 4 or (isinstance(shape[1], int) and shape[1] != 3):
            raise ValueError(
                f"{path} takes {[entry.shape for entry in inputs]}, and a masker takes one picture "
                "(1, 3, height, width): pass a network of the U²-Net family"
            )
        if not self._session.opened().get_outputs():
            raise ValueError(
                f"{path} answers nothing, and a masker answers a mask: pass a network of the "
                "U²-Net family"
            )
        self._input, self._dtype = inputs[0].name, _DTYPES.get(inputs[0].type, np.float32)
        self._height, self._width = (
            edge if isinstance(edge, int) else self._family.size for edge in shape[2:]
        )
        if not all(1 <= edge <= _LARGEST for edge in (self._height, self._width)):
            raise ValueError(
                f"{path} takes pictures of {self._width}×{self._height} pixels, and a masker's "
                f"edges have 1 to {_LARGEST}: the file is damaged, or no masker"
            )

    def __call__(self, image_srgb: np.ndarray) -> np.ndarray:
        """Return the coverage `(H, W, 1)` float32 in [0, 1] of the object in a photo.

        Args:
            image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].

        Raises:
            ValueError: if the network fails, or its first output is no mask.
        """
        height, width = image_srgb.shape[:2]
        levels = np.round(np.clip(image_srgb, 0, 1) * 255).astype(np.uint8)
        small = Image.fromarray(levels).resize(
            (self._width, self._height), Image.Resampling.BILINEAR
        )
        pixels = np.asarray(small, np.float32) / 255
        if self._family.by_maximum:
            pixels = pixels / max(float(pixels.max()), 1e-6)
        pixels = (pixels - np.array(self._family.mean)) / np.array(self._family.deviation)
        mask = self._mask(pixels.transpose(2, 0, 1)[None].astype(self._dtype))
        shown = Image.fromarray(mask).resize((width, height), Image.Resampling.BILINEAR)
        return np.clip(np.asarray(shown, np.float32), 0, 1)[..., None]

    def _mask(self, pixels: np.ndarray) -> np.ndarray:
        """Return the coverage `(h, w)` that the network answers."""
        output = self._session.opened().get_outputs()[0].name
        try:
            answer = np.asarray(self._session.run([output], {self._input: pixels})[0], np.float32)
        except ValueError as error:
            raise ValueError(f"{self._path} fails on a picture {pixels.shape}: {error}") from error
        if answer.size == 0 or answer.ndim < 2 or answer.size != np.prod(answer.shape[-2:]):
            raise ValueError(
                f"{self._path} answers {answer.shape} first, and a masker answers one mask "
                "(1, 1, height, width): pass a network of the U²-Net family"
            )
        mask = answer.reshape(answer.shape[-2:])
        if not np.all(np.isfinite(mask)):
            raise ValueError(f"{self._path} answers NaN or infinity: pass another masker")
        if mask.min() < -_ROUNDING or mask.max() > 1 + _ROUNDING:
            # Logits: BiRefNet and others leave the sigmoid to the user.
            mask = 0.5 * (1 + np.tanh(0.5 * mask))
        return np.ascontiguousarray(mask)
