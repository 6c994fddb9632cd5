"""Commands whose standard streams close, and Ctrl-C at any moment, as other tools take them."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import ctrl_c
import pytest

from lime_keras import console

# A command that prints lines, then a word on standard error, and leaves a file when it is done.
COMMAND = """
import subprocess
import sys
from lime_keras import console

def work():
    # A worker process has the three streams, too: without them it dies.
    worker = "import os; [os.fstat(number) for number in range(3)]"
    subprocess.run([sys.executable, "-c", worker], check=True)
    for number in range(20000):
        print("line", number)
    print("done", file=sys.stderr)
    with open("done", "w") as file:
        file.write("whole")
    return 0

sys.exit(console.run(work, "nothing is lost"))
"""


def shell(line, folder, **more):
    """Run a line of bash, in which COMMAND is the command; return its status and what it says."""
    command = shlex.join([sys.executable, "-c", COMMAND])
    done = subprocess.run(
        ["bash", "-c", f"COMMAND() {{ {command}; }}\n{line}"],
        cwd=folder,
        capture_output=True,
        text=True,
        **more,
    )
    return done.returncode, done.stdout, done.stderr


def test_a_reader_that_ends_ends_the_command_quietly(tmp_path):
    line = "COMMAND | head -1; exit ${PIPESTATUS[0]}"
    assert shell(line, tmp_path) == (141, "line 0\n", "")
    line = "COMMAND 2>&1 >/dev/null | true; exit ${PIPESTATUS[0]}"
    assert shell(line, tmp_path)[0] in (0, 141)


@pytest.mark.parametrize(
    ("closed", "said"), [(">&-", "done\n"), ("2>&-", ""), ("<&-", "done\n"), (">&- 2>&- <&-", "")]
)
def test_a_closed_stream_is_one_to_nowhere(closed, said, tmp_path):
    """A file that is opened later does not get what is printed."""
    status, out, err = shell(f"COMMAND {closed}", tmp_path)
    assert (status, err) == (0, said)
    assert out.count("\n") == (0 if ">&- " in f"{closed} " and "2>" not in closed[:2] else 20000)
    assert (tmp_path / "done").read_text() == "whole"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_under_standard_output_is_told(tmp_path):
    status, _, err = shell("COMMAND > /dev/full", tmp_path)
    assert status == 1
    assert err == "error: standard output cannot be written: No space left on device\n"


def test_an_error_of_native_code_after_ctrl_c_is_an_interruption(capsys):
    """A library that is being loaded reports the interruption as a failure of its own."""

    def work():
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(10)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None

    # A shell starts what it leaves in the background with the signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert console.run(work, "nothing is lost") == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "\ninterrupted: nothing is lost\n"
    with pytest.raises(ImportError):
        console.run(lambda: __import__("no_such_module"), "nothing is lost")


@pytest.mark.parametrize("after", [0.05, 0.15, 0.3, 0.6])
def test_ctrl_c_while_a_command_is_imported(after, tmp_path):
    code = "import sys; from lime_keras.launch import estimate; print('go', flush=True)\n"
    code += "sys.exit(estimate())"
    command = [sys.executable, "-c", code, str(tmp_path / "none.png"), "--out", str(tmp_path / "o")]
    (tmp_path / "none.png").write_bytes(b"P6 32 32 255 " + bytes(range(256)) * 12)
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=ctrl_c.is_heard,
    )
    assert process.stdout.readline() == "go\n"
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    if process.returncode == 0:  # a fast machine was done before
        assert (tmp_path / "o" / "none.json").exists(), err
    else:
        assert process.returncode == 130 and "interrupted" in err.splitlines()[-1], err


def test_ctrl_c_waits_for_a_module_that_must_not_be_interrupted(tmp_path, monkeypatch, capsys):
    """nanobind ends the process with a traceback where its types cannot be made."""
    code = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nis_whole = True\n"
    (tmp_path / "aborting").mkdir()
    (tmp_path / "aborting" / "__init__.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(console, "_ABORTING", ("aborting",))
    whole = []

    def work():
        import aborting

        whole.append(aborting.is_whole)
        time.sleep(10)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert console.run(work, "nothing is lost") == 130
    finally:
        signal.signal(signal.SIGINT, before)
        sys.modules.pop("aborting", None)
    assert whole == [True]
    assert capsys.readouterr().err == "\ninterrupted: nothing is lost\n"


def test_ctrl_c_in_a_finaliser_is_not_lost(tmp_path):
    code = """
import os, signal, sys, time
from lime_keras import console
class Finalised:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)

def work():
    Finalised()
    time.sleep(30)
    print("slept")
    return 0

sys.exit(console.run(work, "nothing is lost"))
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=ctrl_c.is_heard)
    told = done.returncode, done.stdout, done.stderr
    assert told == (130, "", "\ninterrupted: nothing is lost\n")


def test_ctrl_c_while_a_finished_command_ends_changes_nothing(tmp_path):
    """Python takes a while to end: threads and modules are let go."""
    (tmp_path / "none.png").write_bytes(b"P6 32 32 255 " + bytes(range(256)) * 12)
    code = "import atexit, os, signal, sys; from lime_keras import launch\n"
    code += "atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))\n"
    code += "sys.exit(launch.estimate())"
    command = [sys.executable, "-c", code, str(tmp_path / "none.png"), "--only", "mask"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done
