"""The choice of Mitsuba's variant: nothing that a library does may end this process."""

import subprocess
import sys
from pathlib import Path

import pytest

from lime_keras.render.mitsuba_setup import variants


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """A machine with no libLLVM but those that a test puts into the folder returned."""
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(variants, "own_folder", lambda: tmp_path / "own")
    monkeypatch.setattr(variants, "_linker_cache", lambda: [])
    monkeypatch.setattr(Path, "glob", lambda *_: iter(()))
    return tmp_path


def _touch(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"no library")
    return path


def test_the_named_library_comes_first_then_the_own_then_the_systems_newest(machine, monkeypatch):
    own = _touch(machine / "own" / "usr" / "lib" / "libLLVM.so.17.0")
    system = [
        _touch(machine / "system" / name)
        for name in ("libLLVM-15.so.1", "libLLVM.so.19.1", "libLLVM-9.so.1", "libLLVM.so.20.1")
    ]
    named = _touch(machine / "named" / "libLLVM-9.so")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(named))
    monkeypatch.setattr(variants, "_linker_cache", lambda: [*system, *system, named])
    nine, fifteen = system[2], system[0]
    assert variants.candidates() == [named, own, system[3], system[1], fifteen, nine]


def test_without_any_library_there_are_no_candidates(machine):
    assert variants.candidates() == []


@pytest.mark.parametrize("exists", [True, False])
def test_a_file_that_is_no_library_and_a_missing_one_do_not_work(tmp_path, exists):
    path = tmp_path / "libLLVM.so.19.1"
    if exists:
        _touch(path)
    assert not variants.works(path)


@pytest.mark.parametrize("probe", ["import os; os.abort()", "raise SystemExit(1)"])
def test_a_library_that_aborts_or_miscalculates_gives_the_slow_variant(machine, monkeypatch, probe):
    library = _touch(machine / "own" / "libLLVM.so.19.1")
    monkeypatch.setattr(variants, "_PROBE", probe)
    choice = variants.choose()
    assert choice == variants.Choice("scalar_rgb", None, (library,))
    assert f"found but unusable: {library}" in choice.explain()


def test_a_library_that_hangs_does_not_work(machine, monkeypatch):
    monkeypatch.setattr(variants, "_PROBE", "import time; time.sleep(60)")
    monkeypatch.setattr(variants, "_PROBE_SECONDS", 0.3)
    assert not variants.works(machine / "libLLVM.so.19.1")


def test_the_next_library_is_tried_after_a_bad_one(machine, monkeypatch):
    good, bad = (_touch(machine / "own" / f"libLLVM.so.{n}") for n in (19, 20))
    monkeypatch.setattr(variants, "works", lambda library: library == good)
    assert variants.choose() == variants.Choice("llvm_ad_rgb", good, (bad,))


def test_the_slow_variant_is_told_with_the_way_to_the_fast_one(machine):
    choice = variants.choose()
    assert (choice.variant, choice.library, choice.tried) == ("scalar_rgb", None, ())
    explanation = choice.explain()
    assert "scalar_rgb" in explanation and "found but unusable" not in explanation
    for way in ("lime_keras.render.mitsuba_setup.fetch_llvm", "libllvm19", "DRJIT_LIBLLVM_PATH"):
        assert way in explanation


def test_the_fast_variant_is_told_with_its_library():
    explanation = variants.Choice("llvm_ad_rgb", Path("/lib/libLLVM.so.19")).explain()
    assert "llvm_ad_rgb" in explanation and "/lib/libLLVM.so.19" in explanation


@pytest.mark.parametrize(
    ("imported", "choice", "message"),
    [
        ("tensorflow", "'scalar_rgb', None", "TensorFlow was imported before Mitsuba"),
        ("drjit", "'llvm_ad_rgb', 'libLLVM.so'", "Mitsuba was imported before its libLLVM"),
    ],
)
def test_activation_after_a_wrong_import_is_refused(imported, choice, message):
    code = (
        "import sys, types\n"
        f"sys.modules[{imported!r}] = types.ModuleType({imported!r})\n"
        "from lime_keras.render.mitsuba_setup import variants\n"
        f"variants.activate(variants.Choice({choice}), 1)"
    )
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert f"RuntimeError: {message}" in child.stderr
    assert child.returncode == 1


def test_what_was_chosen_is_active(mitsuba_choice):
    import drjit
    import mitsuba

    assert mitsuba.variant() == mitsuba_choice.variant
    assert drjit.thread_count() == 1
