"""The subnetworks' shapes and sizes, and what the joined model holds and answers."""

import keras
import numpy as np
import pytest

from lime_keras.networks import PRESETS, SUBNETWORKS, Architecture, assemble, build
from lime_keras.networks.system import OUTPUTS

NEEDED = {
    "mask": {"segmentation"},
    "specular_shading": {"segmentation", "specular"},
    "mirror": {"segmentation", "specular", "mirror"},
    "diffuse_albedo": {"segmentation", "specular", "albedo"},
    "specular_albedo": {"segmentation", "specular", "albedo"},
    "exponent_bin_probabilities": {"segmentation", "specular", "mirror", "exponent"},
}
CHANNELS = {
    "segmentation": [3],
    "specular": [3],
    "mirror": [1],
    "exponent": [1, 1],
    "albedo": [3, 1],
}


def unet_convolutions(architecture, channels):
    """(kernel, channels in, channels out, side) of each convolution of a U-Net."""
    widths = [architecture.unet_width * min(2**k, 8) for k in range(architecture.unet_depth + 1)]
    sides = [architecture.size >> k for k in range(architecture.unet_depth + 1)]
    out, below = [], channels
    for width, side in zip(widths, sides, strict=True):
        out += [(3, below, width, side), (3, width, width, side)]
        below = width
    for width, side in list(zip(widths, sides, strict=True))[-2::-1]:
        out += [(3, below + width, width, side), (3, width, width, side)]
        below = width
    return [*out, (1, below, 1, architecture.size)]


