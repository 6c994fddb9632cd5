"""Shards to batches: order, photos, averaging, classes, and broken files."""

import json_files
import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example, store, stored, write_split

from lime_keras.data import camera, pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.optics import colour, shading, shininess

SIZE = 16
COUNT = 12
HALF = 2.0**-11  # rounding of a half float below 1, which normals of the stored size keep


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    """Three shards of four examples."""
    folder = tmp_path_factory.mktemp("corpus")
    return [
        store(
            folder / f"{first // 4:05d}.tfrecord",
            [records.encode(example(index, size=SIZE)) for index in range(first, first + 4)],
        )
        for first in (0, 4, 8)
    ]


@pytest.mark.parametrize(
    "name, value, with_camera",
    [
        ("mirror", np.nan, True),
        ("environment", np.inf, True),
        ("shininess", np.nan, False),
        ("diffuse_albedo", np.inf, False),
    ],
)
def test_a_number_that_is_not_finite_is_located(name, value, with_camera, tmp_path):
    """As another program could write it: `records.encode` refuses it."""
    sound = records.encode(example(0, size=SIZE))
    message = tf.train.Example.FromString(sound)
    feature = message.features.feature[name]
    if feature.bytes_list.value:
        bits = tf.io.decode_png(feature.bytes_list.value[0], 1, tf.uint16).numpy()
        bits[-1, -1] = np.float16(value).view(np.uint16)
        feature.bytes_list.value[0] = tf.io.encode_png(bits).numpy()
    else:
        feature.float_list.value[-1] = value
    path = store(tmp_path / "00000.tfrecord", [sound, message.SerializeToString()])
    batches = pipeline.evaluation(
        [path], size=SIZE, batch_size=1, camera=with_camera, features=(name,)
    )
    with pytest.raises(ValueError, match=f"record 1 .*{name} is not finite.*lime-render"):
        list(pipeline.naming_damage(batches, [path]))


def test_evaluation_takes_every_example_once_in_order(shards):
    batches = list(pipeline.evaluation(shards, size=8, batch_size=5))
    assert [len(batch["index"]) for batch in batches] == [5, 5, 2]
    assert np.concatenate([batch["index"] for batch in batches]).tolist() == list(range(COUNT))


def test_batches_hold_every_feature_and_the_class(shards):
    [batch] = pipeline.evaluation(shards[:1], size=8, batch_size=4)
    assert set(batch) == {*records.FEATURES, "exponent_bin", "clipped", "cast"}
    assert batch["image"].shape == (4, 8, 8, 3) and batch["mirror"].shape == (4, 8, 8, 1)
    assert batch["environment"].shape == (4, 64, 128, 1)
    for name, value in batch.items():
        if value.dtype.is_floating:
            assert value.dtype == tf.float32 and np.isfinite(value).all(), name


@pytest.mark.parametrize("photographed", [False, True])
def test_a_feature_asked_for_alone_is_the_same(shards, photographed):
    options = {"size": 8, "batch_size": 4, "camera": photographed}
    [whole] = pipeline.evaluation(shards[:1], **options)
    for name in ("image", "mirror", "normal", "camera", "clipped", "exponent_bin", "light"):
        [alone] = pipeline.evaluation(shards[:1], **options, features=(name,))
        assert set(alone) == {name}
        np.testing.assert_array_equal(alone[name], whole[name])


def test_unknown_features_are_refused(shards):
    with pytest.raises(ValueError, match=r"no depth, but image, .*clipped"):
        pipeline.evaluation(shards, size=8, batch_size=1, features=("image", "depth"))


# Photos.


def test_evaluation_photographs_only_if_asked_and_always_alike(shards):
    options = {"size": 8, "features": ("image", "index")}
    [clean] = pipeline.evaluation(shards, **options, batch_size=COUNT)
    [asked] = pipeline.evaluation(shards, **options, batch_size=COUNT, camera=True)
    assert not np.array_equal(clean["image"], asked["image"])
    in_batches = pipeline.evaluation(shards[::-1], **options, batch_size=5, camera=True)
    in_batches = list(in_batches.as_numpy_iterator())
    images, indices = (np.concatenate([b[name] for b in in_batches]) for name in ("image", "index"))
    np.testing.assert_array_equal(images[np.argsort(indices)], asked["image"])
    own = records.parse(records.encode(example(7, size=SIZE)))
    own = camera.photograph(own, camera.radiance(own))
    np.testing.assert_allclose(asked["image"][7], pipeline.resize(own, 8)["image"], atol=1e-6)


