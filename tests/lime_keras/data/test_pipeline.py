"""Shards to batches: order, photos, resumption, averaging, classes, and broken files."""

import itertools
import json

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example, write_split

from lime_keras.data import camera, pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.data.features import LEARNT_FROM
from lime_keras.optics import colour, material_law, shading, shininess

SIZE = 16
COUNT = 12
PAINT = ("diffuse_albedo", "specular_albedo")
HALF = 2.0**-11
"""Rounding of a half float below 1, which normals of the stored size keep."""


def write_shard(path, examples):
    with tf.io.TFRecordWriter(str(path)) as writer:
        for features in examples:
            writer.write(records.encode(features))
    return path


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    """Three shards of four examples."""
    folder = tmp_path_factory.mktemp("corpus")
    return [
        write_shard(
            folder / f"{shard:05d}.tfrecord",
            [example(index, size=SIZE) for index in range(4 * shard, 4 * shard + 4)],
        )
        for shard in range(3)
    ]


def order(shards, steps, batch_size=2, seed=0, first_step=0):
    """Indices of the examples of so many training batches, `(steps, batch_size)`."""
    dataset = pipeline.training(
        shards,
        size=8,
        batch_size=batch_size,
        seed=seed,
        first_step=first_step,
        camera=False,
        features=("index",),
    )
    return np.array([batch["index"] for batch in itertools.islice(iter(dataset), steps)])


# Order.


