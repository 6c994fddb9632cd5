"""Data classes of a material: the three quantities of the model, and an estimate of them."""

from dataclasses import asdict, dataclass, field

import numpy as np


@dataclass(frozen=True)
class BlinnPhong:
    """A complete Blinn–Phong material, as Eq. 4 takes it.

    Attributes:
        diffuse_albedo: m_d, `(3,)` linear RGB in [0, 1].
        specular_albedo: m_s in [0, 1], the factor of the furnace-normalised S.
        exponent: shininess s, at least 0.
        ambient: m_a, radiance; the same in all three channels.
    """

    diffuse_albedo: np.ndarray
    specular_albedo: float
    exponent: float
    ambient: float = 0.0


@dataclass(frozen=True)
class Caution:
    """A reason why an estimate may be wrong.

    Attributes:
        code: name that stays the same from version to version, such as `small-object`.
        message: sentence that says what was seen and what mends it.
    """

    code: str
    message: str


@dataclass(frozen=True)
class Material:
    """An estimate of a material and its layers; a quantity that was not estimated is None.

    Where no object was found nothing is estimated: `mask_coverage` is 0, and `warnings` say so.

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
        square: top row, left column and side, in pixels of the photo, of the square that the
            networks saw; it may reach beyond the photo.
        warnings: reasons why the estimate may be wrong (`lime_keras.estimate.cautions`); empty if
            none is known.
        layers: images by name. At the photo's size: `mask` `(H, W, 1)` in [0, 1];
            `specular_shading` and `mirror` `(H, W, 1)` linear radiance; `diffuse` `(H, W, 3)`
            linear radiance, the photo minus m_s · S inside the mask; `recomposed` `(H, W, 3)`
            linear radiance, Eq. 4 of the estimate with the grey D that fits the photo best. From
            the baseline `reflectance_map` `(S, S, 3)` instead of S and M: linear radiance of a
            sphere of the material, 0 beside the sphere.
    """

    diffuse_albedo: np.ndarray | None = None
    specular_albedo: float | None = None
    exponent: float | None = None
    exponent_bin_probabilities: np.ndarray | None = None
    mask_coverage: float | None = None
    mask_confidence: float | None = None
    exponent_entropy: float | None = None
    square: tuple[int, int, int] | None = None
    warnings: tuple[Caution, ...] = ()
    layers: dict[str, np.ndarray] = field(default_factory=dict)

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
        del numbers["layers"], numbers["warnings"]
        known: dict[str, object] = {
            name: [_rounded(x) for x in value] if np.ndim(value) else _rounded(value)
            for name, value in numbers.items()
            if value is not None
        }
        return known | {"warnings": [asdict(caution) for caution in self.warnings]}


def _rounded(value: float) -> float:
    return value if isinstance(value, int) else float(f"{value:.6g}")
