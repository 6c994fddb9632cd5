"""The command `lime-eval --photos`, from a folder of photos to its files."""

import csv
import json
import subprocess
import sys

import numpy as np
import photo_answers
import pytest

from lime_keras.eval import cli, sections

FILES = ["photos.csv", "photos.json", "report.html", "sections"]


@pytest.fixture
def photos(tmp_path):
    """A glossy photo (much green), with its mask; a matte one; and one whose answer is NaN."""
    folder = tmp_path / "photos"
    photo_answers.write(folder / "cup.png", [153, 204, 102], mask=photo_answers.disc(8))
    photo_answers.write(folder / "deep" / "cloth.png", [102, 51, 77])
    photo_answers.write(folder / "red.png", [204, 0, 0])
    text = "photo,finish,dielectric\ncup.png,glossy,1\ndeep/cloth.png,matte,\nred.png,matte,1\n"
    (folder / "labels.csv").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def models(monkeypatch):
    engines = {
        **dict.fromkeys(("best", "live"), photo_answers.Engine(specular=0.4)),
        "natural": photo_answers.Engine(specular=0.04, red=0.05, sharper=1),
    }
    photo_answers.install(monkeypatch, engines)


def test_the_files_of_the_package_model(photos, models, tmp_path, capsys):
    out = tmp_path / "deep" / "out"
    assert cli.main(["--photos", str(photos), "--out", str(out)]) == 0
    told = capsys.readouterr()
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert "Gloss order (AUC) by log10 s" in told.out and "deep/cloth.png" in told.out
    assert "estimating: 100%" in told.err and f"wrote {out / 'report.html'}" in told.err
    found = json.loads((out / "photos.json").read_text(encoding="utf-8"))
    own, given = found["columns"]
    assert (own["model"], own["mask"], given["mask"]) == ("best", "own mask", "given mask")
    # Cloth is put right, and the photo that has no answer counts as a tie.
    assert own["measures"]["gloss_order_exponent"]["value"] == 0.75
    assert own["measures"]["specular_ratio"]["value"] == pytest.approx(10)
    assert own["measures"]["specular_within_2"]["value"] == 0
    assert own["measures"]["unanswered"]["value"] == pytest.approx(1 / 3)
    assert own["measures"]["iou"]["value"] == pytest.approx((8 / 12) ** 2, abs=0.08)
    with (out / "photos.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["photo"] for row in rows] == ["cup.png", "cup.png", "deep/cloth.png", "red.png"]
    assert [row["mask"] for row in rows] == ["own mask", "given mask", "own mask", "own mask"]
    assert float(rows[0]["specular_albedo"]) == pytest.approx(0.4) and rows[3]["exponent"] == ""
    assert rows[0]["finish"] == "glossy" and float(rows[0]["diffuse_albedo_1"]) > 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert 'id="photos"' in page and "deep/cloth.png" in page and "--photos" in page


def test_models_of_two_runs_stand_side_by_side(photos, models, tmp_path, capsys):
    out = tmp_path / "out"
    runs = [str(tmp_path / name) for name in ("live", "natural")]
    assert cli.main(["--photos", str(photos), "--weights", *runs, "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == FILES
    found = json.loads((out / "photos.json").read_text(encoding="utf-8"))
    value = {
        (one["model"], one["mask"]): one["measures"]["specular_within_2"]["value"]
        for one in found["columns"]
    }
    assert value == {
        ("live", "own mask"): 0,
        ("live", "given mask"): 0,
        ("natural", "own mask"): 1,
        ("natural", "given mask"): 1,
    }
    assert "natural, given mask" in capsys.readouterr().out
    # Repeated options add up.
    twice = [part for run in runs for part in ("--weights", run)]
    assert (
        cli.parser().parse_args(twice).weights
        == cli.parser().parse_args(["--weights", *runs]).weights
    )


def test_the_results_lie_beside_the_only_run(photos, models, tmp_path):
    run = tmp_path / "natural"
    assert cli.main(["--photos", str(photos), "--weights", str(run)]) == 0
    assert (run / "eval" / "photos.json").is_file()


def test_the_results_of_several_models_lie_in_the_folder_results(
    photos, models, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["--photos", str(photos), "--weights", "live", "natural"]) == 0
    assert (tmp_path / "results" / "photos.json").is_file()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--photos", "p", "--weights", "a", "b", "--stability", "--out", "o"], "--photos alone"),
        (["c", "--weights", "a", "b", "--out", "o"], "pass them to --table1"),
        (["c", "--photos", "p", "--out", "o"], "a CORPUS takes --weights"),
        (["--weights", "a", "--out", "o"], "it comes before the options"),
        ([], "--photos"),
    ],
)
def test_options_that_do_not_go_together(arguments, told, capsys):
    with pytest.raises(SystemExit) as stopped:
        cli.main(arguments)
    assert stopped.value.code == 2 and told in capsys.readouterr().err


def test_errors_are_one_line(photos, models, tmp_path, capsys):
    (photos / "labels.csv").write_text("photo,finish\nlost.png,matte\n", encoding="utf-8")
    out = tmp_path / "out"
    assert cli.main(["--photos", str(photos), "--out", str(out)]) == 1
    assert "there is no photo lost.png" in capsys.readouterr().err
    assert cli.main(["--photos", str(tmp_path / "none"), "--out", str(out)]) == 1
    assert "none is no folder" in capsys.readouterr().err
    assert not out.exists()


def test_photos_are_evaluated_without_tensorflow(photos, tmp_path):
    """With the model that comes with the package."""
    code = (
        "import sys\n"
        "sys.modules |= {name: None for name in ('tensorflow', 'keras', 'mitsuba', 'matplotlib')}\n"
        "from lime_keras.eval import cli\n"
        f"sys.exit(cli.main(['--photos', {str(photos)!r}, '--out', {str(tmp_path / 'out')!r}]))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    rows = json.loads((tmp_path / "out" / "photos.json").read_text(encoding="utf-8"))["photos"]
    assert len(rows) == 4 and all(1 <= row["exponent"] <= 1000 for row in rows)
    assert all(np.all(np.isfinite(row["diffuse_albedo"])) for row in rows)


def test_runs_of_one_name_are_told_by_their_parents(tmp_path):
    runs = [tmp_path / "a" / "live", tmp_path / "b" / "live", tmp_path / "b" / "nano"]
    assert list(sections.names(runs)) == ["a-live", "b-live", "nano"]
    assert list(sections.names(runs[:1])) == ["live"]
    for same in ([runs[0], runs[0]], [runs[0], tmp_path / "c" / "a" / "live"]):
        with pytest.raises(ValueError, match="rename a folder of"):
            sections.names(same)