def test_the_seed_decides_the_order(shards):
    first, again, other = (order(shards, 12, seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_every_epoch_holds_every_example_once_in_another_order(shards):
    epochs = order(shards, 18).reshape(3, COUNT)
    for epoch in epochs:
        assert sorted(epoch) == list(range(COUNT))
    assert not np.array_equal(epochs[0], epochs[1])
    assert not np.array_equal(epochs[1], epochs[2])
    assert not np.array_equal(epochs[0], np.arange(COUNT))


def test_batches_are_whole_and_cross_epochs(shards):
    found = order(shards, 12, batch_size=5).reshape(-1)
    assert found.shape == (60,)
    for epoch in found.reshape(5, COUNT):
        assert sorted(epoch) == list(range(COUNT))


@pytest.mark.parametrize("batch_size", [2, 5])
def test_resuming_carries_on_where_an_uninterrupted_order_would_be(shards, batch_size):
    """Within the first epoch, at one's boundary, where a batch spans two, and later."""
    whole = order(shards, 20, batch_size)
    for first_step in (0, 1, 2, 5, 6, 7, 12, 13, 19):
        resumed = order(shards, 20 - first_step, batch_size, first_step=first_step)
        np.testing.assert_array_equal(resumed, whole[first_step:])


def test_epochs_that_are_over_are_not_read(shards):
    """To read all that a billion steps did would take hours."""
    resumed = order(shards, 3, first_step=10**9)
    epoch = order(shards, 6, first_step=10**9 // 6 * 6)
    assert sorted(epoch.flat) == list(range(COUNT))
    np.testing.assert_array_equal(resumed[: 6 - 10**9 % 6], epoch[10**9 % 6 :])


def test_tensorflows_global_seed_has_no_part(shards):
    orders = []
    for seed in (None, 1, 2):
        tf.random.set_seed(seed)
        orders.append(order(shards, 12))
    tf.random.set_seed(None)
    np.testing.assert_array_equal(orders[1:], orders[:1] * 2)


def test_every_process_takes_the_same_order(shards):
    """Written down by another one. If TensorFlow shuffles otherwise, no run can be resumed."""
    epochs = [[5, 9, 4, 6, 8, 1, 11, 0, 3, 2, 7, 10], [3, 0, 1, 8, 5, 9, 7, 6, 4, 11, 2, 10]]
    assert order(shards, 12).reshape(2, COUNT).tolist() == epochs


def test_more_examples_than_the_buffer_holds_are_shuffled_too(shards, monkeypatch):
    monkeypatch.setattr(pipeline, "_SHUFFLE", 3)
    whole = order(shards, 18)
    for epoch in whole.reshape(3, COUNT):
        assert sorted(epoch) == list(range(COUNT))
    np.testing.assert_array_equal(order(shards, 11, first_step=7), whole[7:])


def test_empty_shards_are_refused(tmp_path):
    path = write_shard(tmp_path / "empty.tfrecord", [])
    with pytest.raises(ValueError, match=r"no example to train on in .*empty\.tfrecord"):
        pipeline.training([path], size=8, batch_size=1, seed=0)


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


def test_training_holds_what_the_losses_read(shards):
    [batch] = pipeline.training(shards, size=8, batch_size=4, seed=0).take(1)
    assert set(batch) == set(LEARNT_FROM)
    assert all(value.dtype.is_floating or name == "exponent_bin" for name, value in batch.items())


@pytest.mark.parametrize("photographed", [False, True])
def test_training_names_its_examples_if_asked(shards, photographed):
    options = {"size": 8, "batch_size": COUNT, "seed": 0, "camera": photographed}
    names = (*LEARNT_FROM, "seed", "index")
    [batch] = pipeline.training(shards, **options, features=names).take(1)
    [learnt_from] = pipeline.training(shards, **options).take(1)
    assert set(batch) == set(names)
    assert batch["seed"].dtype == batch["index"].dtype == tf.int64
    assert batch["seed"].numpy().tolist() == [0] * COUNT
    for name, value in learnt_from.items():
        np.testing.assert_array_equal(batch[name], value, err_msg=name)
    for index, albedo in zip(batch["index"].numpy(), batch["diffuse_albedo"], strict=True):
        np.testing.assert_allclose(albedo, example(index, size=SIZE)["diffuse_albedo"], rtol=1e-6)


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


def photos(shards, steps, *, size=SIZE, seed=0, first_step=0, **augmentations):
    """So many training batches as arrays."""
    dataset = pipeline.training(
        shards,
        size=size,
        batch_size=3,
        seed=seed,
        first_step=first_step,
        features=pipeline.FEATURES,
        **augmentations,
    )
    return list(itertools.islice(dataset.as_numpy_iterator(), steps))


def assert_same(found, expected):
    for batch, other in zip(found, expected, strict=True):
        assert set(batch) == set(other)
        for name, value in batch.items():
            np.testing.assert_array_equal(value, other[name], err_msg=name)


@pytest.mark.parametrize("size", [pytest.param(SIZE, marks=pytest.mark.slow), 4])
def test_the_seed_decides_the_batches(shards, size):
    first = photos(shards, 9, size=size)
    assert_same(photos(shards, 9, size=size), first)
    other = photos(shards, 9, size=size, seed=1)
    assert [batch["index"].tolist() for batch in first] != [b["index"].tolist() for b in other]


def test_resuming_takes_the_photos_of_an_uninterrupted_run(shards):
    whole = photos(shards, 8)
    for first_step in (1, 4, 6):
        assert_same(photos(shards, 8 - first_step, first_step=first_step), whole[first_step:])


def test_an_example_is_photographed_anew_in_every_epoch(shards):
    batches = photos(shards, 3 * COUNT // 3)
    taken = [batch["image"][i] for batch in batches for i in np.flatnonzero(batch["index"] == 5)]
    assert len(taken) == 3
    assert not np.array_equal(taken[0], taken[1]) and not np.array_equal(taken[1], taken[2])


def test_two_seeds_take_different_photos_of_the_same_order(tmp_path):
    path = write_shard(tmp_path / "one.tfrecord", [example(0, size=SIZE)])
    [first], [other] = (photos([path], 1, seed=seed) for seed in (0, 1))
    assert first["index"].tolist() == other["index"].tolist()
    assert not np.array_equal(first["image"], other["image"])
    # Nor is one photo of a batch like the next.
    assert not np.array_equal(first["image"][0], first["image"][1])


def test_training_without_a_camera_shows_what_is_stored(shards):
    options = {"size": SIZE, "batch_size": COUNT, "features": pipeline.FEATURES}
    [trained] = pipeline.training(shards, **options, seed=0, camera=False).take(1)
    [stored] = pipeline.evaluation(shards, **options)
    order = np.argsort(trained["index"])
    for name, value in stored.items():
        np.testing.assert_array_equal(trained[name].numpy()[order], value, err_msg=name)
    for index in range(COUNT):
        parsed = records.parse(records.encode(example(index, size=SIZE)))
        np.testing.assert_allclose(stored["image"][index], parsed["image"], atol=1e-6)


def test_every_other_scene_is_a_mirrors(shards):
    options = {"size": SIZE, "batch_size": COUNT, "seed": 0, "camera": False}
    features = ("image", "mirror", "index")
    plain, flipped = (
        list(pipeline.training(shards, **options, flips=flips, features=features).take(20))
        for flips in (False, True)
    )
    turned = []
    for stored, seen in zip(plain, flipped, strict=True):
        np.testing.assert_array_equal(seen["index"], stored["index"])
        for row in range(COUNT):
            turned.append(not np.array_equal(seen["image"][row], stored["image"][row]))
            for name in ("image", "mirror"):
                there = stored[name][row].numpy()
                expected = there[:, ::-1] if turned[-1] else there
                np.testing.assert_array_equal(seen[name][row], expected)
    # 240 throws of a coin: five standard deviations.
    assert 0.34 < np.mean(turned) < 0.66
    # An example is seen both ways in the course of the epochs.
    each = np.array(turned)[np.argsort(np.concatenate([b["index"] for b in plain]), kind="stable")]
    assert all(0 < epochs.sum() < 20 for epochs in each.reshape(COUNT, 20))


def test_a_mirrored_scene_has_any_cast_of_the_light(shards):
    options = {"size": SIZE, "batch_size": COUNT, "seed": 0, "camera": True}
    features = ("mirror", "cast", "index")
    plain, flipped = (
        list(pipeline.training(shards, **options, flips=flips, features=features).take(30))
        for flips in (False, True)
    )
    turned = np.concatenate(
        [
            (seen["mirror"] != stored["mirror"]).numpy().any(axis=(1, 2, 3))
            for stored, seen in zip(plain, flipped, strict=True)
        ]
    )
    casts = np.concatenate([batch["cast"] for batch in plain])
    assert casts.shape == (30 * COUNT, 4)
    # Five standard deviations of the correlation of independent draws.
    for cast in casts.T:
        assert abs(np.corrcoef(turned, cast)[0, 1]) < 5 / np.sqrt(len(turned))


@pytest.mark.parametrize("augmentation", ["flips", "repaints"])
def test_resuming_augments_as_an_uninterrupted_run(shards, augmentation):
    whole = photos(shards, 8, **{augmentation: True})
    assert_same(photos(shards, 4, first_step=4, **{augmentation: True}), whole[4:])


@pytest.mark.parametrize("with_camera", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_scene_is_painted_anew_in_every_epoch(shards, with_camera):
    options = {"size": SIZE, "batch_size": COUNT, "seed": 0, "camera": with_camera}
    options["features"] = pipeline.FEATURES
    plain, painted = (
        list(pipeline.training(shards, **options, repaints=repaints).take(3))
        for repaints in (False, True)
    )
    for before, after in zip(plain, painted, strict=True):
        for name in set(pipeline.FEATURES) - {"image", "clipped", *PAINT}:
            np.testing.assert_array_equal(after[name], before[name], err_msg=name)
        for name in ("image", *PAINT):
            assert all(
                not np.array_equal(a, b) for a, b in zip(after[name], before[name], strict=True)
            )
    for name in PAINT:
        seen = np.stack([b[name].numpy()[np.argsort(b["index"])] for b in painted])
        assert not np.array_equal(seen[0], seen[1])


def test_paint_needs_no_more_features_than_are_asked_for(shards):
    options = {"size": SIZE, "batch_size": COUNT, "seed": 0, "camera": False, "repaints": True}
    [batch] = pipeline.training(shards, **options, features=("image",)).take(1)
    [whole] = pipeline.training(shards, **options, features=pipeline.FEATURES).take(1)
    assert set(batch) == {"image"}
    np.testing.assert_array_equal(batch["image"], whole["image"])


def test_evaluation_photographs_only_if_asked_and_always_alike(shards):
    options = {"size": 8, "features": ("image", "index")}
    [clean] = pipeline.evaluation(shards, **options, batch_size=COUNT)
    [asked] = pipeline.evaluation(shards, **options, batch_size=COUNT, camera=True)
    assert not np.array_equal(clean["image"], asked["image"])
    in_batches = pipeline.evaluation(shards[::-1], **options, batch_size=5, camera=True)
    in_batches = list(in_batches.as_numpy_iterator())
    images, indices = (np.concatenate([b[name] for b in in_batches]) for name in ("image", "index"))
    np.testing.assert_array_equal(images[np.argsort(indices)], asked["image"])
    own = camera.photograph(records.parse(records.encode(example(7, size=SIZE))))
    np.testing.assert_allclose(asked["image"][7], pipeline.resize(own, 8)["image"], atol=1e-6)


def test_threads_change_nothing(shards):
    options = {"size": SIZE, "batch_size": 4, "seed": 3}
    one, many = tf.data.Options(), tf.data.Options()
    one.threading.private_threadpool_size = 1
    many.threading.private_threadpool_size = 8
    first, other = (
        list(pipeline.training(shards, **options).with_options(threads).take(6).as_numpy_iterator())
        for threads in (one, many)
    )
    assert_same(first, other)


# Classes.


def test_classes_agree_with_bin_of_at_the_edges(tmp_path):
    edges = (10.0**shininess.LOG_EDGES).astype(np.float32)
    near = [edges, np.nextafter(edges, 0), np.nextafter(edges, np.float32(1e9)), edges * 0.9999]
    further = [[0, 1e-30, 0.5, 1e6, 1e30], 10.0**shininess.LOG_MEANS]
    exponents = np.concatenate([*near, *further]).astype(np.float32)
    sphere = example(0, size=4)
    path = write_shard(tmp_path / "s.tfrecord", [sphere | {"shininess": s} for s in exponents])
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


@pytest.mark.parametrize("size", [16, 8, 4, 2])
def test_averaging_conserves_light_and_length(rough, size):
    found, factor = pipeline.resize(rough, size), SIZE // size
    for name in ("diffuse_shading", "specular_shading", "mirror"):
        total = np.sum(found[name] * found["mask"]) * factor**2
        assert total == pytest.approx(np.sum(rough[name] * rough["mask"]), rel=1e-4)
    length = np.linalg.norm(found["normal"], axis=-1)
    np.testing.assert_allclose(length, (found["mask"].numpy() > 0)[..., 0], atol=HALF)
    for name in ("environment", "shininess", "diffuse_albedo", "index"):
        np.testing.assert_array_equal(found[name], rough[name])


def test_a_silhouette_stays_as_bright_as_the_object():
    sphere = example(0, size=SIZE)
    mask = sphere["mask"]
    covered = sphere | {name: 3.0 * mask for name in ("diffuse_shading", "mirror")}
    found = pipeline.resize(records.parse(records.encode(covered)), 4)
    edge = (found["mask"].numpy() > 0) & (found["mask"].numpy() < 1)
    assert edge.any()
    np.testing.assert_allclose(found["mirror"].numpy()[edge], 3, rtol=1e-5)


def test_the_camera_is_scaled_along(rough):
    """A large pixel is seen along the corner that its four small ones share."""
    small = pipeline.resize(rough, SIZE // 2)
    coarse = shading.view_directions(small["camera"].numpy(), SIZE // 2, SIZE // 2)
    fine = shading.view_directions(rough["camera"].numpy(), SIZE, SIZE)
    slopes = (fine / fine[..., 2:]).reshape(SIZE // 2, 2, SIZE // 2, 2, 3).mean((1, 3))
    np.testing.assert_allclose(coarse / coarse[..., 2:], slopes, atol=1e-6)


@pytest.mark.parametrize("size", [3, 5, 15, 17, 32])
def test_sizes_that_do_not_divide_are_refused(rough, shards, size):
    with pytest.raises(tf.errors.InvalidArgumentError, match=f"averaged to {size}"):
        pipeline.resize(rough, size)
    with pytest.raises(tf.errors.InvalidArgumentError, match=f"averaged to {size}"):
        list(pipeline.evaluation(shards[:1], size=size, batch_size=1))


# Files.


def open_either_way(path):
    shards, options = [path], {"size": 8, "batch_size": 1}
    yield lambda: pipeline.evaluation(shards, **options)
    yield lambda: pipeline.training(shards, **options, seed=0)


@pytest.mark.parametrize("kept", [-1, -5, 5, 11, 12, 20])
def test_a_shard_cut_off_is_named(shards, tmp_path, kept):
    path = tmp_path / "broken.tfrecord"
    path.write_bytes(shards[0].read_bytes()[:kept])
    for opened in open_either_way(path):
        with pytest.raises(ValueError, match=r"broken\.tfrecord is broken.*lime-render"):
            opened()


def test_a_header_cut_off_is_named(shards, tmp_path):
    """TensorFlow alone would silently take what comes before for the whole shard."""
    path = tmp_path / "broken.tfrecord"
    path.write_bytes(shards[0].read_bytes() + bytes(5))
    for opened in open_either_way(path):
        with pytest.raises(ValueError, match=r"broken\.tfrecord is broken"):
            opened()


def test_what_is_no_shard_is_named(tmp_path):
    path = tmp_path / "text.tfrecord"
    path.write_text("this is no shard, but it is long enough to be one", encoding="utf-8")
    for opened in open_either_way(path):
        with pytest.raises(ValueError, match=r"text\.tfrecord is broken"):
            opened()
        with pytest.raises(FileNotFoundError, match=r"text\.tfrecord"):
            path.unlink(missing_ok=True)
            opened()
        path.write_text("this is no shard, but it is long enough to be one", encoding="utf-8")


def spans(path):
    """Where each record's data begin and end in a shard."""
    data, end, found = path.read_bytes(), 0, []
    while end < len(data):
        begin = end + 12
        length = int.from_bytes(data[end : end + 8], "little")
        found.append((begin, begin + length))
        end = begin + length + 4
    return found


def flip(path, position):
    data = bytearray(path.read_bytes())
    data[position] ^= 0x10
    path.write_bytes(data)


def break_png(path, number, name):
    """Write a shard anew, whole, with a picture of one record broken."""
    stored = [s.numpy() for s in tf.data.TFRecordDataset(str(path))]
    message = tf.train.Example.FromString(stored[number])
    pngs = message.features.feature[name].bytes_list.value
    pngs[-1] = pngs[-1][: len(pngs[-1]) // 2]
    stored[number] = message.SerializeToString()
    with tf.io.TFRecordWriter(str(path)) as writer:
        for serialized in stored:
            writer.write(serialized)


def break_message(path, number):
    """Write a shard anew, whole, with a record that is no example, and whose bytes are no text."""
    stored = [s.numpy() for s in tf.data.TFRecordDataset(str(path))]
    stored[number] = b"\xb6\x94" * 40
    with tf.io.TFRecordWriter(str(path)) as writer:
        for serialized in stored:
            writer.write(serialized)


DAMAGES = {
    "message": lambda path: break_message(path, 2),
    "data": lambda path: flip(path, sum(spans(path)[2]) // 2),
    "checksum": lambda path: flip(path, spans(path)[2][1] + 1),
    "length's checksum": lambda path: flip(path, spans(path)[2][0] - 2),
    "length": lambda path: flip(path, spans(path)[2][0] - 12),
    "length far off": lambda path: flip(path, spans(path)[2][0] - 5),
    "cut": lambda path: path.write_bytes(path.read_bytes()[: sum(spans(path)[2]) // 2]),
    "cut header": lambda path: path.write_bytes(path.read_bytes()[: spans(path)[2][0] - 5]),
    "image": lambda path: break_png(path, 2, "image"),
    "mirror": lambda path: break_png(path, 2, "mirror"),
}


FAST_DAMAGES = ("message", "checksum", "cut header", "image")


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(name, marks=() if name in FAST_DAMAGES else pytest.mark.slow)
        for name in DAMAGES
    ],
)
def test_damage_names_the_file_the_record_and_the_mend(shards, tmp_path, damage):
    copies = [tmp_path / path.name for path in shards]
    for path, copy in zip(shards, copies, strict=True):
        copy.write_bytes(path.read_bytes())
    DAMAGES[damage](copies[1])
    options = {"size": 8, "batch_size": 3}
    expected = r"00001\.tfrecord is broken: record 2 .*delete the file and its \.json.*lime-render"
    for opened in (
        lambda: pipeline.evaluation(copies, **options),
        lambda: pipeline.training(copies, **options, seed=0).take(COUNT),
    ):
        with pytest.raises(ValueError, match=expected) as raised:
            list(pipeline.naming_damage(opened(), copies))
        assert "\n" not in str(raised.value) and "{{" not in str(raised.value)


def test_what_was_read_before_the_damage_is_yielded(shards, tmp_path):
    path = tmp_path / "s.tfrecord"
    path.write_bytes(shards[0].read_bytes())
    flip(path, sum(spans(path)[3]) // 2)
    found = []
    with pytest.raises(ValueError, match="record 3"):
        dataset = pipeline.evaluation([path], size=8, batch_size=1)
        found.extend(pipeline.naming_damage(dataset, [path]))
    assert [int(batch["index"][0]) for batch in found] == [0, 1, 2]


def test_errors_without_damage_stay_what_they_are(shards):
    dataset = pipeline.evaluation(shards, size=5, batch_size=1)
    with pytest.raises(tf.errors.InvalidArgumentError, match="averaged to 5"):
        list(pipeline.naming_damage(dataset, shards))


def test_whole_shards_are_yielded_whole(shards):
    dataset = pipeline.evaluation(shards, size=8, batch_size=5)
    assert len(list(pipeline.naming_damage(dataset, shards))) == 3


# The split for validation.


@pytest.mark.parametrize("count, held_out", [(2, 1), (3, 1), (19, 1), (20, 2), (35, 3)])
def test_the_last_tenth_is_held_out(tmp_path, count, held_out):
    write_split(tmp_path, "train", [range(1)] * count)
    training, validation = pipeline.training_shards(tmp_path)
    assert training + validation == Split(tmp_path, "train").shard_paths()
    assert len(validation) == held_out and len(training) == count - held_out


def test_one_shard_cannot_be_split(tmp_path):
    write_split(tmp_path, "train", [range(1)])
    with pytest.raises(ValueError, match=r"1 shard.*--shard-size"):
        pipeline.training_shards(tmp_path)


def _emptied(stored, other):
    return [], other


def _removed(stored, other):
    return stored[:1] + stored[2:], other


def _repeated(stored, other):
    return [*stored, stored[0]], other


def _in_another_order(stored, other):
    return stored[::-1], other


def _exchanged(stored, other):
    return [other[0], *stored[1:]], [stored[0], *other[1:]]


@pytest.mark.parametrize(
    "change",
    [_emptied, _removed, _repeated, _in_another_order, _exchanged],
    ids=lambda f: f.__name__,
)
def test_a_shard_that_is_not_the_manifests_is_named(change, tmp_path):
    write_split(tmp_path, "train", [range(3), range(3, 6)], size=8)
    paths = [tmp_path / "train" / f"0000{shard}.tfrecord" for shard in (0, 1)]
    assert pipeline.whole_shards(Split(tmp_path, "train")) == paths
    held = [[one.numpy() for one in tf.data.TFRecordDataset(str(path))] for path in paths]
    for path, stored in zip(paths, change(*held), strict=True):
        with tf.io.TFRecordWriter(str(path)) as writer:
            for one in stored:
                writer.write(one)
    with pytest.raises(
        ValueError, match=r"00000\.tfrecord is not the shard of manifest\.json.*delete"
    ):
        pipeline.training_shards(tmp_path)


def test_a_manifest_without_a_checksum_for_each_shard_is_named(tmp_path):
    write_split(tmp_path, "train", [range(1), range(1, 2)], size=8)
    path = tmp_path / "train" / "manifest.json"
    held = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(held | {"sha256": held["sha256"][:1]}), encoding="utf-8")
    with pytest.raises(ValueError, match=r"manifest\.json tells of 2 shards with 1 checksums"):
        pipeline.training_shards(tmp_path)


def test_an_incomplete_corpus_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-render"):
        pipeline.training_shards(tmp_path)


def test_held_out_scenes_are_painted_from_their_own_numbers(shards):
    options = {"size": SIZE, "batch_size": COUNT, "features": pipeline.FEATURES}
    natural = {"repaints": True, "materials": (material_law.NATURAL,)}
    [plain] = pipeline.evaluation(shards, **options).take(1)
    first, again = (next(iter(pipeline.evaluation(shards, **options, **natural))) for _ in range(2))
    assert_same([first], [again])
    np.testing.assert_array_equal(first["shininess"], plain["shininess"])
    np.testing.assert_array_equal(first["mask"], plain["mask"])
    assert not np.array_equal(first["specular_albedo"], plain["specular_albedo"])
    total = tf.reduce_max(first["diffuse_albedo"], axis=1) + first["specular_albedo"]
    assert np.max(total) <= 1.000001
