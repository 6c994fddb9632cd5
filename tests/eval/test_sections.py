"""Several runs side by side, and several parts in one report."""

import csv
import json
import shutil

import pytest
import sphere_corpus
import trade

from lime_keras.eval import cli
from lime_keras.eval.tradeoff import measure, recommendation, table


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(tmp_path_factory.mktemp("corpus"), "test", [range(4)], size=32)


@pytest.fixture(scope="module")
def runs(tiny_model, tmp_path_factory):
    """The same weights twice, told apart by what the record says of their training."""
    folder = tmp_path_factory.mktemp("runs")
    for name, compositing in (("whole", True), ("bare", False)):
        shutil.copytree(tiny_model, folder / name / "model")
        record = {"config": {"compositing": compositing}}
        (folder / name / "config.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def compared(corpus, runs, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    arguments = [str(corpus), "--table1", str(runs / "bare"), str(runs / "whole")]
    assert cli.main([*arguments, "--out", str(out)]) == 0
    return out


def test_runs_stand_side_by_side(compared):
    found = json.loads((compared / "comparison.json").read_text(encoding="utf-8"))
    assert list(found["runs"]) == ["whole", "bare"] and found["reference"] == "whole"
    assert found["count"] == 4 and not found["camera"]
    same = [found["runs"][name]["value"] for name in ("whole", "bare")]
    assert same[0] == same[1]
    text = (compared / "comparison.md").read_text(encoding="utf-8")
    assert "bare: without perceptual loss" in text and "whole: full approach" in text
    assert "45.07 %" in text
    assert (compared / "confusions.png").stat().st_size > 10_000


def test_one_report_gathers_what_each_command_made(compared, corpus, runs, capsys):
    page = (compared / "report.html").read_text(encoding="utf-8")
    assert 'id="comparison"' in page and 'id="evaluation"' not in page and "<nav" not in page
    command = [str(corpus), "--weights", str(runs / "whole"), "--out", str(compared)]
    assert cli.main(command) == 0
    assert "evaluate:" not in capsys.readouterr().err, "what was measured is kept"
    page = (compared / "report.html").read_text(encoding="utf-8")
    assert page.index('id="evaluation"') < page.index('id="comparison"')
    assert '<a href="#comparison">Table 1</a>' in page
    with (compared / "images.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["index"] for row in rows] == ["0", "1", "2", "3"]
    assert rows[0]["shape"] == "sphere" and float(rows[3]["diffuse_found_2"]) >= 0


def test_the_trade_leaves_its_table_and_its_picture(corpus, runs, tmp_path, monkeypatch):
    shared = recommendation.scored([row["errors"] for row in trade.ROWS])
    measured = {"rows": trade.ROWS, "scored": shared, "machine": {"cores": 2}}
    monkeypatch.setattr(measure, "measure", lambda *_, **__: measured)
    monkeypatch.setattr(table, "markdown", lambda result: "| a |\n|---|\n| b |\n")
    arguments = [str(corpus), "--tradeoff", str(runs / "whole"), "--out", str(tmp_path)]
    assert cli.main(arguments) == 0
    assert (tmp_path / "pareto.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "tradeoff.json").read_text())["scored"] == list(shared)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'id="tradeoff"' in page and "errors against latency" in page
