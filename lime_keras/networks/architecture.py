"""How wide and deep the subnetworks are: the presets."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Architecture:
    """Sizes of the five subnetworks.

    Attributes:
        size: height and width of the input image in pixels.
        unet_width: channels of a U-Net's first level; each level down doubles them.
        unet_depth: levels below the first.
        encoder_width: channels of the first of an encoder's five blocks; doubled up to eight times.
        dense_width: units of the two hidden dense layers of an encoder.
    """

    size: int
    unet_width: int
    unet_depth: int
    encoder_width: int
    dense_width: int


PRESETS = {
    # Small enough that all eight stages train in minutes on two cores.
    "smoke": Architecture(size=128, unet_width=12, unet_depth=4, encoder_width=16, dense_width=64),
    # The lost figures' sizes as the printed run times bound them: 28 GFLOP a U-Net.
    "paper": Architecture(size=256, unet_width=32, unet_depth=4, encoder_width=32, dense_width=256),
}
