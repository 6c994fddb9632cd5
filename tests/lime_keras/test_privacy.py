"""An estimate leaves its results and nothing else, and asks nobody for anything."""

import os
import re
import shutil
import subprocess
import sys

import pytest

_OPENED = re.compile(r'^\d+ +openat\(AT_FDCWD, "([^"]+)", [^)]*O_(?:CREAT|WRONLY|RDWR).*= \d+$')
ESTIMATE = "import sys; from lime_keras.commands.estimate import main; sys.exit(main())"
_SWITCHES = ("ORT_DISABLE_TELEMETRY", "CI", "XDG_CACHE_HOME", "TMPDIR")


def clean(home):
    return {k: v for k, v in os.environ.items() if k not in _SWITCHES} | {"HOME": str(home)}


def test_an_estimate_leaves_its_results_alone(tiny_model, tmp_path):
    """ONNX Runtime would leave a device identifier and a database, and look up a host."""
    home, out, trace = (tmp_path / name for name in ("home", "out", "trace"))
    home.mkdir()
    (tmp_path / "photo.ppm").write_bytes(b"P6 32 32 255 " + bytes(range(256)) * 12)
    command = [sys.executable, "-c", ESTIMATE, "photo.ppm", "--out", "out", "--weights", tiny_model]
    if shutil.which("strace"):
        command = [
            "strace",
            "-f",
            "-qq",
            "-o",
            trace,
            "-e",
            "trace=connect,sendto,openat",
            *command,
        ]
    done = subprocess.run(command, cwd=tmp_path, env=clean(home), capture_output=True, text=True)
    assert (out / "photo.json").exists(), done.stderr
    assert not list(home.iterdir())
    if trace.exists():
        lines = trace.read_text().splitlines()
        assert not [line for line in lines if "AF_INET" in line or "AF_UNIX" in line]
        written = {match[1] for match in map(_OPENED.match, lines) if match}
        assert written and all(path.startswith(("out", "/dev/", str(out))) for path in written)


@pytest.mark.parametrize("given", [{}, {"ORT_DISABLE_TELEMETRY": "0"}])
def test_the_switch_is_set_before_any_library_and_a_users_own_stays(given, tmp_path):
    code = """
import os, sys, lime_keras
assert not {"onnxruntime", "numpy"} & set(sys.modules)
print(os.environ["ORT_DISABLE_TELEMETRY"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code], env=clean(tmp_path) | given, capture_output=True, text=True
    )
    assert done.stdout.strip() == given.get("ORT_DISABLE_TELEMETRY", "1"), done.stderr
