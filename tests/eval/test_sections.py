"""Several runs side by side, and several parts in one report."""

import csv
import json
import re
import shutil
from pathlib import Path

import answer_files
import json_files
import pytest
import trade

from lime_keras.eval import cli
from lime_keras.eval.tradeoff import measure, recommendation, table
from lime_keras.render.inspect import images

pytestmark = pytest.mark.usefixtures("engines_opened_once")
BENCHMARK = Path(__file__).parents[2] / "docs" / "reference" / "benchmark.md"


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
    # Neither is the full approach, so they stay in the order that they were given in.
    assert list(found["runs"]) == ["bare", "whole"] and found["reference"] == "bare"
    assert found["count"] == 4 and not found["camera"]
    same = [found["runs"][name]["value"] for name in ("whole", "bare")]
    assert same[0] == same[1]
    text = (compared / "comparison.md").read_text(encoding="utf-8")
    # Named by their records, never after a row of the paper.
    assert "bare: another recipe, without perceptual loss" in text
    assert "whole: another recipe " in text
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
    shared = recommendation.SCORED
    measured = {"rows": trade.ROWS, "scored": shared, "machine": {"cores": 2}}
    monkeypatch.setattr(measure, "measure", lambda *_, **__: measured)
    monkeypatch.setattr(table, "markdown", lambda result: "| a |\n|---|\n| b |\n")
    arguments = [str(corpus), "--tradeoff", str(runs / "whole"), "--out", str(tmp_path)]
    assert cli.main(arguments) == 0
    assert (tmp_path / "pareto.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "tradeoff.json").read_text())["scored"] == list(shared)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'id="tradeoff"' in page and "errors against time" in page


@pytest.fixture(scope="module")
def answers(corpus, tiny_model, tmp_path_factory):
    return answer_files.write(tmp_path_factory.mktemp("answers") / "net", tiny_model, corpus)


def test_answers_stand_beside_the_run_that_is_measured(corpus, runs, answers, tmp_path, capsys):
    given = ["--weights", runs / "whole", "--predictions", answers, "--out", tmp_path]
    assert cli.main([str(corpus), *map(str, given)]) == 0
    compared = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert list(compared["runs"]) == ["whole", "net"] and compared["reference"] == "whole"
    run, net = (compared["runs"][name]["value"] for name in ("whole", "net"))
    assert net.keys() == run.keys()
    assert net == pytest.approx(run, rel=2e-3)
    text = (tmp_path / "comparison.md").read_text(encoding="utf-8")
    assert "net: another system" in text and text in capsys.readouterr().out
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.index('id="evaluation"') < page.index('id="comparison"')
    assert "net: another system" in page


@pytest.mark.slow
def test_answers_stand_beside_the_runs_of_table_1_and_other_answers(
    corpus, runs, answers, tmp_path
):
    other = shutil.copytree(answers, tmp_path / "masks")
    for path in other.iterdir():
        if path.name != "00001-mask.png":
            path.unlink()
    given = ["--predictions", answers, other, "--table1", runs / "whole", "--out", tmp_path / "out"]
    assert cli.main([str(corpus), *map(str, given)]) == 0
    text = (tmp_path / "out" / "comparison.md").read_text(encoding="utf-8")
    assert not (tmp_path / "out" / "metrics.json").exists()
    named = [line.split(" | ")[0].strip("| ") for line in text.splitlines() if line[0:1] == "|"]
    ours = [name for name in named[2:] if not name.startswith("the paper's")]
    last = "masks: another system, 1 of 4 images answered"
    assert ours == ["whole: another recipe", "net: another system", last]


def test_answers_alone_need_no_weights(corpus, answers, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("lime_keras.model.weights.load", None)
    copy = shutil.copytree(answers, tmp_path / "copy")
    (copy / "00000-preview.png").write_bytes(b"")
    command = [str(corpus), "--predictions", str(copy), "--out", str(tmp_path / "out")]
    assert cli.main(command) == 0
    told = capsys.readouterr()
    assert f"warning: {copy}: left out what is named like no answer: 00000-preview.png;" in told.err
    assert "evaluate:" in told.err and "copy: another system" in told.out
    assert cli.main(command) == 0
    assert "evaluate:" not in capsys.readouterr().err, "what was measured is kept"
    with json_files.edited(copy / "00002.json") as held:
        held["exponent"] = 999.0
    assert cli.main(command) == 0
    assert "evaluate:" in capsys.readouterr().err, "the answers have changed"
    (copy / "00003-mask.png").unlink()
    assert cli.main(command) == 0
    assert "evaluate:" in capsys.readouterr().err, "an answer is gone"


def test_masks_alone_make_a_table_without_a_picture(corpus, answers, tmp_path, capsys):
    masks = tmp_path / "masks"
    masks.mkdir()
    for path in answers.glob("*-mask.png"):
        shutil.copyfile(path, masks / path.name)
    out = tmp_path / "out"
    assert cli.main([str(corpus), "--predictions", str(masks), "--out", str(out)]) == 0
    assert "mask IoU" in capsys.readouterr().out
    assert not (out / "confusions.png").exists()
    assert 'id="comparison"' in (out / "report.html").read_text(encoding="utf-8")


def test_broken_answers_are_told_in_one_line(corpus, answers, tmp_path, capsys):
    copy = shutil.copytree(answers, tmp_path / "copy")
    (copy / "00002.json").write_text("{", encoding="utf-8")
    command = [str(corpus), "--predictions", str(copy), "--out", str(tmp_path / "out")]
    assert cli.main(command) == 1
    told = capsys.readouterr()
    assert not told.out and "Traceback" not in told.err
    assert f"error: {copy / '00002.json'} cannot be read as an answer" in told.err


def test_the_example_of_the_benchmark_is_measured(corpus, tmp_path, monkeypatch):
    """It answers with a disc, and the objects are spheres in the middle."""
    monkeypatch.chdir(tmp_path)
    images.write(corpus, tmp_path / "images", lambda done, total: None)
    [code] = re.findall(r"```python\n(.*?)```", BENCHMARK.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(code, "example", "exec"), {})
    assert cli.main([str(corpus), "--predictions", "answers", "--out", "out"]) == 0
    compared = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))
    value = compared["runs"]["answers"]["value"]
    assert value["mask_iou"] > 0.7 and 0 < value["specular_shading_relative"] < 2
    assert "mirror_relative" not in value and "relighting_psnr" in value
