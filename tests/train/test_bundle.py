"""Bundles: packed the same every time, checked, and run to an end whatever happens."""

import hashlib
import importlib.metadata
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import time

import bundles
import pytest
import sphere_bank

from lime_keras.networks import weights
from lime_keras.train import bundle

JAX_BRINGS = {"numpy", "scipy", "ml-dtypes", "opt-einsum"}


def _archive(pieces):
    joined = b"".join(piece.read_bytes() for piece in pieces)
    return tarfile.open(fileobj=io.BytesIO(joined), mode="r:gz")


@pytest.fixture
def packed(tmp_path):
    """A bundle; in a folder whose name shells have to take care of."""
    bundles.jax(tmp_path / "jax")
    bundles.write(tmp_path / "the bundle", tmp_path / "parts")
    return tmp_path / "the bundle"


# Packing.


def test_pieces_make_up_the_archive_in_order(tmp_path):
    told = []
    pieces = bundles.write(
        tmp_path / "out", tmp_path / "parts", tell=lambda *counts: told.append(counts)
    )
    sizes = [piece.stat().st_size for piece in pieces]
    assert len(pieces) > 2 and set(sizes[:-1]) == {3000} and 0 < sizes[-1] <= 3000
    index = [line.split() for line in (tmp_path / "out" / bundle.INDEX).read_text().splitlines()]
    assert (
        [name for _, _, name in index] == [p.name for p in pieces] == sorted(p.name for p in pieces)
    )
    for (digest, size, _), piece in zip(index, pieces, strict=True):
        assert digest == hashlib.sha256(piece.read_bytes()).hexdigest()
        assert int(size) == piece.stat().st_size
    with _archive(pieces) as archive:
        names = archive.getnames()
        assert (
            archive.extractfile("banks/1/bank.json").read()
            == (tmp_path / "parts" / "bank-1.json").read_bytes()
        )
        script = archive.extractfile(bundle.SCRIPT).read()
    assert names == [
        bundle.SCRIPT,
        "banks/0/bank.json",
        "banks/1/bank.json",
        "wheels/lime_keras-0-py3-none-any.whl",
    ]
    assert script == (tmp_path / "out" / bundle.SCRIPT).read_bytes()
    assert told[-1][0] == told[-1][1] > 8000 and told == sorted(told)


@pytest.mark.parametrize("piece_bytes, expected", [(500, None), (10**9, 1)])
def test_pieces_of_any_size(piece_bytes, expected, tmp_path):
    pieces = bundles.write(tmp_path / "out", tmp_path / "parts", piece_bytes=piece_bytes)
    assert max(piece.stat().st_size for piece in pieces) <= piece_bytes
    assert expected is None or len(pieces) == expected
    assert sum(1 for _ in (tmp_path / "out").iterdir()) == len(pieces) + 2


def test_the_same_files_give_the_same_bytes_at_any_time(tmp_path, monkeypatch):
    first, second = (
        bundles.write(tmp_path / name, tmp_path / "parts") for name in ("first", "second")
    )
    monkeypatch.setattr(time, "time", lambda: 1e9)
    os.utime(tmp_path / "parts" / "bank-0.json", (1e9, 1e9))
    bundles.write(tmp_path / "second", tmp_path / "parts")  # in place of the earlier one
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_the_script_is_a_shell_script_with_the_settings(packed):
    script = packed / bundle.SCRIPT
    subprocess.run(["sh", "-n", script], check=True)
    text = script.read_text(encoding="utf-8")
    assert "\nMINUTES=5\n" in text and "\nOPTIONS='--preset '" in text
    named = set(re.findall(r"\$\{?([A-Z_]+)", text)) - {"PYTHON", "PYTHONPATH"}
    assert named == {"PYTHON_VERSION", "MINUTES", "OPTIONS", "NEEDED_KB"}
    assert all(f"\n{name}=" in text for name in named)


