"""Exit statuses, errors in one line, argument types, and a standard error that comes back."""

import argparse
import functools
import importlib
import io
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


@pytest.mark.parametrize(
    "error, told",
    [
        (MemoryError(), "error: out of memory: close other programs, or give less at once\n"),
        (MemoryError("1 GiB"), "error: out of memory (1 GiB): close other programs, or give less"),
        (MemoryError("a.jpg does not fit into this machine's memory: m"), "error: a.jpg does not"),
    ],
)
def test_too_little_memory_is_told_in_a_sentence(error, told, capsys):
    assert console.run(failing(error), "nothing lost") == 1
    assert capsys.readouterr().err.startswith(told)


def test_an_interruption_says_what_is_kept(capsys):
    assert console.run(failing(KeyboardInterrupt()), "shards are kept") == 130
    assert capsys.readouterr() == ("", "\ninterrupted: shards are kept\n")


@pytest.mark.parametrize("error", [KeyError("bug"), TypeError("bug"), AssertionError("bug")])
def test_a_bug_keeps_its_traceback(error):
    with pytest.raises(type(error)):
        console.run(failing(error), "nothing lost")


def test_a_count_is_at_least_one():
    assert [console.count(text) for text in ("1", "512")] == [1, 512]
    for text in ("0", "-3"):
        with pytest.raises(argparse.ArgumentTypeError, match=f"{text} is not at least 1"):
            console.count(text)


def test_a_positive_number_is_finite():
    assert [console.positive(text) for text in ("1e-9", "3")] == [1e-9, 3]
    for text in ("0", "-1", "nan", "inf"):
        with pytest.raises(argparse.ArgumentTypeError, match=f"{text} is not above 0 and finite"):
            console.positive(text)


def test_names_are_known():
    parse = console.names(("mask", "albedo", "exponent"))
    assert parse("exponent, mask") == ("exponent", "mask")
    expected = "unknown: colour, masks; choose from mask, albedo, exponent"
    with pytest.raises(argparse.ArgumentTypeError, match=expected):
        parse("colour,mask,masks")


def test_a_folder_to_write_to_need_not_exist(tmp_path):
    for name in ("", "new", "new/deep", "v1.2", "run.2026"):
        console.check_folder(tmp_path / name, "--out")
    (tmp_path / "kept.json").mkdir()
    console.check_folder(tmp_path / "kept.json", "--out")
    assert [path.name for path in tmp_path.iterdir()] == ["kept.json"]


@pytest.mark.parametrize("name", ["file", "file/in", "file/in/it", "link"])
def test_a_file_is_no_folder_to_write_to(name, tmp_path):
    (tmp_path / "file").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "away")
    named = tmp_path / name.partition("/")[0]
    with pytest.raises(ValueError, match=f"{named} is a file, and --out is a folder: pass"):
        console.check_folder(tmp_path / name, "--out")
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("name", ["result.json", "sheet.PNG", "new/lime.onnx"])
def test_a_files_name_is_no_folders(name, tmp_path):
    said = f"{tmp_path / name} is named like a file, and OUT is a folder: pass {tmp_path}"
    with pytest.raises(ValueError, match=said):
        console.check_folder(tmp_path / name, "OUT")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_to_is_told(tmp_path, monkeypatch):
    # The user who runs the tests may write everywhere.
    monkeypatch.setattr(os, "access", lambda path, mode: path != tmp_path)
    with pytest.raises(ValueError, match=f"{tmp_path} cannot be written to: pass another"):
        console.check_folder(tmp_path / "new", "--out")