def encoder_parameters(architecture, channels, answers):
    """Five convolutions and three dense layers, with their biases."""
    total, below = 0, channels
    for block in range(5):
        width = architecture.encoder_width * min(2**block, 8)
        total += (9 * below + 1) * width
        below = width
    features = below * (architecture.size // 32) ** 2
    for units in (architecture.dense_width, architecture.dense_width, answers):
        total += (features + 1) * units
        features = units
    return total


def images(size, seed=0):
    """Noise, black, white and a gradient."""
    noise = np.random.default_rng(seed).uniform(size=(size, size, 3))
    ramp = np.broadcast_to(np.linspace(0, 1, size)[:, None, None], noise.shape)
    return np.stack([noise, 0 * noise, 0 * noise + 1, ramp]).astype(np.float32)


@pytest.fixture
def subnetworks(tiny):
    """Freshly initialised, their heads lifted into the range that is not clipped."""
    keras.utils.set_random_seed(0)
    out = build(tiny)
    # Above and below 0 in turn: some of each image belongs to the object.
    out["segmentation"].get_layer("head").bias.assign([0.1])
    out["specular"].get_layer("head").bias.assign([0.5])
    out["mirror"].get_layer("head").bias.assign([0.5])
    out["albedo"].get_layer("albedos").bias.assign([0.5] * 4)
    return out


def answer(network, image):
    return {name: np.array(value) for name, value in network(image).items()}


# Sizes.


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_have_the_layers_of_the_documentation(preset):
    architecture, subnetworks = PRESETS[preset], build(PRESETS[preset])
    size = architecture.size
    assert set(subnetworks) == set(SUBNETWORKS) == set(CHANNELS)
    for name, network in subnetworks.items():
        channels = sum(CHANNELS[name])
        if name in ("segmentation", "specular", "mirror"):
            layers = unet_convolutions(architecture, channels)
            expected = sum((k * k * below + 1) * width for k, below, width, _ in layers)
        else:
            answers = {"exponent": 8, "albedo": 4}[name]
            expected = encoder_parameters(architecture, channels, answers)
        assert network.count_params() == expected, name
        assert [tuple(x.shape[1:]) for x in network.inputs] == [
            (size, size, channels) for channels in CHANNELS[name]
        ]
        shape = {"exponent": (8,), "albedo": (4,)}.get(name, (size, size, 1))
        assert network.output_shape == (None, *shape)


def test_the_papers_u_nets_keep_to_the_bound_of_its_run_times():
    """28 GFLOP each, multiplication and addition counted apart."""
    layers = unet_convolutions(PRESETS["paper"], 3)
    flop = sum(2 * k * k * below * width * side**2 for k, below, width, side in layers)
    assert 20e9 < flop < 30e9


@pytest.mark.parametrize("depth", [0, 1, 3, 5])
def test_u_nets_of_every_depth(depth):
    architecture = Architecture(32, 1, depth, 1, 1)
    network = SUBNETWORKS["mirror"](architecture)
    assert network.output_shape == (None, 32, 32, 1)
    layers = unet_convolutions(architecture, 1)
    assert network.count_params() == sum((k * k * i + 1) * o for k, i, o, _ in layers)


def test_the_seed_decides_the_weights(tiny):
    def first(seed):
        keras.utils.set_random_seed(seed)
        return [w for network in build(tiny).values() for w in network.get_weights()]

    one, again, other = first(0), first(0), first(1)
    assert all(np.array_equal(a, b) for a, b in zip(one, again, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


# The joined model holds what is needed.


@pytest.mark.parametrize("output", OUTPUTS)
def test_an_output_takes_only_the_subnetworks_it_needs(output, subnetworks):
    network = assemble(subnetworks, [output])
    held = {layer.name for layer in network.layers if isinstance(layer, keras.Model)}
    assert held == {f"{name}_net" for name in NEEDED[output]}
    expected = sum(subnetworks[name].count_params() for name in NEEDED[output])
    assert network.count_params() == expected
    # The others need not even exist.
    assemble({name: subnetworks[name] for name in NEEDED[output]}, [output])


def test_everything_takes_each_subnetwork_once(subnetworks):
    network = assemble(subnetworks)
    assert network.count_params() == sum(n.count_params() for n in subnetworks.values())
    held = [layer.name for layer in network.layers if isinstance(layer, keras.Model)]
    assert sorted(held) == sorted(f"{name}_net" for name in SUBNETWORKS)
    assert [tensor.name for tensor in network.inputs] == ["image"]
    assert set(network.output) == set(OUTPUTS)


@pytest.mark.parametrize("outputs", [[], ["masks"], ["mask", "normals"]])
def test_unknown_outputs_and_none_are_refused(outputs, subnetworks):
    with pytest.raises(ValueError, match=r"name at least one"):
        assemble(subnetworks, outputs)


# The joined model's answers.


def test_the_joined_model_is_figure_2(subnetworks, tiny):
    image = images(tiny.size)
    found = answer(assemble(subnetworks), image)

    def run(name, *inputs):
        return np.array(subnetworks[name](list(inputs) if len(inputs) > 1 else inputs[0]))

    mask = np.clip(run("segmentation", image), 0, 1)
    specular = run("specular", image * mask) * mask
    mirror = run("mirror", specular) * mask
    albedos = np.clip(run("albedo", image * mask, specular), 0, 1)
    expected = {
        "mask": mask,
        "specular_shading": np.expm1(np.clip(specular, 0, 11)),
        "mirror": np.expm1(np.clip(mirror, 0, 11)),
        "diffuse_albedo": albedos[:, :3],
        "specular_albedo": albedos[:, 3:],
        "exponent_bin_probabilities": run("exponent", specular, mirror),
    }
    assert set(found) == set(expected)
    for name, value in expected.items():
        assert found[name].shape == value.shape
        np.testing.assert_allclose(found[name], value, rtol=1e-4, atol=1e-5, err_msg=name)


def test_outputs_asked_for_alone_are_those_of_the_whole(subnetworks, tiny):
    image = images(tiny.size)
    whole = answer(assemble(subnetworks), image)
    for output in OUTPUTS:
        alone = answer(assemble(subnetworks, [output]), image)
        assert set(alone) == {output}
        np.testing.assert_allclose(alone[output], whole[output], rtol=1e-4, atol=1e-5)


def in_range(found):
    for value in found.values():
        assert value.dtype == np.float32 and np.isfinite(value).all() and (value >= 0).all()
    for name in ("mask", "diffuse_albedo", "specular_albedo", "exponent_bin_probabilities"):
        assert (found[name] <= 1).all()
    total = found["exponent_bin_probabilities"].sum(-1)
    np.testing.assert_allclose(total, 1, rtol=1e-5)
    for name in ("specular_shading", "mirror"):
        assert found[name].max() <= 59_874
        assert (found[name][found["mask"] == 0] == 0).all()


def test_answers_are_in_range_and_layers_zero_outside_the_mask(subnetworks, tiny):
    found = answer(assemble(subnetworks), images(tiny.size))
    in_range(found)
    assert (found["mask"] == 0).any() and (found["mask"] > 0).any()
    for name in OUTPUTS:
        assert np.ptp(found[name], axis=0).max() > 1e-4, f"{name} does not see the image"


@pytest.mark.parametrize("bias", [-1e6, -1.0, 0.0, 12.0, 1e6])
def test_answers_stay_in_range_whatever_the_subnetworks_say(bias, subnetworks, tiny):
    for name in ("segmentation", "specular", "mirror"):
        subnetworks[name].get_layer("head").bias.assign([bias])
    subnetworks["albedo"].get_layer("albedos").bias.assign([bias] * 4)
    found = answer(assemble(subnetworks), images(tiny.size))
    in_range(found)
    if bias == 1e6:
        assert (found["mask"] == 1).all() and found["mirror"].min() > 59_000
    if bias == -1e6:
        assert (found["mask"] == 0).all() and (found["specular_albedo"] == 0).all()


@pytest.mark.parametrize("batch", [1, 3])
def test_an_images_answer_does_not_depend_on_its_batch(batch, subnetworks, tiny):
    network, image = assemble(subnetworks), images(tiny.size)
    whole, part = answer(network, image), answer(network, image[:batch])
    for name in OUTPUTS:
        np.testing.assert_allclose(part[name], whole[name][:batch], rtol=1e-4, atol=1e-5)


def test_mixed_precision_answers_in_single(tiny):
    before = keras.config.dtype_policy()
    keras.config.set_dtype_policy("mixed_float16")
    try:
        network = assemble(build(tiny))
        in_range(answer(network, images(tiny.size)))
    finally:
        keras.config.set_dtype_policy(before)
