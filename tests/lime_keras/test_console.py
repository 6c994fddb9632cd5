"""Exit statuses, errors in one line, and a standard error that comes back."""

import os

import pytest

from lime_keras import console


def failing(error):
    def command():
        raise error

    return command


@pytest.mark.parametrize("status", [0, 1, 2])
def test_a_commands_status_is_passed_on(status, capsys):
    assert console.run(lambda: status, "nothing lost") == status
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    "error", [ValueError("too small"), RuntimeError("too small"), FileNotFoundError("too small")]
)
def test_an_expected_error_is_one_line_on_standard_error(error, capsys):
    assert console.run(failing(error), "nothing lost") == 1
    assert capsys.readouterr() == ("", "error: too small\n")


def test_an_interruption_says_what_is_kept(capsys):
    assert console.run(failing(KeyboardInterrupt()), "shards are kept") == 130
    assert capsys.readouterr() == ("", "\ninterrupted: shards are kept\n")


@pytest.mark.parametrize("error", [KeyError("bug"), TypeError("bug"), AssertionError("bug")])
def test_a_bug_keeps_its_traceback(error):
    with pytest.raises(type(error)):
        console.run(failing(error), "nothing lost")


def test_standard_error_is_closed_for_a_while(capfd):
    os.write(2, b"before ")
    with console._standard_error_closed():
        os.write(2, b"during ")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before after"


def test_standard_error_comes_back_after_an_error(capfd):
    with pytest.raises(ImportError), console._standard_error_closed():
        raise ImportError
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


def test_tensorflow_is_imported_quietly(capfd):
    descriptors = len(os.listdir("/dev/fd"))
    console.import_tensorflow()
    assert capfd.readouterr() == ("", "")
    assert len(os.listdir("/dev/fd")) <= descriptors + 1
