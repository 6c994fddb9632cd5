"""The subnetworks of section 5; their inputs are named after the quantities they read.

The paper's wiring is that of an architecture without `dichromatic`.
"""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import PLAIN_HEAD, HueOfPixels, encoder, pretrained_unet, unet
from lime_keras.networks.guided_filter import GuidedFilter
from lime_keras.optics.dichromatic import CHANNELS
from lime_keras.optics.shininess import BIN_COUNT, LOG_HIGH, LOG_LOW


def segmentation_net(architecture: Architecture) -> keras.Model:
    """Build SegmentationNet: `image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 1)` coverage.

    The output is not yet clipped to [0, 1]. With a pretrained encoder it has passed the guided
    filter, except in training. The head is linear: under the paper's ℓ2 loss a sigmoid saturated
    within the first steps and did not recover (docs/explanation/decisions.md).
    """
    image = keras.Input((architecture.size, architecture.size, 3), name="image")
    if architecture.pretrained:
        coarse = pretrained_unet(image)
        mask = GuidedFilter(dtype="float32", name="guided")([coarse, image])
    else:
        mask = _unet(image, architecture, plain=not architecture.mask_contrast)
    return keras.Model(image, mask, name="segmentation_net")


def specular_net(architecture: Architecture) -> keras.Model:
    """Build SpecularNet: `masked_image` `(B, S, S, 3)` sRGB → `(B, S, S, 1)` compressed S.

    With `dichromatic` and `dichromatic_shading`, it reads the split, too. With `linear`, S is
    linear radiance.
    """
    read = _split(architecture) if architecture.dichromatic_shading else ()
    inputs = _inputs(architecture, "masked_image", *read)
    shading = _unet(_joined(inputs), architecture, plain=architecture.linear)
    return keras.Model(_one_or_all(inputs), shading, name="specular_net")


def mirror_net(architecture: Architecture) -> keras.Model:
    """Build MirrorNet: compressed S `(B, S, S, 1)` → compressed M, same shape.

    With `linear`, both are linear radiance.
    """
    [shading] = _inputs(architecture, _radiance(architecture, "specular_shading"))
    mirror = _unet(shading, architecture, plain=architecture.linear)
    return keras.Model(shading, mirror, name="mirror_net")


def exponent_net(architecture: Architecture) -> keras.Model:
    """Build ExponentNet: compressed S and M, each `(B, S, S, 1)` → `(B, 8)` logits of the bins.

    The registry turns the logits into probabilities by softmax; the loss needs the logits. In a
    system without MirrorNet the input is S alone; with `dichromatic` it is `masked_image`, the
    split and S, since M beside them brings less than 1 % (docs/lab/physics.md). With
    regression the output is log10 s, `(B, 1)`.
    """
    if architecture.dichromatic:
        shading = _radiance(architecture, "specular_shading")
        names = ["masked_image", "dichromatic", shading]
    else:
        layers_read = ["specular_shading", *(["mirror"] if architecture.mirror else [])]
        names = [_radiance(architecture, name) for name in layers_read]
    inputs = _inputs(architecture, *names)
    features = _encoded(inputs, architecture)
    if architecture.exponent == "classification":
        head = layers.Dense(BIN_COUNT, dtype="float32", name="logits")
    else:
        # Training starts from the middle of the range: a bias of 0 is the dullest material.
        middle = keras.initializers.Constant((LOG_LOW + LOG_HIGH) / 2)
        head = layers.Dense(1, dtype="float32", bias_initializer=middle, name="log_exponent")
    return keras.Model(_one_or_all(inputs), head(features), name="exponent_net")


def albedo_net(architecture: Architecture) -> keras.Model:
    """Build AlbedoNet: `masked_image` `(B, S, S, 3)` and compressed S `(B, S, S, 1)` → m_d, m_s.

    With `dichromatic`, it reads the split, too. The output is `(B, 4)`: linear RGB diffuse albedo,
    with `hue` in the hue of the object's pixels, then specular albedo, not yet clipped to [0, 1].
    """
    shading = _radiance(architecture, "specular_shading")
    inputs = _inputs(architecture, "masked_image", *_split(architecture), shading)
    # Made before the other layers: initial weights follow from the seed and the order.
    head = layers.Dense(4, dtype="float32", name="albedos")
    albedos = head(_encoded(inputs, architecture))
    if architecture.hue:
        albedos = HueOfPixels(dtype="float32", name="hue")([albedos, inputs[0]])
    return keras.Model(_one_or_all(inputs), albedos, name="albedo_net")


def _encoded(inputs: list[keras.KerasTensor], architecture: Architecture) -> keras.KerasTensor:
    return encoder(
        _joined(inputs), width=architecture.encoder_width, dense_width=architecture.dense_width
    )


_CHANNELS = {"masked_image": 3, "dichromatic": CHANNELS}
"""Number of channels of what the subnetworks read, where it is not 1."""


def _inputs(architecture: Architecture, *names: str) -> list[keras.KerasTensor]:
    size = architecture.size
    return [keras.Input((size, size, _CHANNELS.get(name, 1)), name=name) for name in names]


def _split(architecture: Architecture) -> tuple[str, ...]:
    return ("dichromatic",) if architecture.dichromatic else ()


def _joined(inputs: list[keras.KerasTensor]) -> keras.KerasTensor:
    """Return the channels of all inputs, one after another."""
    return layers.Concatenate(name="layers")(inputs) if len(inputs) > 1 else inputs[0]


def _one_or_all(inputs: list[keras.KerasTensor]) -> keras.KerasTensor | list[keras.KerasTensor]:
    """Return the inputs as `keras.Model` takes them: one alone, several as a list."""
    return inputs if len(inputs) > 1 else inputs[0]


def _radiance(architecture: Architecture, name: str) -> str:
    """Return the name of S or M in the form that subnetworks of this architecture read."""
    return f"linear_{name}" if architecture.linear else name


def _unet(x: keras.KerasTensor, architecture: Architecture, *, plain: bool) -> keras.KerasTensor:
    head = PLAIN_HEAD if plain else "head"
    return unet(x, width=architecture.unet_width, depth=architecture.unet_depth, head=head)
