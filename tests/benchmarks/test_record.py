"""The files of figures: how a figure is written, and when a file no longer fits."""

import json
import subprocess
import sys

import pytest
import record
import results

SHARE = record.Figure(0.4812, (0.45, 0.51), 640)


@pytest.mark.parametrize(
    ("form", "text"),
    [
        (".1%", "48.1 %"),
        (".1%±", "48.1 ± 3.0 %"),
        (".0%[]", "48 % [45, 51]"),
        (".3f", "0.481"),
        (".2f±", "0.48 ± 0.03"),
        (".1f[]", "0.5 [0.5, 0.5]"),
    ],
)
def test_a_figure_is_written_with_its_interval(form, text):
    assert format(SHARE, form) == text
    plain = form.removesuffix("±").removesuffix("[]")
    assert format(record.Figure(0.4812), form) == format(SHARE, plain), "without an interval"


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Return a folder of data with a corpus, and the content of a file measured on it."""
    (tmp_path / "corpus" / "test").mkdir(parents=True)
    (tmp_path / "corpus" / "test" / "manifest.json").write_text("{}", encoding="utf-8")
    monkeypatch.setattr(record, "FOLDER", tmp_path / "results")
    script = record.ROOT / "benchmarks" / "photographs.py"
    monkeypatch.setattr(sys, "argv", [str(script), "corpus", "--weights", "live"])
    monkeypatch.chdir(tmp_path)
    figures = {"live": {"share": SHARE, "unknown": record.Figure(float("nan"))}}
    path = record.write(
        "mine", figures, code=results.code(script), weights=["live"], corpus=tmp_path / "corpus"
    )
    return tmp_path, record.read(path)


def test_a_file_is_read_as_it_was_written(written):
    _, content = written
    assert content["figures"] == {"live": {"share": SHARE}}
    assert content["command"] == "python benchmarks/photographs.py corpus --weights live"
    assert content["commit"] and content["machine"]["packages"]["numpy"]


def test_a_file_is_measured_again_for_its_code_weights_or_corpus(written):
    data, content = written
    assert list(results.differences(content, data)) == []
    for change in ({"code": content["code"] - 1}, {"weights": {"live": "0"}}, {"corpus": "0"}):
        assert len(list(results.differences(content | change, data))) == 1, change
    (data / "corpus" / "test" / "manifest.json").write_text('{"seed": 1}', encoding="utf-8")
    assert list(results.differences(content, data)) == ["corpus is another corpus"]
    assert list(results.differences(content, data / "elsewhere")) == [], "it is not there"


def test_what_is_stopped_goes_on_with_the_files_that_are_left(written, monkeypatch, capsys):
    data, content = written
    stale = json.loads((data / "results" / "mine.json").read_text(encoding="utf-8"))
    for name in ("a", "b", "c"):
        text = json.dumps(stale | {"code": 0, "command": f"{content['command']} --record {name}"})
        (data / "results" / f"{name}.json").write_text(text, encoding="utf-8")
    ran = []

    def measure(command, cwd):
        ran.append(command[-1])
        if len(ran) == 2:
            raise KeyboardInterrupt
        (data / "results" / f"{command[-1]}.json").write_text(json.dumps(stale), encoding="utf-8")
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr(results.subprocess, "run", measure)
    monkeypatch.setattr(sys, "argv", ["results.py", str(data)])
    with pytest.raises(KeyboardInterrupt):
        results.main()
    assert results.main() == 0
    assert ran == ["a", "b", "b", "c"]
    assert "mine" in capsys.readouterr().out


def test_figures_that_were_just_measured_do_not_make_the_next_ones_dirty(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "ROOT", tmp_path)
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(tmp_path)]
    figures, code = tmp_path / "docs" / "results" / "one.json", tmp_path / "code.py"
    figures.parent.mkdir(parents=True)
    figures.write_text("{}", encoding="utf-8")
    code.write_text("1", encoding="utf-8")
    for command in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "first"]):
        subprocess.run([*git, *command], check=True)
    clean = record._commit()
    assert clean and not clean.endswith("-dirty")
    figures.write_text("[]", encoding="utf-8")
    assert record._commit() == clean
    code.write_text("2", encoding="utf-8")
    assert record._commit() == f"{clean}-dirty"
