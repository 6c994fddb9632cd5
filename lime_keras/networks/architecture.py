"""Which subnetworks a system is made of, and how wide and deep they are: the presets."""

from dataclasses import dataclass

SYSTEMS = ("lime", "reflectance-map")
EXPONENTS = ("classification", "regression")

ENCODER_BLOCKS = 5
"""How often an encoder halves its input."""


@dataclass(frozen=True)
class Architecture:
    """What decides the subnetworks' layers.

    Attributes:
        size: height and width of the input image in pixels, which the encoders halve
            `ENCODER_BLOCKS` times and the U-Nets `unet_depth` times.
        unet_width: channels of a U-Net's first level; each level down doubles them.
        unet_depth: levels below the first.
        encoder_width: channels of the first of an encoder's five blocks; doubled up to eight times.
        dense_width: units of the two hidden dense layers of an encoder.
        system: `lime`, section 5's, or `reflectance-map`, the baseline of its evaluation, which
            reads the material from an estimated reflectance map.
        mirror: whether there is a MirrorNet, whose answer ExponentNet sees beside S.
        exponent: `classification` into the eight bins, or `regression` of log10 s.

    Raises:
        ValueError: if they do not go together.
    """

    size: int
    unet_width: int
    unet_depth: int
    encoder_width: int
    dense_width: int
    system: str = "lime"
    mirror: bool = True
    exponent: str = "classification"

    def __post_init__(self) -> None:
        """Refuse what no preset or option asks for."""
        if self.system not in SYSTEMS or self.exponent not in EXPONENTS:
            raise ValueError(
                f"no system {self.system} with exponent {self.exponent}: there are "
                f"{', '.join(SYSTEMS)} and {', '.join(EXPONENTS)}"
            )
        if self.system != "lime" and (not self.mirror or self.exponent != "classification"):
            raise ValueError(
                "the reflectance-map baseline has no MirrorNet to leave out and no ExponentNet: "
                "take one ablation at a time"
            )
        multiple = 2 ** max(ENCODER_BLOCKS, self.unet_depth)
        if self.size < 1 or self.size % multiple:
            raise ValueError(
                f"no networks for images of {self.size} pixels: they halve them "
                f"{max(ENCODER_BLOCKS, self.unet_depth)} times, so take a multiple of {multiple}"
            )

    @property
    def description(self) -> str:
        """Which of the evaluation's systems this is, in words."""
        if self.system == "reflectance-map":
            return "the reflectance-map baseline"
        without = [] if self.mirror else ["without MirrorNet"]
        regresses = ["with its exponent by regression"] if self.exponent == "regression" else []
        return " ".join(["LIME", *without, *regresses])


PRESETS = {
    # Small enough that all eight stages train in minutes on two cores.
    "smoke": Architecture(size=128, unet_width=12, unet_depth=4, encoder_width=16, dense_width=64),
    # For video (docs/decisions.md).
    "live": Architecture(size=128, unet_width=16, unet_depth=4, encoder_width=16, dense_width=128),
    # The lost figures' sizes as the printed run times bound them: at most 28 GFLOP a U-Net.
    "paper": Architecture(size=256, unet_width=32, unet_depth=4, encoder_width=32, dense_width=256),
}
