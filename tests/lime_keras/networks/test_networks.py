"""The subnetworks' shapes and sizes, and what the joined model holds and answers."""

import dataclasses
import random

import keras
import numpy as np
import pytest
from scipy.special import softmax

from lime_keras.networks import (
    PRESETS,
    SUBNETWORKS,
    Architecture,
    assemble,
    build,
    output_names,
    subnetwork_names,
)
from lime_keras.optics.reflectance_map import disc

NEEDED = {
    "mask": {"segmentation"},
    "specular_shading": {"segmentation", "specular"},
    "mirror": {"segmentation", "specular", "mirror"},
    "diffuse_albedo": {"segmentation", "specular", "albedo"},
    "specular_albedo": {"segmentation", "specular", "albedo"},
    "exponent_bin_probabilities": {"segmentation", "specular", "mirror", "exponent"},
}
OUTPUTS = tuple(NEEDED)
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


def fresh(architecture, seed):
    """A module's subnetworks, and a function that gives them the weights they began with.

    Their U-Nets have two levels, so that skip connections can be mixed up.
    """
    keras.utils.set_random_seed(seed)
    out = build(dataclasses.replace(architecture, unet_depth=2))
    begun = {name: network.get_weights() for name, network in out.items()}

    def again():
        for name, network in out.items():
            network.set_weights(begun[name])
        return out

    return again


SYSTEMS = {
    "LIME": {},
    "without MirrorNet": {"mirror": False},
    "regression": {"exponent": "regression"},
    "baseline": {"system": "reflectance-map"},
}
SLOW = ("without MirrorNet", "regression")


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in SYSTEMS],
)
def architecture(request, tiny):
    """The smallest architecture of the whole system, and of each ablation."""
    return dataclasses.replace(tiny, **SYSTEMS[request.param])


@pytest.fixture(scope="module")
def fresh_whole(tiny):
    return fresh(tiny, seed=0)


@pytest.fixture(scope="module")
def fresh_system(architecture):
    return fresh(architecture, seed=0 if architecture.description == "LIME" else 3)


@pytest.fixture
def subnetworks(fresh_whole):
    """Freshly initialised, their heads lifted into the range that is not clipped."""
    return lifted(fresh_whole())


@pytest.fixture
def system(fresh_system):
    """As `subnetworks`, of each architecture."""
    return lifted(fresh_system())


def lifted(subnetworks):
    # Above and below 0 in turn: some of each image belongs to the object.
    lift(subnetworks, mask=0.3, layers=0.5, albedos=0.5)
    return subnetworks


def lift(subnetworks, mask, layers, albedos):
    """Set the biases of the heads of any system."""
    for name, network in subnetworks.items():
        if name in ("albedo", "material"):
            network.get_layer("albedos").bias.assign([albedos] * 4)
        elif name != "exponent":
            head = network.get_layer("head")
            head.bias.assign([mask if name == "segmentation" else layers] * head.filters)


def answer(network, image):
    return {name: np.array(value) for name, value in network(image).items()}


# Sizes.


def test_the_paper_has_the_layers_of_the_documentation():
    architecture, subnetworks = PRESETS["paper"], build(PRESETS["paper"])
    size = architecture.size
    assert set(subnetworks) == set(CHANNELS)
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


@pytest.mark.parametrize("shading", [False, True])
@pytest.mark.parametrize("preset", ["smoke", "nano", "live"])
def test_encoders_of_other_presets_read_the_split_and_specular_net_may(preset, shading):
    assert not PRESETS[preset].dichromatic_shading
    architecture = dataclasses.replace(PRESETS[preset], dichromatic_shading=shading)
    subnetworks = build(architecture)
    read = {name: [x.name for x in network.inputs] for name, network in subnetworks.items()}
    assert read == {
        "segmentation": ["image"],
        "specular": ["masked_image", *(["dichromatic"] if shading else [])],
        "mirror": ["specular_shading"],
        "exponent": ["masked_image", "dichromatic", "specular_shading"],
        "albedo": ["masked_image", "dichromatic", "specular_shading"],
    }
    for name in ("specular", "mirror"):
        channels = {"specular": 7 if shading else 3, "mirror": 1}[name]
        layers = unet_convolutions(architecture, channels)
        expected = sum((k * k * below + 1) * width for k, below, width, _ in layers)
        assert subnetworks[name].count_params() == expected
    assert subnetworks["exponent"].count_params() == encoder_parameters(architecture, 8, 8)
    assert subnetworks["albedo"].count_params() == encoder_parameters(architecture, 8, 4)
    size = (None, architecture.size, architecture.size, 1)
    assert subnetworks["segmentation"].output_shape == size


