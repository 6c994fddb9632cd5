"""Batches of banks: their order, their parts, and what is refused."""

import itertools

import keras
import numpy as np
import pytest

from lime_keras.synthesis import batches
from lime_keras.synthesis.scenes import Scenes
from tests.fixtures import sphere_bank

SIZE = 32
FEATURES = ("index", "seed", "shininess")


@pytest.fixture(scope="module")
def banks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("banks")
    return [sphere_bank.write(folder / name, size=SIZE) for name in ("one", "two")]


@pytest.fixture(autouse=True)
def unmade(monkeypatch):
    """Leave out the work of the device: only the draws matter here."""

    def make(self, drawn):
        shininess = keras.ops.convert_to_tensor(drawn["draws"]["shininess"])
        return {"index": drawn["index"], "seed": drawn["seed"], "shininess": shininess}

    monkeypatch.setattr(Scenes, "make", make)


def _first(count, banks, **options):
    given = {"size": SIZE, "batch_size": 4, "seed": 5, "features": FEATURES} | options
    found = itertools.islice(batches.training(banks, **given), count)
    return [
        {name: keras.ops.convert_to_numpy(value) for name, value in batch.items()}
        for batch in found
    ]


def test_positions_follow_one_another(banks):
    found = _first(6, banks[:1])
    np.testing.assert_array_equal(np.concatenate([b["index"] for b in found]), np.arange(24))
    assert {int(seed) for batch in found for seed in batch["seed"]} == {5}


def test_training_resumes_at_any_step(banks):
    whole, rest = _first(6, banks), _first(3, banks, first_step=3)
    for one, other in zip(whole[3:], rest, strict=True):
        for name in FEATURES:
            np.testing.assert_array_equal(one[name], other[name])


def test_banks_take_turns(banks):
    """Batch p is of bank p modulo 2, at the same positions as if it were the only bank."""
    both = _first(4, banks)
    for bank in (0, 1):
        alone = _first(4, [banks[bank]])
        for step in range(bank, 4, 2):
            np.testing.assert_array_equal(both[step]["shininess"], alone[step]["shininess"])


def test_the_parts_of_several_machines_make_the_whole_batch(banks):
    whole = _first(3, banks, batch_size=8)
    parts = [_first(3, banks, batch_size=8, rows=(k, 2)) for k in (0, 1)]
    for step, batch in enumerate(whole):
        for name in FEATURES:
            joined = np.concatenate([part[step][name] for part in parts])
            np.testing.assert_array_equal(joined, batch[name])


def test_another_seed_gives_other_scenes(banks):
    one, other = _first(1, banks), _first(1, banks, seed=6)
    assert not np.array_equal(one[0]["shininess"], other[0]["shininess"])


def test_held_out_batches_are_the_same_every_time(banks):
    def found():
        held_out = batches.held_out(
            banks[0], size=SIZE, batch_size=4, count=3, camera=True, features=FEATURES
        )
        return [keras.ops.convert_to_numpy(batch["shininess"]) for batch in held_out]

    one, other = found(), found()
    assert len(one) == 3
    np.testing.assert_array_equal(one, other)


def test_batches_that_machines_cannot_share_are_refused(banks):
    with pytest.raises(ValueError, match="batches of 5 cannot be divided among 2 machines"):
        _first(1, banks, batch_size=5, rows=(0, 2))


def test_an_error_of_a_thread_reaches_the_caller_and_a_closed_iterator_ends(banks, monkeypatch):
    found = batches.training(banks, size=SIZE, batch_size=4, seed=0, features=FEATURES)
    next(found)
    found.close()

    def fail(self, seed, positions):
        raise OSError("the disk is gone")

    monkeypatch.setattr(Scenes, "draw", fail)
    with pytest.raises(OSError, match="the disk is gone"):
        _first(1, banks)
