"""Weights on disk: a round trip, and an error that names the file for everything else."""

import dataclasses
import json
import re
import shutil

import full_disk
import h5py
import keras
import numpy as np
import pytest

from lime_keras.model import weights
from lime_keras.networks import Architecture, build, subnetwork_names

NAMES = [field.name for field in dataclasses.fields(Architecture) if field.type is int]
LIME = ("segmentation", "specular", "mirror", "exponent", "albedo")
FILES = ["architecture.json", *(f"{name}.weights.h5" for name in LIME)]


@pytest.fixture
def model(tiny_model, tmp_path):
    """A copy that a test may break."""
    return shutil.copytree(tiny_model, tmp_path / "copy")


def assert_same(found, expected):
    assert set(found) == set(expected)
    for name in expected:
        pairs = zip(found[name].get_weights(), expected[name].get_weights(), strict=True)
        assert all(np.array_equal(a, b) for a, b in pairs), name


def test_round_trip(tiny, tmp_path):
    keras.utils.set_random_seed(5)
    subnetworks = build(tiny)
    weights.save(tmp_path / "deep" / "model", tiny, subnetworks)
    assert sorted(path.name for path in (tmp_path / "deep" / "model").iterdir()) == sorted(FILES)
    architecture, found = weights.load(tmp_path / "deep" / "model")
    assert architecture == tiny
    assert_same(found, subnetworks)


def test_half_the_space_keeps_sixteen_bits(tmp_path):
    wide = Architecture(size=32, unet_width=8, unet_depth=3, encoder_width=8, dense_width=32)
    subnetworks = build(wide, seed=1)
    weights.save(tmp_path / "whole", wide, subnetworks)
    weights.save(tmp_path / "half", wide, subnetworks, half=True)
    _, found = weights.load(tmp_path / "half")
    for name, network in subnetworks.items():
        for one, other in zip(found[name].get_weights(), network.get_weights(), strict=True):
            assert one.dtype == np.float32
            np.testing.assert_array_equal(one, other.astype(np.float16).astype(np.float32))
        whole, half = (tmp_path / kind / f"{name}.weights.h5" for kind in ("whole", "half"))
        assert half.stat().st_size < 0.7 * whole.stat().st_size
    assert sorted(path.name for path in (tmp_path / "half").iterdir()) == sorted(FILES)


@pytest.mark.parametrize("share, half", [(0, False), (0.5, True), (0.999, False)])
def test_a_disk_that_is_full_leaves_the_model_of_before(share, half, tiny, tmp_path):
    subnetworks = build(tiny, seed=1)
    weights.save(tmp_path / "model", tiny, subnetworks)
    size = (tmp_path / "model" / "segmentation.weights.h5").stat().st_size
    with (
        pytest.raises(OSError, match=r"segmentation\.weights\.h5 cannot be written: .*; "),
        full_disk.files_end_after(int(share * size)),
    ):
        weights.save(tmp_path / "model", tiny, build(tiny, seed=2), half=half)
    assert sorted(path.name for path in (tmp_path / "model").iterdir()) == sorted(FILES)
    assert_same(weights.load(tmp_path / "model")[1], subnetworks)


def test_the_room_that_is_tried_is_as_large_as_the_file(tiny, tmp_path, monkeypatch):
    tried = []
    monkeypatch.setattr(weights, "_reserve", lambda *_: None)
    weights.save(tmp_path / "model", tiny, build(tiny))
    monkeypatch.undo()
    monkeypatch.setattr(weights.Path, "unlink", lambda path: tried.append(path.stat().st_size))
    for name, network in build(tiny).items():
        weights._reserve(tmp_path / "room", network, False)
        size = (tmp_path / "model" / f"{name}.weights.h5").stat().st_size
        assert size <= tried[-1] < 20 * size