def test_the_papers_u_nets_keep_to_the_bound_of_its_run_times():
    """28 GFLOP each, multiplication and addition counted apart."""
    layers = unet_convolutions(PRESETS["paper"], 3)
    flop = sum(2 * k * k * below * width * side**2 for k, below, width, side in layers)
    assert 20e9 < flop < 30e9


@pytest.mark.parametrize("depth", [0, 1, 3, 5])
def test_u_nets_of_every_depth(depth):
    architecture = Architecture(32, 1, depth, 1, 1)
    network = SUBNETWORKS["mirror"].build(architecture)
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


def test_the_seed_leaves_the_callers_random_numbers_alone(tiny):
    random.seed(1)
    build(tiny, seed=0)
    drawn = random.random()
    random.seed(1)
    assert random.random() == drawn


def test_m_d_has_the_hue_of_the_pixels_but_in_the_paper(tiny):
    with_hue = {name: preset.hue for name, preset in PRESETS.items()}
    assert with_hue == {"smoke": True, "nano": True, "live": True, "paper": False}
    for hue in (False, True):
        network = build(dataclasses.replace(tiny, hue=hue))["albedo"]
        assert any(layer.name == "hue" for layer in network.layers) == hue


# The joined model holds what is needed.


@pytest.mark.parametrize("outputs", [[], ["masks"], ["mask", "normals"]])
def test_unknown_outputs_and_none_are_refused(outputs, subnetworks):
    with pytest.raises(ValueError, match=r"name at least one"):
        assemble(subnetworks, outputs)


# The joined model's answers.


def test_outputs_asked_for_alone_are_those_of_the_whole(subnetworks, tiny):
    image = images(tiny.size)
    whole = answer(assemble(subnetworks), image)
    for output in OUTPUTS:
        alone = answer(assemble(subnetworks, [output]), image)
        assert set(alone) == {output}
        np.testing.assert_allclose(alone[output], whole[output], rtol=1e-4, atol=1e-5)


def in_range(found):
    largest = dict.fromkeys(("specular_shading", "mirror", "reflectance_map"), 59_874)
    largest |= {"log_exponent": 3}
    for name, value in found.items():
        assert value.dtype == np.float32 and np.isfinite(value).all() and (value >= 0).all()
        assert (value <= largest.get(name, 1)).all(), name
    if "exponent_bin_probabilities" in found:
        total = found["exponent_bin_probabilities"].sum(-1)
        np.testing.assert_allclose(total, 1, rtol=1e-5)
    for name in {"specular_shading", "mirror"} & set(found):
        assert (found[name][found["mask"] == 0] == 0).all()


def test_answers_are_in_range_and_layers_zero_outside_the_mask(subnetworks, tiny):
    found = answer(assemble(subnetworks), images(tiny.size))
    in_range(found)
    assert (found["mask"] == 0).any() and (found["mask"] > 0).any()
    for name in OUTPUTS:
        assert np.ptp(found[name], axis=0).max() > 1e-4, f"{name} does not see the image"


@pytest.mark.parametrize("batch", [1, 3])
def test_an_images_answer_does_not_depend_on_its_batch(batch, subnetworks, tiny):
    network, image = assemble(subnetworks), images(tiny.size)
    whole, part = answer(network, image), answer(network, image[:batch])
    for name in OUTPUTS:
        np.testing.assert_allclose(part[name], whole[name][:batch], rtol=1e-4, atol=1e-5)


# The ablations.


def without(outputs, *removed, **added):
    return {name: held for name, held in outputs.items() if name not in removed} | added


ABLATED = {
    "LIME": NEEDED,
    "LIME without MirrorNet": without(
        NEEDED, "mirror", exponent_bin_probabilities={"segmentation", "specular", "exponent"}
    ),
    "LIME with its exponent by regression": without(
        NEEDED, "exponent_bin_probabilities", log_exponent=NEEDED["exponent_bin_probabilities"]
    ),
    "the reflectance-map baseline": {
        "mask": {"segmentation"},
        "reflectance_map": {"segmentation", "reflectance_map"},
    }
    | {
        output: {"segmentation", "reflectance_map", "material"}
        for output in ("diffuse_albedo", "specular_albedo", "exponent_bin_probabilities")
    },
}
"""By a system's description: its outputs, and what each takes."""