def test_a_folder_that_holds_something_else_stays(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("years")
    with pytest.raises(ValueError, match="is no bundle"):
        bundles.write(tmp_path / "out", tmp_path / "parts")
    assert (tmp_path / "out" / "thesis.txt").read_text() == "years"


def test_the_packages_are_all_that_keras_and_the_command_need():
    """So no package is missing on the other machine when Keras begins to need another one."""
    needed, left = set(), ["keras", "tqdm"]
    while left:
        name = left.pop()
        if name in needed or name in JAX_BRINGS:
            continue
        needed.add(name)
        for one in importlib.metadata.requires(name) or ():
            if "extra ==" not in one and "Windows" not in one and "win32" not in one:
                left.append(re.match(r"[\w-]+", one)[0].lower().replace("_", "-"))
    assert needed == set(bundle.PACKAGES)


@pytest.mark.parametrize(
    "options, expected",
    [
        (["--bank", "{none}"], "bank.json is missing"),
        (["--bank", "{cut}"], "is not as it was rendered: check the bank with `lime-render"),
        (["--bank", "{bank}", "--", "--out", "run2"], "--out cannot be passed on to lime-train"),
        (["--bank", "{bank}", "--", "--minutes", "3"], "--minutes cannot be passed on"),
        (["--bank", "{bank}", "--", "--size", "64"], "which cannot be averaged to 64"),
        (["--bank", "{bank}", "--", "--size", "32", "--batch-size", "3"], "stand in pairs"),
        (
            ["--bank", "{bank}", "--start-from", "{none}", "--", "--size", "32"],
            "holds no trained model",
        ),
    ],
)
def test_what_lime_train_would_refuse_is_refused(options, expected, tmp_path, capsys):
    bank = sphere_bank.write(tmp_path / "bank", count=2, shapes=2, maps=2)
    cut = sphere_bank.write(tmp_path / "cut", count=2, shapes=2, maps=2)
    (cut / "textures.npy").write_bytes(b"")
    names = {"bank": bank, "cut": cut, "none": tmp_path / "none"}
    command = [str(tmp_path / "out"), *(one.format(**names) for one in options)]
    assert bundle.main(command) == 1
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


# Running.


def test_a_bundle_is_run_to_its_end(packed):
    status, output, told = bundles.run(packed, WEIGHTS="17000000")
    assert status == 0, output + told
    assert "warning" not in told and "JAX on gpu 0 some device" in output
    result = packed / "result"
    assert sorted(path.name for path in result.iterdir()) == [
        "evaluation.json",
        "log.txt",
        "run.tar.gz.aa",
        "run.tar.gz.ab",
        "timing.txt",
    ]
    assert max(path.stat().st_size for path in result.iterdir()) <= 16_000_000
    with _archive(sorted(result.glob("run.tar.gz.*"))) as archive:
        assert archive.getmember("model/weights.h5").size == 17_000_000
        assert {"config.json", "evaluation.json", "curves"} <= set(archive.getnames())
    asked = (result / "log.txt").read_text().strip()
    assert asked.startswith(f"asked --preset live --out {packed}/work/run --minutes 4.")
    assert asked.endswith(" ".join(f"{packed}/work/files/banks/{number}" for number in range(2)))
    # Nothing is unpacked or installed again, and the run goes on with its own minutes.
    status, output, told = bundles.run(packed, 1)
    assert status == 0 and "unpacked" not in output and "goes on, of 4." in output, told


def test_what_is_unpacked_can_be_run_where_it_is(packed):
    with _archive(sorted(packed.glob("bundle.tar.gz.*"))) as archive:
        archive.extractall(packed.parent / "unpacked", filter="data")
    status, _, told = bundles.run(packed.parent / "unpacked")
    assert status == 0, told
    assert (packed.parent / "unpacked" / "result" / "run.tar.gz.aa").is_file()


def test_without_a_gpu_it_says_so_and_goes_on(packed):
    bundles.jax(packed.parent / "jax", backend="cpu")
    status, _, told = bundles.run(packed)
    assert status == 0 and "warning: JAX finds no GPU" in told


def _without(name):
    return lambda folder: (folder / name).unlink()


def _with_a_flipped_bit(folder):
    path = folder / "bundle.tar.gz.001"
    data = bytearray(path.read_bytes())
    data[5] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize(
    "spoil, environment, expected",
    [
        (_without("bundle.tar.gz.001"), {}, "bundle.tar.gz.001 is missing: copy all"),
        (_without("index.txt"), {}, "index.txt is missing"),
        (_with_a_flipped_bit, {}, "bundle.tar.gz.001 has a wrong checksum"),
        (None, {"PYTHON": "/no/python"}, "/no/python is missing: install Python"),
        (None, {"PYTHONPATH": "broken"}, "cannot use JAX (ImportError: no lamp)"),
        (None, {"FAILS": "1"}, "failed: error: the lamp went out"),
    ],
)
def test_what_goes_wrong_is_said(spoil, environment, expected, packed):
    if spoil is not None:
        spoil(packed)
    if "PYTHONPATH" in environment:
        (packed.parent / "jax" / "jax.py").write_text("raise ImportError('no lamp')")
        environment = {}
    status, output, told = bundles.run(packed, **environment)
    assert status == 1 and expected in told + output


@pytest.mark.parametrize(
    "settings, needed_kb, expected",
    [
        ({"PYTHON_VERSION": "3.9"}, 1, "the bundle's wheels are for 3.9"),
        ({}, 10**13, "MB left, and 9"),
    ],
)
def test_another_python_and_a_full_disk_are_told(
    settings, needed_kb, expected, tmp_path, monkeypatch
):
    monkeypatch.setattr(bundle, "_ROOM_KB", needed_kb)
    bundles.jax(tmp_path / "jax")
    bundles.write(tmp_path / "out", tmp_path / "parts", **settings)
    status, _, told = bundles.run(tmp_path / "out")
    assert status == 1 and expected in told


@pytest.mark.parametrize("minutes", ["x", "-3", "1.2.3"])
def test_minutes_that_are_no_number_are_wrong_usage(minutes, packed):
    status, _, told = bundles.run(packed, minutes)
    assert status == 2 and "usage: sh run.sh [MINUTES]" in told


def test_minutes_that_are_over_before_the_training_are_told(packed):
    status, _, told = bundles.run(packed, 0.1)
    assert status == 1 and "0.1 minutes are too short" in told


def test_weights_stay_when_it_is_stopped_or_its_time_is_up(packed):
    started = bundles.start(packed, SECONDS="100")
    deadline = time.monotonic() + 60
    while not (packed / "result" / "run.tar.gz.aa").is_file() and time.monotonic() < deadline:
        time.sleep(0.1)
    started.send_signal(signal.SIGTERM)
    output, told = started.communicate(timeout=60)
    assert started.returncode == 143 and "it was stopped" in output, told
    assert output.count("weights in") == 1
    with _archive([packed / "result" / "run.tar.gz.aa"]) as archive:
        assert "model/training.json" in archive.getnames()
    status, output, told = bundles.run(packed, 0.15, SECONDS="100")
    assert status == 143 and "its time was up" in output, told
    with _archive([packed / "result" / "run.tar.gz.aa"]) as archive:
        assert "model/training.json" in archive.getnames()


# Rehearsal.


def _python():
    """Python 3.12 if there is one, else this one."""
    found = shutil.which("python3.12")
    works = found and subprocess.run([found, "--version"], capture_output=True).returncode == 0
    return found if works else sys.executable


@pytest.mark.slow
def test_the_whole_is_rehearsed_where_there_is_no_tensorflow(tmp_path):
    """On the processor: packed, carried to a clean environment, trained, brought home."""
    python = _python()
    home = tmp_path / "venv"
    subprocess.run([python, "-m", "venv", home], check=True)
    python = home / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "jax", "numpy"], check=True)
    version = subprocess.run(
        [python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    bank = sphere_bank.write(tmp_path / "bank")
    command = [str(tmp_path / "bundle"), "--bank", str(bank), "--preset", "smoke"]
    command += ["--piece-mb", "8", "--python", version, "--"]
    command += ["--size", "32", "--width", "2", "--batch-size", "4"]
    assert bundle.main(command) == 0
    pieces = sorted((tmp_path / "bundle").glob("*.gz.*"))
    assert len(pieces) > 1 and max(piece.stat().st_size for piece in pieces) <= 8_000_000
    status, output, told = bundles.run(
        tmp_path / "bundle",
        4,
        PYTHON=str(python),
        PYTHONPATH="",
        JAX_PLATFORMS="cpu",
        # Compiled in a third of the time, whatever it then takes to run.
        XLA_FLAGS="--xla_backend_optimization_level=0",
    )
    assert status == 0, told + output + (tmp_path / "bundle/work/log.txt").read_text()[-4000:]
    result = tmp_path / "bundle" / "result"
    with _archive(sorted(result.glob("run.tar.gz.*"))) as archive:
        archive.extractall(tmp_path / "brought", filter="data")
    architecture, subnetworks = weights.load(tmp_path / "brought")
    assert architecture.size == 32 and len(subnetworks) == 5
    evaluated = json.loads((result / "evaluation.json").read_text(encoding="utf-8"))
    assert evaluated["examples"] > 0
    record = json.loads((tmp_path / "brought" / "config.json").read_text(encoding="utf-8"))
    assert record["backend"] == "jax" and record["packages"]["tensorflow"] is None
    assert (tmp_path / "brought" / "curves" / "1-segmentation.csv").is_file()
    assert sum(path.stat().st_size for path in result.iterdir()) < 60_000_000
    assert len(list(result.iterdir())) <= 8