# Classes.


def test_classes_agree_with_bin_of_at_the_edges(tmp_path):
    edges = (10.0**shininess.LOG_EDGES).astype(np.float32)
    near = [edges, np.nextafter(edges, 0), np.nextafter(edges, np.float32(1e9)), edges * 0.9999]
    further = [[0, 1e-30, 0.5, 1e6, 1e30], 10.0**shininess.LOG_MEANS]
    exponents = np.concatenate([*near, *further]).astype(np.float32)
    sphere = example(0, size=4)
    spheres = (sphere | {"shininess": s} for s in exponents)
    path = store(tmp_path / "s.tfrecord", map(records.encode, spheres))
    [batch] = pipeline.evaluation([path], size=4, batch_size=len(exponents))
    assert batch["exponent_bin"].dtype == tf.int32
    np.testing.assert_array_equal(batch["exponent_bin"], shininess.bin_of(exponents))


# Averaging.


@pytest.fixture
def rough():
    """A parsed example of random layers under fractional coverage, a quarter of it empty."""
    rng = np.random.default_rng(0)
    mask = rng.uniform(size=(SIZE, SIZE, 1)) * (rng.uniform(size=(SIZE, SIZE, 1)) > 0.5)
    mask[:8, :8] = 0
    normal = rng.normal(size=(SIZE, SIZE, 3)) + np.array([0, 0, 2])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    # As the renderer leaves them: nothing where nothing is covered.
    normal *= mask > 0
    layers = {
        name: rng.exponential(size=mask.shape) * (mask > 0)
        for name in ("diffuse_shading", "specular_shading", "mirror")
    }
    changes = {"mask": mask, "image": rng.uniform(size=(SIZE, SIZE, 3)), "normal": normal}
    return records.parse(records.encode(example(0, size=SIZE) | layers | changes))


@pytest.mark.parametrize("size", [16, 8, 4, 1])
def test_layers_are_averaged_over_the_covered_part(rough, size):
    found, factor = pipeline.resize(rough, size), SIZE // size
    for y, x in np.ndindex(size, size):
        block = np.s_[y * factor : (y + 1) * factor, x * factor : (x + 1) * factor]
        image, mask = (rough[name].numpy()[block] for name in ("image", "mask"))
        linear = colour.srgb_to_linear(image).mean((0, 1))
        np.testing.assert_allclose(colour.srgb_to_linear(found["image"][y, x]), linear, rtol=1e-4)
        some_clipped = (image >= colour.CLIPPED).any((0, 1))
        np.testing.assert_array_equal(found["clipped"][y, x], some_clipped)
        np.testing.assert_allclose(found["mask"][y, x], mask.mean((0, 1)), rtol=1e-5)
        for name in ("diffuse_shading", "specular_shading", "mirror"):
            layer = rough[name].numpy()[block]
            expected = np.sum(layer * mask) / np.sum(mask) if mask.any() else 0
            np.testing.assert_allclose(found[name][y, x, 0], expected, rtol=1e-4)
        normal = np.sum(rough["normal"].numpy()[block] * mask, axis=(0, 1))
        expected = normal / np.linalg.norm(normal) if mask.any() else np.zeros(3)
        np.testing.assert_allclose(found["normal"][y, x], expected, atol=HALF)
    for name in ("environment", "shininess", "diffuse_albedo", "index"):
        np.testing.assert_array_equal(found[name], rough[name])


def test_the_stored_size_changes_nothing(rough):
    found = pipeline.resize(rough, SIZE)
    for name, value in rough.items():
        np.testing.assert_array_equal(found[name], value, err_msg=name)


def test_where_the_camera_clipped_is_kept(rough):
    """Its photo may show less than white there."""
    clipped = np.zeros((SIZE, SIZE, 3), np.float32)
    clipped[5, 6, 1] = 1
    found = pipeline.resize(rough | {"clipped": tf.constant(clipped)}, 4)["clipped"].numpy()
    assert found.sum() == 1 and found[1, 1, 1] == 1