def test_a_model_saved_before_there_were_ablations_is_lime(tiny, model):
    path = model / "architecture.json"
    written = json.loads(path.read_text(encoding="utf-8"))
    assert set(written) == {f.name for f in dataclasses.fields(Architecture)}
    path.write_text(json.dumps({name: written[name] for name in NAMES}), encoding="utf-8")
    architecture, found = weights.load(model)
    assert architecture == tiny and architecture.description == "LIME"
    assert set(found) == set(LIME)


def test_ablations_come_back(ablation, tmp_path):
    keras.utils.set_random_seed(6)
    subnetworks = build(ablation)
    weights.save(tmp_path, ablation, subnetworks)
    kept = {"architecture.json", *(f"{name}.weights.h5" for name in subnetwork_names(ablation))}
    assert {path.name for path in tmp_path.iterdir()} == kept
    architecture, found = weights.load(tmp_path)
    assert architecture == ablation
    assert_same(found, subnetworks)
    for name in sorted(kept):
        (tmp_path / name).rename(tmp_path / "elsewhere")
        with pytest.raises(FileNotFoundError, match=rf"{name} is missing.*lime-train"):
            weights.load(tmp_path)
        (tmp_path / "elsewhere").rename(tmp_path / name)


@pytest.mark.parametrize(
    "fields, file",
    [
        ({"mirror": False}, "exponent.weights.h5 cannot be read"),
        ({"exponent": "regression"}, "exponent.weights.h5 cannot be read"),
        ({"system": "reflectance-map"}, "reflectance_map.weights.h5 is missing"),
        (
            {"system": "shading"},
            "architecture.json cannot be read as an architecture of this version: no system",
        ),
        ({"mirror": False, "system": "reflectance-map"}, "one ablation at a time; train again"),
    ],
)
def test_the_weights_of_another_system_are_named(fields, file, tiny, model):
    text = json.dumps(dataclasses.asdict(tiny) | fields)
    (model / "architecture.json").write_text(text, encoding="utf-8")
    with pytest.raises((ValueError, FileNotFoundError), match=re.escape(file)):
        weights.load(model)


def test_saving_again_replaces_everything(tiny, model):
    wider = dataclasses.replace(tiny, unet_width=3)
    subnetworks = build(wider)
    weights.save(model, wider, subnetworks)
    architecture, found = weights.load(model)
    assert architecture == wider
    assert_same(found, subnetworks)
    assert sorted(path.name for path in model.iterdir()) == sorted(FILES)


def test_a_run_is_taken_for_its_model(tiny, model, tmp_path):
    (tmp_path / "run").mkdir()
    model.rename(tmp_path / "run" / "model")
    for folder in (tmp_path / "run", str(tmp_path / "run" / "model")):
        assert weights.load(folder)[0] == tiny


@pytest.mark.parametrize("name", [FILES[0], FILES[1], FILES[-1]])
def test_a_missing_file_is_named(name, model):
    (model / name).unlink()
    with pytest.raises(FileNotFoundError, match=rf"{name} is missing.*lime-train"):
        weights.load(model)


@pytest.mark.parametrize("name, kept", [(FILES[1], 0), (FILES[-1], -500)])
def test_a_file_cut_off_is_named(name, kept, model):
    path = model / name
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match=rf"{name} cannot be read: .*; train again$"):
        weights.load(model)


@pytest.mark.parametrize("name, value", [("mirror", np.nan), ("albedo", -np.inf)])
def test_a_weight_that_is_not_finite_is_named(name, value, tiny, model):
    _, subnetworks = weights.load(model)
    values = subnetworks[name].get_weights()
    values[-1].flat[0] = value
    subnetworks[name].set_weights(values)
    weights.save(model, tiny, subnetworks)
    with pytest.raises(ValueError, match=rf"{name}\.weights\.h5 cannot be read: .* NaN"):
        weights.load(model)