def test_architectures_say_what_they_are(tiny, architecture):
    assert tiny.description == "LIME"
    assert architecture.description in ABLATED
    both = dataclasses.replace(tiny, mirror=False, exponent="regression")
    assert both.description == "LIME without MirrorNet with its exponent by regression"
    split = dataclasses.replace(tiny, dichromatic=True, hue=True)
    assert split.description == "LIME with the dichromatic split and the hue of the pixels"
    encoders = dataclasses.replace(split, hue=False, dichromatic_shading=False)
    assert encoders.description == "LIME with the dichromatic split in its encoders"


def test_the_ablations_exponent_nets_by_hand(tiny):
    """S alone, two channels less 9 · 2 weights; one answer and not eight."""
    whole = encoder_parameters(tiny, 2, 8)
    assert build(tiny)["exponent"].count_params() == whole
    alone = build(dataclasses.replace(tiny, mirror=False))["exponent"]
    assert [tuple(x.shape[1:]) for x in alone.inputs] == [(32, 32, 1)]
    assert alone.output_shape == (None, 8)
    assert alone.count_params() == encoder_parameters(tiny, 1, 8) == whole - 9 * 2
    number = build(dataclasses.replace(tiny, exponent="regression"))["exponent"]
    assert [tuple(x.shape[1:]) for x in number.inputs] == [(32, 32, 1)] * 2
    assert number.output_shape == (None, 1)
    assert number.count_params() == encoder_parameters(tiny, 2, 1) == whole - 7 * 5
    both = build(dataclasses.replace(tiny, mirror=False, exponent="regression"))["exponent"]
    assert both.count_params() == encoder_parameters(tiny, 1, 1)


def test_the_baselines_subnetworks_by_hand(tiny):
    """The decoder: 4 features to 16 at 1 pixel, then widths 16, 16, 8, 4, 2 up to 32 pixels."""
    subnetworks = build(dataclasses.replace(tiny, system="reflectance-map"))
    widths = [(16, 16), (16, 16), (16, 8), (8, 4), (4, 2)]
    decoder = (4 + 1) * 16 + sum((9 * below + 1) * width for below, width in widths) + (2 + 1) * 3
    found = {name: network.count_params() for name, network in subnetworks.items()}
    assert found == {
        "segmentation": build(tiny)["segmentation"].count_params(),
        "reflectance_map": encoder_parameters(tiny, 3, 0) + decoder,
        "material": encoder_parameters(tiny, 3, 4 + 8),
    }
    assert subnetworks["reflectance_map"].output_shape == (None, 32, 32, 3)
    assert subnetworks["material"].output_shape == [(None, 8), (None, 4)]
    # Files of weights hold the layers in this order.
    weighted = [layer.name for layer in subnetworks["material"].layers if layer.weights]
    assert weighted[-2:] == ["logits", "albedos"]


def test_a_larger_reflectance_map_starts_from_more_pixels():
    architecture = Architecture(96, 1, 1, 1, 1, system="reflectance-map")
    network = build(architecture)["reflectance_map"]
    assert network.output_shape == (None, 96, 96, 3)
    assert network.get_layer("decoder_reshape").output.shape == (None, 3, 3, 8)


@pytest.mark.parametrize(
    "fields, found",
    [
        ({"system": "shading"}, "no system shading"),
        ({"exponent": "ranking"}, "exponent ranking"),
        ({"system": "reflectance-map", "mirror": False}, "one ablation at a time"),
        ({"system": "reflectance-map", "exponent": "regression"}, "one ablation at a time"),
    ],
)
def test_systems_that_do_not_exist_are_refused(fields, found, tiny):
    with pytest.raises(ValueError, match=found):
        dataclasses.replace(tiny, **fields)


@pytest.mark.parametrize(
    "name", ["size", "unet_width", "unet_depth", "encoder_width", "dense_width"]
)
@pytest.mark.parametrize("value", [-1, 10**6, 1.5])
def test_layers_that_nobody_can_build_are_refused(name, value, tiny):
    with pytest.raises(ValueError, match=f"no networks of {name} {value}: take a number"):
        dataclasses.replace(tiny, **{name: value})
    if name != "unet_depth":
        with pytest.raises(ValueError, match=f"no networks of {name} 0"):
            dataclasses.replace(tiny, **{name: 0})


@pytest.mark.parametrize("size, depth, multiple", [(48, 2, 32), (96, 6, 64)])
def test_sizes_that_do_not_halve_evenly_are_refused(size, depth, multiple, tiny):
    found = f"images of {size} pixels: .*take a multiple of {multiple}$"
    with pytest.raises(ValueError, match=found):
        dataclasses.replace(tiny, size=size, unet_depth=depth)
    dataclasses.replace(tiny, size=multiple, unet_depth=depth)