def test_the_camera_is_scaled_along(rough):
    """A large pixel is seen along the corner that its four small ones share."""
    small = pipeline.resize(rough, SIZE // 2)
    coarse = shading.view_directions(small["camera"].numpy(), SIZE // 2, SIZE // 2)
    fine = shading.view_directions(rough["camera"].numpy(), SIZE, SIZE)
    slopes = (fine / fine[..., 2:]).reshape(SIZE // 2, 2, SIZE // 2, 2, 3).mean((1, 3))
    np.testing.assert_allclose(coarse / coarse[..., 2:], slopes, atol=1e-6)


@pytest.mark.parametrize("size", [5, 32])
def test_sizes_that_do_not_divide_are_refused(rough, shards, size):
    with pytest.raises(tf.errors.InvalidArgumentError, match=f"averaged to {size}"):
        pipeline.resize(rough, size)
    with pytest.raises(tf.errors.InvalidArgumentError, match=f"averaged to {size}"):
        list(pipeline.evaluation(shards[:1], size=size, batch_size=1))


# Files.


def with_half_a_picture(record):
    message = tf.train.Example.FromString(record)
    pngs = message.features.feature["image"].bytes_list.value
    pngs[-1] = pngs[-1][: len(pngs[-1]) // 2]
    return message.SerializeToString()


DAMAGES = {"message": lambda record: b"\xb6\x94" * 40, "image": with_half_a_picture}
"""Of a record: no example, and bytes that are no text; or a broken picture."""


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_names_the_file_the_record_and_the_mend(shards, tmp_path, damage):
    """Where a checksum is of damaged bytes; what was read before is yielded."""
    copies, found = [tmp_path / path.name for path in shards], []
    for path, copy in zip(shards, copies, strict=True):
        copy.write_bytes(path.read_bytes())
    held = stored(copies[1])
    held[2] = DAMAGES[damage](held[2])
    store(copies[1], held)
    expected = r"00001\.tfrecord is broken: record 2 .*delete the file and its \.json.*lime-render"
    batches = pipeline.evaluation(copies, size=8, batch_size=3)
    with pytest.raises(ValueError, match=expected) as raised:
        found.extend(pipeline.naming_damage(batches, copies))
    assert "\n" not in str(raised.value) and "{{" not in str(raised.value)
    assert [len(batch["index"]) for batch in found] == [3, 3]


def test_errors_without_damage_stay_what_they_are(shards):
    dataset = pipeline.evaluation(shards, size=5, batch_size=1)
    with pytest.raises(tf.errors.InvalidArgumentError, match="averaged to 5"):
        list(pipeline.naming_damage(dataset, shards))


# The split for validation.


@pytest.mark.parametrize("count, last", [(2, 1), (3, 1), (19, 1), (20, 2), (35, 3)])
def test_the_last_tenth_is_the_validation_set(tmp_path, count, last):
    write_split(tmp_path, "train", [range(1)] * count, size=8)
    training, validation = pipeline.training_shards(tmp_path)
    assert training + validation == Split(tmp_path, "train").shard_paths()
    assert len(validation) == last and len(training) == count - last


def test_one_shard_cannot_be_split(tmp_path):
    write_split(tmp_path, "train", [range(1)])
    with pytest.raises(ValueError, match=r"1 shard.*--shard-size"):
        pipeline.training_shards(tmp_path)


CHANGES = {
    "emptied": lambda one, other: ([], other),
    "cut": lambda one, other: ([one[0], one[1][:20], *one[2:]], other),
    "removed": lambda one, other: (one[:1] + one[2:], other),
    "repeated": lambda one, other: ([*one, one[0]], other),
    "in another order": lambda one, other: (one[::-1], other),
    "exchanged": lambda one, other: ([other[0], *one[1:]], [one[0], *other[1:]]),
}
"""Of the records of two shards."""


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_shard_that_is_not_the_manifests_is_named(change, tmp_path):
    write_split(tmp_path, "train", [range(3), range(3, 6)], size=8)
    paths = [tmp_path / "train" / f"0000{shard}.tfrecord" for shard in (0, 1)]
    assert pipeline.verified_shards(Split(tmp_path, "train")) == paths
    for path, held in zip(paths, change(*map(stored, paths)), strict=True):
        store(path, held)
    with pytest.raises(
        ValueError, match=r"00000\.tfrecord is not the shard of manifest\.json.*delete"
    ):
        pipeline.training_shards(tmp_path)


def test_a_manifest_without_a_checksum_for_each_shard_is_named(tmp_path):
    write_split(tmp_path, "train", [range(1), range(1, 2)], size=8)
    with json_files.edited(tmp_path / "train" / "manifest.json") as held:
        held["sha256"].pop()
    with pytest.raises(ValueError, match=r"manifest\.json names 2 shards with 1 checksums"):
        pipeline.training_shards(tmp_path)
