"""The architecture of a system, which is its subnetworks with their sizes, and the presets."""

from dataclasses import dataclass, replace

SYSTEMS = ("lime", "reflectance-map")
EXPONENTS = ("classification", "regression")

_RANGES = {
    "size": (1, 4096),
    "unet_width": (1, 1024),
    "unet_depth": (0, 10),
    "encoder_width": (1, 1024),
    "dense_width": (1, 65536),
}
"""Least and largest value of each setting, the latter far above all that can be trained."""
ENCODER_BLOCKS = 5  # number of an encoder's blocks, each of which halves the height and width


@dataclass(frozen=True)
class Architecture:
    """The settings that decide a system's subnetworks and their layers.

    Attributes:
        size: height and width of the input image in pixels. The encoders halve them
            `ENCODER_BLOCKS` times, the U-Nets `unet_depth` times.
        unet_width: channels of a U-Net's first level; each level below doubles the channels, to at
            most eight times this number.
        unet_depth: number of a U-Net's levels below the first.
        encoder_width: channels of the first of an encoder's five blocks; each later block doubles
            the channels, to at most eight times this number.
        dense_width: units of each of an encoder's two hidden dense layers.
        system: `lime` for the paper's method, or `reflectance-map` for its baseline, which
            estimates a reflectance map first and the material from the map.
        mirror: whether the system has a MirrorNet, whose prediction the paper's ExponentNet reads
            beside S.
        exponent: `classification` of the exponent into eight bins, or `regression` of log10 s.
        pretrained: whether SegmentationNet's encoder is EfficientNet-Lite0
            (`networks.efficientnet`), rather than that of a U-Net, and its mask passes the guided
            filter (`networks.guided_filter`).
        dichromatic: whether the encoders see the split of the colours into diffuse and grey light
            (`optics.dichromatic`).
        dichromatic_shading: whether SpecularNet sees it, too, where the encoders do.
        hue: whether m_d is turned to the hue of the object's pixels (`blocks.HueOfPixels`).
        mask_contrast: whether the mask is stretched before it cuts the object out
            (`registry.MASK_CONTRAST`).
        linear: whether SpecularNet and MirrorNet answer, and other subnetworks read, linear
            radiance in place of log(1 + x).

    Raises:
        ValueError: if a name is unknown, two settings exclude each other, or the size cannot be
            halved so often.
    """

    size: int
    unet_width: int
    unet_depth: int
    encoder_width: int
    dense_width: int
    system: str = "lime"
    mirror: bool = True
    exponent: str = "classification"
    pretrained: bool = False
    dichromatic: bool = False
    hue: bool = False
    mask_contrast: bool = True
    linear: bool = False
    dichromatic_shading: bool = True

    def __post_init__(self) -> None:
        """Raise ValueError if the settings describe no system."""
        for name, (least, most) in _RANGES.items():
            value = getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ValueError(
                    f"no networks of {name} {value!r}: take a number from {least} to {most}"
                )
        if self.system not in SYSTEMS or self.exponent not in EXPONENTS:
            raise ValueError(
                f"no system {self.system} with exponent {self.exponent}: there are "
                f"{', '.join(SYSTEMS)} and {', '.join(EXPONENTS)}"
            )
        ablated = not self.mirror or self.exponent != "classification"
        if self.system != "lime" and (ablated or self.dichromatic or self.hue):
            raise ValueError(
                "the reflectance-map baseline has no MirrorNet to leave out, no ExponentNet, no "
                "dichromatic split and no hue of pixels: take one ablation at a time"
            )
        multiple = 2 ** max(ENCODER_BLOCKS, self.unet_depth)
        if self.size % multiple:
            raise ValueError(
                f"no networks for images of {self.size} pixels: they halve them "
                f"{max(ENCODER_BLOCKS, self.unet_depth)} times, so take a multiple of {multiple}"
            )

    @property
    def description(self) -> str:
        """The name of the system in words, ablations included."""
        if self.system == "reflectance-map":
            return "the reflectance-map baseline"
        without = [] if self.mirror else ["without MirrorNet"]
        regresses = ["with its exponent by regression"] if self.exponent == "regression" else []
        where = "" if self.dichromatic_shading else " in its encoders"
        parts = {
            "the dichromatic split" + where: self.dichromatic,
            "the hue of the pixels": self.hue,
        }
        read = " and ".join(name for name, there in parts.items() if there)
        return " ".join(["LIME", *([f"with {read}"] if read else []), *without, *regresses])


_LIVE = Architecture(
    size=128,
    unet_width=16,
    unet_depth=4,
    encoder_width=16,
    dense_width=128,
    pretrained=True,
    dichromatic=True,
    dichromatic_shading=False,
    hue=True,
)
PRESETS = {
    # Small enough that all stages train in minutes on two cores, without the pretrained weights.
    "smoke": replace(_LIVE, unet_width=12, dense_width=64, pretrained=False),
    # For every frame of a fast camera: in ONNX Runtime a third of the time of `live`. Encoders
    # cost little at any width.
    "nano": replace(_LIVE, size=64, unet_width=8),
    # For video (docs/explanation/decisions.md).
    "live": _LIVE,
    # The figures that show the paper's layer sizes are lost. Its run times bound the sizes: a U-Net
    # takes at most 28 GFLOP.
    "paper": Architecture(
        size=256,
        unet_width=32,
        unet_depth=4,
        encoder_width=32,
        dense_width=256,
        mask_contrast=False,
        linear=True,
    ),
}