@pytest.mark.parametrize("way", ["link", "link to a group", "soft link", "raw", "virtual"])
def test_values_that_lie_in_another_file_are_refused(way, model):
    path = model / "segmentation.weights.h5"
    elsewhere = model / "elsewhere.h5"
    shutil.copyfile(path, elsewhere)
    with h5py.File(path, "a") as file:
        found: dict[str, h5py.Dataset] = {}
        file.visititems(lambda name, item: found.update({name: item} if _is_array(item) else {}))
        name, array = next(iter(found.items()))
        shape = array.shape
        array[...].tofile(model / "values.raw")
        parent = name.rpartition("/")[0]
        if way == "link to a group":
            del file[parent]
            file[parent] = h5py.ExternalLink("elsewhere.h5", parent)
        else:
            del file[name]
        if way == "link":
            file[name] = h5py.ExternalLink("elsewhere.h5", name)
        if way == "soft link":
            file["aside"] = h5py.ExternalLink("elsewhere.h5", name)
            file[name] = h5py.SoftLink("/aside")
        if way == "raw":
            raw = [("values.raw", 0, h5py.h5f.UNLIMITED)]
            file.create_dataset(name, shape, np.float32, external=raw)
        if way == "virtual":
            layout = h5py.VirtualLayout(shape, np.float32)
            layout[...] = h5py.VirtualSource("elsewhere.h5", name, shape)
            file.create_virtual_dataset(name, layout)
    with pytest.raises(
        ValueError, match=r"segmentation\.weights\.h5 cannot be read: .* another file"
    ):
        weights.load(model)


def _is_array(item):
    return isinstance(item, h5py.Dataset)


@pytest.mark.slow
def test_whatever_a_damaged_byte_leads_to_names_the_file(model):
    path = model / "mirror.weights.h5"
    whole = path.read_bytes()
    _, subnetworks = weights.load(model)
    told = set()
    for position in (*range(0, 60, 6), *range(60, len(whole), 200)):
        damaged = bytearray(whole)
        damaged[position] ^= 16
        path.write_bytes(damaged)
        try:
            weights._read(path, subnetworks["mirror"])
        except ValueError as error:
            assert f"{path} cannot be read: " in str(error)
            told.add(type(error.__cause__))
    assert not told <= {OSError, ValueError}  # others are raised, too


@pytest.mark.parametrize("error", [KeyError("vars"), RuntimeError(), AttributeError("dtype")])
def test_whatever_the_reader_raises_names_the_file(error, model, monkeypatch):
    def read(*_):
        raise error

    monkeypatch.setattr(keras.Model, "load_weights", read)
    with pytest.raises(ValueError, match=r"segmentation\.weights\.h5 cannot be read: .+; t"):
        weights.load(model)


@pytest.mark.parametrize("name, other", [("mirror", "specular"), ("albedo", "exponent")])
def test_another_subnetworks_file_is_named(name, other, model):
    shutil.copy(model / f"{other}.weights.h5", model / f"{name}.weights.h5")
    with pytest.raises(ValueError, match=rf"{name}\.weights\.h5 cannot be read: .*; train again$"):
        weights.load(model)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "3",
        '{"size": 32}',
        json.dumps(dict.fromkeys([*NAMES, "another"], 32)),
        json.dumps(dict.fromkeys(NAMES, 4) | {"size": "32"}),
        json.dumps(dict.fromkeys(NAMES, 4) | {"size": 30}),
        json.dumps(dict.fromkeys(NAMES, 4) | {"size": 32, "unet_depth": 10**9}),
        json.dumps(dict.fromkeys(NAMES, 4) | {"size": 32, "unet_width": 10**9}),
        json.dumps(dict.fromkeys(NAMES, 4) | {"size": 2.0**5}),
        "[" * 100_000,
    ],
)
def test_an_architecture_of_another_version_is_named(text, model):
    (model / "architecture.json").write_text(text, encoding="utf-8")
    with pytest.raises(
        ValueError,
        match=r"architecture\.json cannot be read as an architecture of this version.*train again",
    ):
        weights.load(model)
