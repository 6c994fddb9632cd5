"""The graphs at the end of a run: written once, in another process, or the command is told."""

import shutil
import subprocess

import pytest

from lime_keras import Estimator, console
from lime_keras.train import graphs


def test_graphs_of_these_weights_stay(run, monkeypatch):
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("they are there"))
    assert graphs.write(run) == f"its graphs, which lime-estimate runs, in {run / 'onnx'}"


def test_what_fails_or_is_not_installed_names_the_command(run, monkeypatch):
    shutil.rmtree(run / "onnx")
    command = f"run `lime-export {run} --format graphs --weights {run}`"

    def fails(*_, **options):
        assert options["env"]["KERAS_BACKEND"] == "tensorflow"
        return subprocess.CompletedProcess([], 1, "", "TensorFlow speaks\nerror: no room\n")

    monkeypatch.setattr(subprocess, "run", fails)
    assert graphs.write(run) == f"no graphs for lime-estimate (error: no room): {command}"
    monkeypatch.setattr(console, "EXPORTING", ("tensorflow_of_another_planet",))
    told = graphs.write(run)
    assert "needs tensorflow_of_another_planet" in told and told.endswith(command)


@pytest.mark.slow
def test_graphs_are_written_for_the_estimator(run):
    shutil.rmtree(run / "onnx")
    assert "in" in graphs.write(run)
    assert Estimator(run).size == 32
