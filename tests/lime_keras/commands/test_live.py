"""`lime-live` from its command line to its page."""

import http.client
import json
import os
import signal
import socket
import subprocess
import sys

import ctrl_c
import pytest
import static_page

from lime_keras import console
from lime_keras.commands import live
from lime_keras.live import static


def _run(*arguments):
    code = f"import sys; from lime_keras.commands.live import main; sys.exit(main({arguments!r}))"
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=ctrl_c.is_heard if os.name == "posix" else None,
    )


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent as POSIX does")
def test_it_serves_its_page_until_ctrl_c():
    process = _run("--no-browser", "--port", "0", "--camera")
    try:
        url = process.stdout.readline().split()[0]
        host = url.removeprefix("http://").rstrip("/")
        connection = http.client.HTTPConnection(host, timeout=30)
        connection.request("GET", "/engine.json")
        assert json.loads(connection.getresponse().read())["start"]["kind"] == "camera"
        connection.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.communicate()


def test_a_taken_port_is_told(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert live.main(["--no-browser", "--port", port]) == 1
    told = capsys.readouterr().err
    assert port in told and "--port 0" in told


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--photo", "no such.jpg"], "no such.jpg is no file"),
        (["--video", "."], ". is no file"),
        (["--weights", "no such run"], "no such run"),
    ],
)
def test_what_is_not_there_is_told_before_anything_is_loaded(arguments, told, capsys):
    assert live.main([*arguments, "--no-browser"]) == 1
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["--port", "65536"],
        ["--port", "-1"],
        ["--camera", "--photo", "a.jpg"],
        ["--static", "site", "--precision", "int8"],
    ],
)
def test_wrong_usage(arguments):
    with pytest.raises(SystemExit) as stop:
        live.main(arguments)
    assert stop.value.code == 2


def test_the_static_page_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(static, "fetched_runtime", static_page.runtime)
    assert live.main(["--static", str(tmp_path / "site")]) == 0
    told = capsys.readouterr()
    assert f"http.server -d {tmp_path / 'site'}" in told.out
    assert (tmp_path / "site" / "engine.json").is_file()


def test_a_folder_with_other_files_is_refused_before_anything_is_fetched(tmp_path, capsys):
    (tmp_path / "thesis.tex").touch()
    assert live.main(["--static", str(tmp_path)]) == 1
    assert "would be lost" in capsys.readouterr().err


def test_the_static_page_takes_its_extra(monkeypatch, capsys):
    monkeypatch.setattr(console, "_installed", lambda module: module != "onnx")
    assert live.main(["--static", "site"]) == 1
    assert "pip install '.[web]'" in capsys.readouterr().err
