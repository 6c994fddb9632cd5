"""The subnetworks of section 5; their inputs are named after the quantities they read.

The paper's wiring is that of an architecture with `layers` and without `dichromatic`; without
`layers`, MaterialNet reads the image in place of AlbedoNet and ExponentNet, which read S and M.
"""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import HueOfPixels, encoder, pretrained_unet, unet
from lime_keras.optics.dichromatic import CHANNELS
from lime_keras.optics.shininess import BIN_COUNT, LOG_HIGH, LOG_LOW


def segmentation_net(architecture: Architecture) -> keras.Model:
    """Build SegmentationNet: `image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 1)` coverage.

    The output is not yet clipped to [0, 1]. The head is linear: under the paper's ℓ2 loss a sigmoid
    saturated within the first steps and did not recover (docs/explanation/decisions.md).
    """
    image = keras.Input((architecture.size, architecture.size, 3), name="image")
    if architecture.pretrained:
        mask = pretrained_unet(image, channels=1)
    else:
        mask = _unet(image, architecture, channels=1)
    return keras.Model(image, mask, name="segmentation_net")


def specular_net(architecture: Architecture) -> keras.Model:
    """Build SpecularNet: `masked_image` `(B, S, S, 3)` sRGB → `(B, S, S, 1)` compressed S.

    With `dichromatic`, it reads the split, too.
    """
    inputs = _inputs(architecture, "masked_image", *_split(architecture))
    shading = _unet(_joined(inputs), architecture, channels=1)
    return keras.Model(_one_or_all(inputs), shading, name="specular_net")


def mirror_net(architecture: Architecture) -> keras.Model:
    """Build MirrorNet: compressed `specular_shading` `(B, S, S, 1)` → compressed M, same shape."""
    [shading] = _inputs(architecture, "specular_shading")
    return keras.Model(shading, _unet(shading, architecture, channels=1), name="mirror_net")


def exponent_net(architecture: Architecture) -> keras.Model:
    """Build ExponentNet: compressed S and M, each `(B, S, S, 1)` → `(B, 8)` logits of the bins.

    The registry turns the logits into probabilities by softmax; the loss needs the logits. In a
    system without MirrorNet the input is S alone; with `dichromatic` it reads `masked_image` and
    the split, too. With regression the output is log10 s, `(B, 1)`.
    """
    names = ["specular_shading", *(["mirror"] if architecture.mirror else [])]
    if architecture.dichromatic:
        names = ["masked_image", "dichromatic", *names]
    inputs = _inputs(architecture, *names)
    answer = _exponent_head(_encoded(inputs, architecture), architecture)
    return keras.Model(_one_or_all(inputs), answer, name="exponent_net")


def albedo_net(architecture: Architecture) -> keras.Model:
    """Build AlbedoNet: `masked_image` `(B, S, S, 3)` and compressed S `(B, S, S, 1)` → m_d, m_s.

    With `dichromatic`, it reads the split, too. The output is `(B, 4)`: linear RGB diffuse albedo,
    in the hue of the object's pixels, then specular albedo, not yet clipped to [0, 1].
    """
    inputs = _inputs(architecture, "masked_image", *_split(architecture), "specular_shading")
    albedos = _albedo_head(_encoded(inputs, architecture), inputs[0])
    return keras.Model(_one_or_all(inputs), albedos, name="albedo_net")


def material_net(architecture: Architecture) -> keras.Model:
    """Build MaterialNet: an image of the object → logits of the exponent's bins, and albedos.

    One encoder in place of AlbedoNet and ExponentNet. In a system without `layers` it reads
    `masked_image` `(B, S, S, 3)` and, with `dichromatic`, the split; in the reflectance-map
    baseline the compressed `reflectance_map` `(B, S, S, 3)`.

    The outputs are those of ExponentNet and of AlbedoNet.
    """
    is_baseline = architecture.system != "lime"
    names = ["reflectance_map"] if is_baseline else ["masked_image", *_split(architecture)]
    inputs = _inputs(architecture, *names)
    features = _encoded(inputs, architecture)
    if is_baseline:
        albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    else:
        albedos = _albedo_head(features, inputs[0])
    # Files of weights number the layers in the order of the outputs.
    answers = [_exponent_head(features, architecture), albedos]
    return keras.Model(_one_or_all(inputs), answers, name="material_net")


def _encoded(inputs: list[keras.KerasTensor], architecture: Architecture) -> keras.KerasTensor:
    return encoder(
        _joined(inputs), width=architecture.encoder_width, dense_width=architecture.dense_width
    )


def _exponent_head(features: keras.KerasTensor, architecture: Architecture) -> keras.KerasTensor:
    """Return the logits of the bins `(B, 8)`, or log10 s `(B, 1)`."""
    if architecture.exponent == "classification":
        return layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
    # Training starts from the middle of the range: a bias of 0 is the dullest material.
    middle = keras.initializers.Constant((LOG_LOW + LOG_HIGH) / 2)
    return layers.Dense(1, dtype="float32", bias_initializer=middle, name="log_exponent")(features)


def _albedo_head(features: keras.KerasTensor, masked_image: keras.KerasTensor) -> keras.KerasTensor:
    """Return the albedos `(B, 4)`, m_d in the hue of the masked image."""
    albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    return HueOfPixels(dtype="float32", name="hue")([albedos, masked_image])


_CHANNELS = {
    "masked_image": 3,
    "dichromatic": CHANNELS,
    "specular_shading": 1,
    "mirror": 1,
    "reflectance_map": 3,
}
"""Number of channels of what the subnetworks read."""


def _inputs(architecture: Architecture, *names: str) -> list[keras.KerasTensor]:
    size = architecture.size
    return [keras.Input((size, size, _CHANNELS[name]), name=name) for name in names]


def _split(architecture: Architecture) -> tuple[str, ...]:
    return ("dichromatic",) if architecture.dichromatic else ()


def _joined(inputs: list[keras.KerasTensor]) -> keras.KerasTensor:
    """Return the channels of all inputs, one after another."""
    return layers.Concatenate(name="layers")(inputs) if len(inputs) > 1 else inputs[0]


def _one_or_all(inputs: list[keras.KerasTensor]) -> keras.KerasTensor | list[keras.KerasTensor]:
    """Return the inputs as `keras.Model` takes them: one alone, several as a list."""
    return inputs if len(inputs) > 1 else inputs[0]


def _unet(x: keras.KerasTensor, architecture: Architecture, channels: int) -> keras.KerasTensor:
    return unet(x, width=architecture.unet_width, depth=architecture.unet_depth, channels=channels)
