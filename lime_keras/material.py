"""An estimate of a material, and the reasons to distrust it."""

import base64
import html
import io
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lime_keras.optics import colour, gloss, microfacets
from lime_keras.optics.blinn_phong import BlinnPhong

if TYPE_CHECKING:
    from PIL import Image


@dataclass(frozen=True)
class Caution:
    """A reason why an estimate may be wrong.

    Attributes:
        code: name that stays the same from version to version, such as `small-object`.
        message: sentence that says what was seen and what mends it.
    """

    code: str
    message: str


@dataclass(frozen=True, repr=False)
class Material:
    """An estimate of a material and its layers; a quantity that was not estimated is None.

    `print` says it in a line, a notebook shows its preview, and `show` opens that in a window.
    `save` writes everything, `to_gltf`, `to_mtl` and `to_mitsuba` a file for another program.

    Where no object was found nothing is estimated: `mask_coverage` is 0, and `warnings` say so.
    What follows from the numbers, such as `exponent_interval` and `gloss`, are properties.

    Attributes:
        diffuse_albedo: m_d, `(3,)` linear RGB in [0, 1].
        specular_albedo: m_s in [0, 1], the factor of the furnace-normalised S.
        exponent: shininess s, from the expected log10 s over the eight classes; from a model that
            regresses the exponent, 10 to the regressed log10 s.
        exponent_bin_probabilities: probabilities of the eight classes `(8,)`, summing to 1; None
            from a model that regresses the exponent.
        mask_coverage: share of the photo that the object covers, in [0, 1].
        mask_confidence: intersection over union that the mask is expected to have with the true
            one, in [0, 1] (`lime_keras.estimate.cautions.confidence`); None if it was given.
        exponent_entropy: entropy of the class probabilities in bits, from 0 (certain) to 3 (all
            classes equally likely); None from a model that regresses the exponent.
        gloss_calibration: what makes `glossy_probability` of the numbers; of the model, if known.
        square: top row, left column and side, in pixels of the photo, of the square that the
            networks saw; it may reach beyond the photo.
        warnings: reasons why the estimate may be wrong (`lime_keras.estimate.cautions`); empty if
            none is known.
        layers: images by name. At the photo's size: `mask` `(H, W, 1)` in [0, 1];
            `specular_shading` and `mirror` `(H, W, 1)` linear radiance; `diffuse` `(H, W, 3)`
            linear radiance, the photo minus m_s · S inside the mask and, where a highlight hides
            it, what is around (`lime_keras.optics.highlights`); `recomposed` `(H, W, 3)`
            linear radiance, Eq. 4 of the estimate with the grey D that fits the photo best. From
            the baseline `reflectance_map` `(S, S, 3)` instead of S and M: linear radiance of a
            sphere of the material, 0 beside the sphere.
        image_srgb: the photo `(H, W, 3)` that it was estimated from, sRGB in [0, 1]; None if it
            is not known, as for a video.

    Example:
        >>> Material(np.array([0.5, 0.2, 0.1]), 0.05, 250.0, mask_coverage=0.4)
        Material(glossy, s 250, #bc7c59, m_s 0.05, covers 40.0%)
    """

    diffuse_albedo: np.ndarray | None = None
    specular_albedo: float | None = None
    exponent: float | None = None
    exponent_bin_probabilities: np.ndarray | None = None
    mask_coverage: float | None = None
    mask_confidence: float | None = None
    exponent_entropy: float | None = None
    gloss_calibration: gloss.Calibration = gloss.DEFAULT
    square: tuple[int, int, int] | None = None
    warnings: tuple[Caution, ...] = ()
    layers: dict[str, np.ndarray] = field(default_factory=dict)
    image_srgb: np.ndarray | None = None

    @property
    def exponent_interval(self) -> tuple[float, float] | None:
        """The exponents between which s lies with probability 0.8 (`lime_keras.optics.gloss`).

        None without probabilities of the classes.
        """
        if self.exponent_bin_probabilities is None:
            return None
        return gloss.interval(self.exponent_bin_probabilities)

    @property
    def gloss(self) -> str | None:
        """The gloss in words (`gloss.describe`), such as `rather glossy (81 %)`."""
        if self.exponent is None or self.glossy_probability is None:
            return None
        return gloss.describe(self.glossy_probability, self.exponent, self.specular_albedo)

    @property
    def glossy_probability(self) -> float | None:
        """The probability in [0, 1] that the object is semi-gloss, glossy or high-gloss."""
        if self.exponent is None:
            return None
        return self.gloss_calibration.probability(self.exponent, self.specular_albedo)

    @property
    def roughness(self) -> float | None:
        """The roughness √α in (0, 0.78] of the GGX lobe nearest to s, as engines have it."""
        if self.exponent is None:
            return None
        return math.sqrt(float(microfacets.ggx_alpha(self.exponent)))

    @property
    def diffuse_srgb_hex(self) -> str | None:
        """The diffuse albedo as sRGB, `#rrggbb`."""
        return None if self.diffuse_albedo is None else srgb_hex(self.diffuse_albedo)

    def whole(self) -> BlinnPhong | None:
        """Return the complete material, or None if one of its quantities was not estimated."""
        if self.diffuse_albedo is None or self.specular_albedo is None or self.exponent is None:
            return None
        return BlinnPhong(self.diffuse_albedo, self.specular_albedo, self.exponent)

    def to_json(self) -> dict[str, object]:
        """Return the numbers and the warnings, ready for `json.dumps`; no layers and no None.

        Six significant digits are kept: more than an estimate has, and as many as float32 holds.
        """
        numbers = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for name in ("layers", "warnings", "gloss_calibration", "image_srgb"):
            del numbers[name]
        numbers |= {name: getattr(self, name) for name in _DERIVED}
        known = {name: _plain(value) for name, value in numbers.items() if value is not None}
        return known | {"warnings": [asdict(caution) for caution in self.warnings]}

    def preview(self) -> "Image.Image":
        """Draw the layers, a sphere of the material and its numbers; without a photo, the sphere.

        Raises:
            ValueError: if there is neither a photo with its mask nor a whole material.
        """
        from PIL import Image

        from lime_keras.estimate import preview

        if self.image_srgb is not None and "mask" in self.layers:
            picture = preview.sheet(self.image_srgb, self)
        else:
            picture = preview.sphere(self, preview.TILE)
        return Image.fromarray(np.rint(255 * picture).astype(np.uint8))

    def show(self) -> None:
        """Show `preview` in a window."""
        self.preview().show()

    def save(self, folder: str | Path, name: str = "material") -> list[Path]:
        """Write numbers, layers, preview and the files for other programs, as `lime-estimate` does.

        Files of these names are replaced.

        Args:
            folder: folder for the files; made if it is missing.
            name: beginning of the files' names.

        Returns:
            Paths of the files, the numbers, `NAME.json`, first.

        Raises:
            OSError: if a file cannot be written.
        """
        from lime_keras.estimate import files
        from lime_keras.io import result_json

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        written = files.write_pictures(folder, name, self)
        written += files.write_formats(folder, name, self)
        numbers = folder / f"{name}.json"
        # So that `lime-estimate` knows them in a folder of photos.
        result_json.write(numbers, self.to_json(), {}, [numbers.name, *map(str, written)])
        return [numbers, *(folder / file for file in written)]

    def to_gltf(self, path: str | Path) -> Path:
        """Write a glTF 2.0 file, the material on a sphere (`lime_keras.estimate.interchange`).

        Raises:
            ValueError: if the material is not whole.
            OSError: if the file cannot be written.
        """
        from lime_keras.estimate import interchange

        return _written(path, interchange.gltf(self, Path(path).stem))

    def to_mtl(self, path: str | Path) -> Path:
        """Write a Wavefront MTL file (`lime_keras.estimate.interchange`); raises as `to_gltf`."""
        from lime_keras.estimate import interchange

        return _written(path, interchange.wavefront(self, Path(path).stem))

    def to_mitsuba(self, path: str | Path) -> Path:
        """Write a scene for `mitsuba.load_dict`, as JSON; raises as `to_gltf`."""
        from lime_keras.estimate import interchange

        return _written(path, json.dumps(interchange.mitsuba_scene(self), indent=1) + "\n")

    def __repr__(self) -> str:
        parts = []
        if self.exponent is not None:
            parts += [self.gloss, gloss.numbers(self.exponent, self.exponent_interval)]
        if self.diffuse_albedo is not None:
            parts.append(self.diffuse_srgb_hex)
        if self.specular_albedo is not None:
            parts.append(f"m_s {self.specular_albedo:.2f}")
        if self.mask_coverage is not None:
            parts.append(f"covers {self.mask_coverage:.1%}" if self.mask_coverage else "no object")
        parts += [f"! {caution.code}" for caution in self.warnings]
        return f"Material({', '.join(str(part) for part in parts)})"

    def _repr_html_(self) -> str:
        items = "".join(f"<li>{html.escape(caution.message)}</li>" for caution in self.warnings)
        text = f"<p><code>{html.escape(repr(self))}</code></p><ul>{items}</ul>"
        try:
            picture = self.preview()
        except ValueError:
            return text
        encoded = io.BytesIO()
        picture.save(encoded, "JPEG", quality=90)
        data = base64.b64encode(encoded.getvalue()).decode()
        return f'<img src="data:image/jpeg;base64,{data}" alt="preview">{text}'


def _written(path: str | Path, text: str) -> Path:
    from lime_keras.io import atomic

    atomic.write(Path(path), text)
    return Path(path)


_DERIVED = ("exponent_interval", "gloss", "glossy_probability", "roughness", "diffuse_srgb_hex")
"""Properties that `Material.to_json` writes after the fields."""


def srgb_hex(linear: Any) -> str:
    """Return a colour `(3,)`, linear RGB, clipped to [0, 1], as sRGB `#rrggbb`.

    Example:
        >>> srgb_hex([1.0, 0.2140, 0.0])
        '#ff7f00'
    """
    srgb = colour.linear_to_srgb(np.clip(np.asarray(linear, np.float64), 0, 1))
    return "#" + "".join(f"{round(255 * float(value)):02x}" for value in srgb)


def _plain(value: Any) -> object:
    """Return a number, text or sequence of numbers as JSON has it."""
    if isinstance(value, str):
        return value
    return [_rounded(x) for x in value] if np.ndim(value) else _rounded(value)


def _rounded(value: float) -> float:
    return value if isinstance(value, int) else float(f"{value:.6g}")
