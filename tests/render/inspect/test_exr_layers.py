"""An exported example, read back by OpenImageIO, is the record."""

import numpy as np
import OpenImageIO as oiio
import pytest
import sphere_corpus
import tensorflow as tf

from lime_keras.data import records
from lime_keras.data.corpus import Split
from lime_keras.optics import colour
from lime_keras.render.inspect import exr_layers

INDEX = 3


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(
        tmp_path_factory.mktemp("corpus"), "test", [range(2), range(2, 4), range(4, 5)], seed=2**40
    )


@pytest.fixture(scope="module")
def record():
    serialized = records.encode(sphere_corpus.example(INDEX, seed=2**40))
    return {name: value.numpy() for name, value in records.parse(serialized).items()}


@pytest.fixture(scope="module")
def path(corpus):
    path = corpus / "test" / "example.exr"
    exr_layers.export(corpus, "test", INDEX, path)
    return path


def read(path):
    """Channels by name, each `(H, W)`, and the file's specification."""
    file = oiio.ImageInput.open(str(path))
    spec, pixels = file.spec(), file.read_image(oiio.FLOAT)
    file.close()
    return dict(zip(spec.channelnames, np.moveaxis(pixels, -1, 0), strict=True)), spec


def test_its_light_lies_beside_it(path, corpus):
    environment = corpus / "test" / "example-environment.exr"
    assert exr_layers.environment_path(path) == environment and environment.is_file()


def test_its_channels_are_the_record_bit_for_bit(path, record):
    channels, _ = read(path)
    linear = colour.srgb_to_linear(record["image"])
    for position, name in enumerate("RGB"):
        np.testing.assert_array_equal(channels.pop(name), linear[..., position])
    for position, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(
            channels.pop(f"normal.{axis}"), record["normal"][..., position]
        )
    for name in ("mask", "diffuse_shading", "specular_shading", "mirror"):
        np.testing.assert_array_equal(channels.pop(f"{name}.Y"), record[name][..., 0])
    assert not channels
    light, _ = read(exr_layers.environment_path(path))
    np.testing.assert_array_equal(light.pop("Y"), record["environment"][..., 0])
    assert not light


def test_radiance_is_stored_in_half_and_what_is_finer_in_float(path):
    _, spec = read(path)
    kinds = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    fine = {name for name, kind in kinds.items() if kind == "float"}
    assert fine == {"R", "G", "B", "mask.Y"} and set(kinds.values()) == {"float", "half"}


def test_its_attributes_tell_material_camera_and_origin(path, record):
    _, spec = read(path)
    for name in ("specular_albedo", "shininess", "ambient"):
        assert np.float32(spec.getattribute(name)) == record[name]
    np.testing.assert_array_equal(
        np.array(spec.getattribute("diffuse_albedo"), np.float32), record["diffuse_albedo"]
    )
    camera = [spec.getattribute(f"camera_{name}") for name in ("fx", "fy", "cx", "cy")]
    np.testing.assert_array_equal(np.array(camera, np.float32), record["camera"])
    assert [spec.getattribute(name) for name in ("shape", "light", "seed", "index")] == [
        "sphere",
        "lamp",
        str(2**40),
        INDEX,
    ]


def test_only_its_own_shard_is_opened(corpus, tmp_path, monkeypatch):
    opened = []
    reader = tf.data.TFRecordDataset
    monkeypatch.setattr(
        tf.data, "TFRecordDataset", lambda path: opened.append(path) or reader(path)
    )
    exr_layers.export(corpus, "test", 4, tmp_path / "last.exr")
    assert opened == [str(Split(corpus, "test").shard_path(2))]
    assert read(tmp_path / "last.exr")[1].getattribute("index") == 4


@pytest.mark.parametrize("index", [-1, 5])
def test_an_index_out_of_range_is_told_with_the_range(corpus, tmp_path, index):
    with pytest.raises(ValueError, match=rf"test has no example {index}: pass one of 0 … 4$"):
        exr_layers.export(corpus, "test", index, tmp_path / "none.exr")
    assert not list(tmp_path.iterdir())


def test_an_incomplete_split_is_told_with_how_to_complete_it(corpus, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"lime-render .* --split train .*completes it"):
        exr_layers.export(corpus, "train", 0, tmp_path / "none.exr")
    sphere_corpus.write_split(tmp_path, "test", [range(2)])
    Split(tmp_path, "test").shard_path(0).unlink()
    with pytest.raises(FileNotFoundError, match=r"00000.tfrecord is missing: run the same"):
        exr_layers.export(tmp_path, "test", 0, tmp_path / "none.exr")


def test_a_shard_of_other_examples_is_refused(tmp_path):
    sphere_corpus.write_split(tmp_path, "test", [range(2), range(7, 9)])
    with pytest.raises(ValueError, match=r"record 1 is not example 3.*lime-render verify"):
        exr_layers.export(tmp_path, "test", 3, tmp_path / "none.exr")


def test_a_file_that_cannot_be_written_is_told(corpus, tmp_path):
    with pytest.raises(ValueError, match=r"example.png would be no OpenEXR: name it .exr"):
        exr_layers.export(corpus, "test", 0, tmp_path / "example.png")
    (tmp_path / "example.exr").mkdir()
    with pytest.raises(IsADirectoryError, match=r"example.exr"):
        exr_layers.export(corpus, "test", 0, tmp_path / "example.exr")
    assert [path.name for path in tmp_path.iterdir()] == ["example.exr"]


def test_the_folder_is_made(corpus, tmp_path):
    exr_layers.export(corpus, "test", 0, tmp_path / "new" / "example.exr")
    assert (tmp_path / "new" / "example.exr").stat().st_size > 1000