def test_outputs_take_only_the_subnetworks_they_need(system, architecture):
    needed = ABLATED[architecture.description]
    assert set(output_names(system)) == set(needed)
    assert tuple(system) == subnetwork_names(architecture)
    assert set().union(*needed.values()) == set(system)
    for output, held in needed.items():
        network = assemble(system, [output])
        subnetworks = [layer.name for layer in network.layers if isinstance(layer, keras.Model)]
        assert sorted(subnetworks) == sorted(f"{name}_net" for name in held), output
        # The others need not even exist.
        assemble({name: system[name] for name in held}, [output])
    whole = assemble(system)
    assert [tensor.name for tensor in whole.inputs] == ["image"]
    assert set(whole.output) == set(needed)
    assert whole.count_params() == sum(network.count_params() for network in system.values())


def test_what_a_system_does_not_answer_is_refused(system):
    for output in {*OUTPUTS, "log_exponent", "reflectance_map"} - set(output_names(system)):
        with pytest.raises(ValueError, match=rf"'{output}'.* not among mask, "):
            assemble(system, ["mask", output])


def test_the_system_joined_by_hand(system, architecture):
    image = images(architecture.size)
    found = answer(assemble(system), image)

    def run(name, *inputs):
        answered = system[name](list(inputs) if len(inputs) > 1 else inputs[0])
        return list(map(np.array, answered)) if isinstance(answered, list) else np.array(answered)

    mask = np.clip(1.5 * run("segmentation", image) - 0.25, 0, 1)
    expected = {"mask": mask}
    if architecture.system == "lime":
        specular = run("specular", image * mask) * mask
        expected["specular_shading"] = np.expm1(np.clip(specular, 0, 11))
        albedos, seen = run("albedo", image * mask, specular), [specular]
        if architecture.mirror:
            seen.append(run("mirror", specular) * mask)
            expected["mirror"] = np.expm1(np.clip(seen[1], 0, 11))
        exponent = run("exponent", *seen)
    else:
        sphere = run("reflectance_map", image * mask) * disc(architecture.size)
        expected["reflectance_map"] = np.expm1(np.clip(sphere, 0, 11))
        exponent, albedos = run("material", sphere)
    albedos = np.clip(albedos, 0, 1)
    expected |= {"diffuse_albedo": albedos[:, :3], "specular_albedo": albedos[:, 3:]}
    if architecture.exponent == "regression":
        expected["log_exponent"] = np.clip(exponent, 0, 3)
    else:
        expected["exponent_bin_probabilities"] = softmax(exponent, axis=-1)
    assert set(found) == set(expected)
    for name, value in expected.items():
        assert found[name].shape == value.shape
        np.testing.assert_allclose(found[name], value, rtol=1e-4, atol=1e-5, err_msg=name)
        assert np.ptp(found[name], axis=0).max() > 1e-4, f"{name} does not see the image"


@pytest.mark.parametrize("bias", [-1e6, -1.0, 0.0, 12.0, 1e6])
def test_answers_stay_in_range_whatever_the_subnetworks_say(bias, system, architecture):
    lift(system, mask=bias, layers=bias, albedos=bias)
    if architecture.exponent == "regression":
        system["exponent"].get_layer("log_exponent").bias.assign([bias])
    found = answer(assemble(system), images(architecture.size))
    in_range(found)
    if abs(bias) == 1e6:
        end = float(bias > 0)
        assert (found["mask"] == end).all() and (found["diffuse_albedo"] == end).all()
        if "log_exponent" in found:
            assert (found["log_exponent"] == 3 * end).all()
        if "reflectance_map" in found:
            inside = disc(architecture.size)[..., 0] == 1
            assert (found["reflectance_map"][:, inside] >= 59_000 * end).all()
            assert (found["reflectance_map"][:, ~inside] == 0).all()


def test_regression_begins_in_the_middle(tiny):
    network = build(dataclasses.replace(tiny, exponent="regression"))["exponent"]
    black = np.zeros((1, 32, 32, 1), np.float32)
    assert np.array(network([black, black])).item() == pytest.approx(1.5)


def test_systems_in_mixed_precision_answer_in_single(architecture):
    before = keras.config.dtype_policy()
    keras.config.set_dtype_policy("mixed_float16")
    try:
        in_range(answer(assemble(build(architecture)), images(architecture.size)))
    finally:
        keras.config.set_dtype_policy(before)