COMMANDS = {
    "lime_keras.commands.estimate": ["{photo}", "--out", "{out}"],
    "lime_keras.commands.export": ["{out}", "--format", "onnx"],
    "lime_keras.train.cli": ["{photo}", "--out", "{out}", "--preset", "smoke"],
    "lime_keras.eval.cli": ["--stability", "--out", "{out}"],
    "lime_keras.render.cli": ["{out}", "--split", "test", "--count", "1"],
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("out", ["photo.png", "result.json"])
def test_every_command_refuses_a_file_for_its_folder(name, out, tmp_path, capsys, monkeypatch):
    """Before it imports, reads or writes anything."""
    (tmp_path / "photo.png").write_text("no photo")
    places = {"photo": tmp_path / "photo.png", "out": tmp_path / out}
    monkeypatch.setattr(console, "require", None)
    monkeypatch.setattr(console, "import_tensorflow", None)
    arguments = [argument.format(**places) for argument in COMMANDS[name]]
    assert importlib.import_module(name).main(arguments) == 1
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith(f"error: {tmp_path / out} is ")
    assert "is a folder: pass" in told.err and told.err.count("\n") == 1
    assert (tmp_path / "photo.png").read_text() == "no photo"


def test_a_bar_appears_with_the_first_news_and_ends_with_the_last(capsys):
    with console.Bar("rooms", "room"):
        pass
    assert capsys.readouterr().err == ""
    with console.Bar("rooms", "room") as bar:
        bar.move(12, 40)
        bar.move(40, 40, {"loss": "0.3"})
        told = capsys.readouterr().err
        assert "rooms:  30%" in told
        assert "40/40" in told and "loss=0.3" in told and told.endswith("\n")
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("missing", "told"),
    [
        (["keras"], "needs keras: pip install '.[train]' in the folder of the project"),
        (["onnx"], "needs onnx: pip install '.[train]'"),
        (["keras", "onnx"], "needs keras, onnx: pip install '.[train]'"),
        (["keras", "scipy"], "needs keras, scipy: pip install '.[train,render]'"),
    ],
)
def test_a_missing_extra_is_told_with_the_command_that_installs_it(missing, told, without, capsys):
    console.require("lime-some", "keras", "onnx", "scipy")
    without(*missing)
    needs = functools.partial(console.require, "lime-some", "keras", "onnx", "scipy")
    with pytest.raises(console.MissingExtra):
        needs()
    assert console.run(needs, "nothing lost") == 1
    assert capsys.readouterr().err.startswith(f"error: lime-some {told}")


def test_what_is_required_is_not_imported(tmp_path, monkeypatch):
    (tmp_path / "never_imported.py").write_text("raise SystemExit")
    monkeypatch.syspath_prepend(tmp_path)
    console.require("lime-some", "never_imported")


def test_tensorflow_that_is_missing_is_told(without):
    without("tensorflow")
    with pytest.raises(console.MissingExtra, match=r"needs tensorflow: pip .*\[train\]"):
        console.import_tensorflow()


def test_standard_error_is_closed_for_a_while(capfd):
    os.write(2, b"before ")
    with console.standard_error_closed():
        os.write(2, b"during ")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before after"


def test_standard_error_comes_back_after_an_error(capfd):
    with pytest.raises(ImportError), console.standard_error_closed():
        raise ImportError
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


def test_tensorflow_is_imported_quietly(capfd):
    descriptors = len(os.listdir("/dev/fd"))
    console.import_tensorflow()
    assert capfd.readouterr() == ("", "")
    assert len(os.listdir("/dev/fd")) <= descriptors + 1


def test_a_help_has_paragraphs_as_wide_as_the_terminal_and_examples_as_written(monkeypatch):
    monkeypatch.setenv("COLUMNS", "42")
    words = "one two three four five six seven eight nine ten eleven to OUT/NAME-layer.exr"
    example = "  lime-some with an example that is wider than the terminal"
    parser = argparse.ArgumentParser(
        description=words, epilog=f"{words}\n{words}\n\n{example}", formatter_class=console.Help
    )
    lines = parser.format_help().splitlines()
    assert example in lines and "" in lines
    told = [line for line in lines[lines.index("options:") :] if "one" in line or "NAME" in line]
    assert max(map(len, told)) <= 40 and any("OUT/NAME-layer.exr" in line for line in told)
    prose = " ".join(lines[lines.index(example) - 6 : lines.index(example)])
    assert prose.split() == (words + " " + words).split()


def test_a_bar_in_a_log_file_is_a_few_lines(monkeypatch):
    log = io.StringIO()
    monkeypatch.setattr("sys.stderr", log)
    with console.Bar("render", "example") as bar:
        for done in range(500):
            bar.move(done, 500)
        bar.move(500, 500)
    lines = log.getvalue().splitlines()
    assert "\r" not in log.getvalue() and 1 <= len(lines) <= 3
    assert "500/500" in lines[-1] and len(log.getvalue()) < 400
