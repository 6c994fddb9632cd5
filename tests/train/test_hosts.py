"""Two processes train one run, as one process does, and end together."""

import host_runs
import keras
import numpy as np
import pytest
import stage_runs
from sphere_corpus import write_split

from lime_keras.model import weights
from lime_keras.train import cli, hosts, trainer
from lime_keras.train.devices import Devices


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    pytest.importorskip("jax")
    folder = tmp_path_factory.mktemp("hosts")
    write_split(folder / host_runs.CORPUS, "train", [range(4), range(4, 8)], size=32)
    return folder


def _left(folder, name):
    with np.load(folder / f"{name}.npz") as stored:
        return [stored[name] for name in stored.files]


def _curve(run):
    rows = stage_runs.curve(run, "exponent")
    return [{name: float(row[name] or 0) for name in row if name != "seconds"} for row in rows]


@pytest.mark.slow
def test_two_processes_train_as_one(folder):
    """Process 0 alone saves, which must not wait for the other; and the other writes nothing."""
    for what in ("together", "alone"):
        for status, told in host_runs.start(folder, what):
            assert status == 0, told[-4000:]
    _, saved = weights.load(folder / "together", whole=False)
    for one, other, held, alone in zip(
        *(_left(folder, name) for name in ("together-0", "together-1")),
        saved["exponent"].get_weights(),
        _left(folder, "alone-0"),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, held)
        np.testing.assert_allclose(one, alone, rtol=1e-4, atol=1e-6)
    together, alone = _curve(folder / "together"), _curve(folder / "alone")
    for row, expected in zip(together, alone, strict=True):
        assert row == pytest.approx(expected, rel=1e-4)


@pytest.mark.slow
def test_processes_that_differ_end_with_the_difference(folder):
    for index, (status, told) in enumerate(host_runs.start(folder, "disagreeing")):
        assert status == 1
        assert f"error: process {index} of 2: the processes of --hosts differ in options" in told
    assert not (folder / "disagreeing").exists()


@pytest.mark.slow
def test_an_error_in_one_process_ends_the_other(folder):
    (status, told), (other_status, other_told) = host_runs.start(folder, "failing")
    assert other_status == 1 and "error: process 1 of 2: the lamp went out" in other_told
    assert status != 0
    assert "another process has ended" in told or "another task died" in told


@pytest.mark.parametrize("hosts_, rows, of_each, counted", [(2, 6, 3, 1), (2, 5, 5, 1 / 2)])
def test_each_process_takes_its_part_of_a_batch(hosts_, rows, of_each, counted, monkeypatch):
    """Of a batch that cannot be shared out, each takes all, and each example counts once."""
    batch = {"mask": np.arange(rows)}
    taken, weight = [], 0.0
    for process in range(hosts_):
        monkeypatch.setattr(hosts, "rank_and_size", lambda process=process: (process, hosts_))
        devices = Devices(1)
        taken += list(devices.split(batch)["mask"])
        weights_here = keras.ops.convert_to_numpy(devices.weights(batch))
        assert weights_here.tolist() == [counted] * of_each
        weight += weights_here.sum()
        assert devices.leads == (process == 0)
    assert weight == rows
    assert set(taken) == set(range(rows)) and len(taken) == hosts_ * of_each


@pytest.mark.parametrize(
    "options, expected",
    [
        (["--hosts", "2"], "--hosts, --host and --coordinator belong together"),
        (["--host", "1"], "--hosts, --host and --coordinator belong together"),
        (["--hosts", "2", "--host", "2", "--coordinator", "a:1"], "pass 0 to 1"),
        (["--hosts", "2", "--host", "-1", "--coordinator", "a:1"], "pass 0 to 1"),
        (["--hosts", "2", "--host", "0", "--coordinator", "a"], "a is no HOST:PORT"),
        (["--hosts", "2", "--host", "0", "--coordinator", ":70000"], "is no HOST:PORT"),
        (["--hosts", "2", "--host", "0", "--coordinator", "a:1"], "set KERAS_BACKEND=jax"),
    ],
)
def test_options_that_do_not_join_are_refused(options, expected, tmp_path, capsys):
    run = [str(tmp_path / "corpus"), "--out", str(tmp_path / "run"), "--preset", "smoke"]
    assert cli.main([*run, *options]) == 1
    assert expected in capsys.readouterr().err


def test_a_batch_that_processes_cannot_share_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(hosts, "rank_and_size", lambda: (0, 3))
    config = stage_runs.config()
    with pytest.raises(ValueError, match="cannot be split between 3 devices"):
        trainer.train([tmp_path / "corpus"], tmp_path / "run", config, stage_runs.ignore)
