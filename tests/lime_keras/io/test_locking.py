"""One process at a time writes to a folder."""

import subprocess
import sys

import pytest

from lime_keras.io import locking

HOLDS = """
import sys, time
from pathlib import Path
from lime_keras.io import locking
with locking.lock_folder(Path(sys.argv[1]), "program is training"):
    print("locked", flush=True)
    time.sleep(60)
"""


def test_a_second_process_is_refused_until_the_first_ends_or_is_killed(tmp_path):
    run = tmp_path / "runs" / "mine"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(run)], stdout=subprocess.PIPE, text=True
    ) as first:
        assert first.stdout.readline() == "locked\n"
        with (
            pytest.raises(RuntimeError, match=r"another program is training .*mine: wait for it"),
            locking.lock_folder(run, "program is training"),
        ):
            pass
        first.kill()
        first.wait()
    with locking.lock_folder(run, "program is training"):
        pass


def test_folders_in_which_nothing_was_written_are_removed(tmp_path):
    with locking.lock_folder(tmp_path / "a" / "b", "x"):
        assert (tmp_path / "a" / "b").is_dir()
    assert not list(tmp_path.iterdir())
    with locking.lock_folder(tmp_path / "a" / "b", "x"):
        (tmp_path / "a" / "kept").touch()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["kept"]
    (tmp_path / "there").mkdir()
    with locking.lock_folder(tmp_path / "there", "x"):
        pass
    assert (tmp_path / "there").is_dir()


def test_a_file_system_that_cannot_lock_is_no_error(tmp_path, monkeypatch):
    def unable(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(locking.fcntl, "flock", unable)
    with locking.lock_folder(tmp_path, "x"):
        pass
