"""Answers in files: as good as the model that gave them, and none of them taken on trust."""

import json
import os
import re
import shutil

import answer_files
import json_files
import lying_headers
import numpy as np
import pytest
import sphere_corpus

from lime_keras.eval.accuracy import measures
from lime_keras.eval.accuracy.evaluate import evaluate, evaluate_predictions
from lime_keras.eval.accuracy.predictions import Answers, find
from lime_keras.io import photo

COUNT, SIZE = 5, 32


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus")
    return sphere_corpus.write_split(folder, "test", [range(3), range(3, COUNT)], size=SIZE)


@pytest.fixture(scope="module")
def written(corpus, tiny_model, tmp_path_factory):
    return answer_files.write(tmp_path_factory.mktemp("of") / "model", tiny_model, corpus)


@pytest.fixture(scope="module")
def whole(written, corpus):
    return evaluate_predictions(find(written), corpus)


@pytest.fixture
def answers(written, tmp_path):
    """A copy of the answers, to be changed."""
    return shutil.copytree(written, tmp_path / "answers")


def _same(found, expected, name):
    if expected.dtype.kind == "f":
        # The layers' files hold half floats, the JSON six digits.
        assert found == pytest.approx(expected, rel=2e-3, abs=1e-5), name
    else:
        assert np.array_equal(found, expected), name


def test_answers_in_files_are_measured_as_the_model_that_gave_them(whole, corpus, tiny_model):
    rows = evaluate(tiny_model, corpus).rows
    assert whole.keys() - {"answered"} == rows.keys()
    assert whole["answered"].tolist() == [True] * COUNT
    for name, column in rows.items():
        _same(whole[name], column, name)
    # The masks are the same pixels, or all of this would say little.
    assert 0 < rows["iou"].min() and np.array_equal(whole["iou"], rows["iou"])
    assert measures.values(whole).keys() == measures.values(rows).keys()


def test_a_regressed_exponent_is_measured_as_the_model_that_gave_it(
    ablation, ablation_model, corpus, tmp_path
):
    if ablation.exponent != "regression":
        pytest.skip("has classes")
    folder = answer_files.write(tmp_path / "answers", ablation_model, corpus)
    found = evaluate_predictions(find(folder), corpus)
    rows = evaluate(ablation_model, corpus).rows
    assert found.keys() - {"answered"} == rows.keys()
    for name, column in rows.items():
        _same(found[name], column, name)


def test_an_image_without_an_answer_counts(answers, corpus, whole):
    """As no object, a black layer, and the medians of the split."""
    for path in answers.glob("00001*"):
        path.unlink()
    rows = evaluate_predictions(find(answers), corpus)
    assert rows["answered"].tolist() == [True, False, True, True, True]
    others = [0, 2, 3, 4]
    for name, column in whole.items():
        assert np.array_equal(rows[name][others], column[others]), name
    assert rows["iou"][1] == rows["intersection"][1] == 0
    assert rows["union"][1] == rows["coverage"][1] * SIZE**2 > 0
    assert rows["specular_shading_relative"][1] == rows["mirror_relative"][1] == 1
    diffuse, specular = rows["diffuse_albedo"], rows["specular_albedo"]
    assert rows["diffuse_found"][1] == pytest.approx(np.median(diffuse, axis=0))
    assert rows["diffuse_absolute"][1] == pytest.approx(
        np.abs(diffuse[1] - np.median(diffuse, axis=0)).mean()
    )
    assert rows["specular_absolute"][1] == pytest.approx(abs(specular[1] - np.median(specular)))
    log = rows["log_exponent"]
    assert rows["log_error"][1] == pytest.approx(abs(log[1] - np.median(log)))
    shares = np.bincount(rows["bin"], minlength=8) / COUNT
    assert rows["bin_probabilities"][1] == pytest.approx(shares)
    assert rows["predicted_bin"][1] == np.argmax(shares)
    assert rows["relit"][1] < whole["relit"].max()
    lost = measures.values(whole)["mask_iou"] - measures.values(rows)["mask_iou"]
    assert lost == pytest.approx(whole["iou"][1] / COUNT) and lost > 0


def test_answers_for_no_image_reach_the_best_constant(corpus, whole, tmp_path):
    """One image is answered by that constant, the others not at all."""
    log = whole["log_exponent"]
    numbers = {
        "diffuse_albedo": np.median(whole["diffuse_albedo"], axis=0).tolist(),
        "specular_albedo": float(np.median(whole["specular_albedo"])),
        "exponent": float(10 ** np.median(log)),
    }
    (tmp_path / "00003.json").write_text(json.dumps(numbers), encoding="utf-8")
    rows = evaluate_predictions(find(tmp_path), corpus)
    found, constant = measures.values(rows), measures.constant_answers(rows)
    for name in ("log_exponent_mae", "diffuse_albedo_mae", "specular_albedo_mae"):
        assert found[name] == pytest.approx(constant[name], rel=1e-5)


@pytest.mark.parametrize(
    "kept, columns",
    [
        (["specular_albedo"], {"specular_albedo_mae", "specular_albedo_rmse"}),
        (["diffuse_albedo"], {"diffuse_albedo_mae", "diffuse_albedo_rmse"}),
        (
            ["exponent"],
            {
                *("exponent_exact", "exponent_adjacent", "exponent_within_one"),
                *("log_exponent_mae", "log_exponent_rmse", "log_exponent_bias", "ggx_alpha_mae"),
            },
        ),
        (["-mask.png"], {"mask_iou", "mask_iou_pooled"}),
        (["-mirror.exr"], {"mirror_relative", "mirror_flip"}),
    ],
)
def test_a_quantity_that_is_never_answered_has_no_measure(kept, columns, answers, corpus, whole):
    for path in answers.iterdir():
        if path.suffix == ".json":
            held = json.loads(path.read_text(encoding="utf-8"))
            path.write_text(json.dumps({name: held[name] for name in held if name in kept}))
        elif not path.name.endswith(tuple(kept)):
            path.unlink()
    rows = evaluate_predictions(find(answers), corpus)
    found, all_found = measures.values(rows), measures.values(whole)
    assert set(found) == columns
    for name in columns - {"exponent_exact", "exponent_adjacent", "exponent_within_one"}:
        assert found[name] == pytest.approx(all_found[name], rel=1e-5), name
    assert rows.keys() >= {"seed", "bin", "answered"}


def test_probabilities_decide_the_bin_and_the_exponent_its_error(answers, corpus, whole):
    with json_files.edited(answers / "00002.json") as held:
        held["exponent"] = 1000
    rows = evaluate_predictions(find(answers), corpus)
    assert rows["log_error"][2] == pytest.approx(abs(3 - whole["log_exponent"][2]), rel=1e-6)
    assert np.array_equal(rows["predicted_bin"], whole["predicted_bin"])
    assert np.array_equal(rows["log_error_winning"], whole["log_error_winning"])


def test_what_an_answer_leaves_out_of_s_follows_from_the_rest(answers, corpus):
    """Some images have s and probabilities, one s alone, one probabilities alone."""
    with json_files.edited(answers / "00001.json") as held:
        del held["exponent_bin_probabilities"]
        held["exponent"] = 300
    with json_files.edited(answers / "00002.json") as held:
        del held["exponent"]
        held["exponent_bin_probabilities"] = [0, 0, 0, 0, 0, 0, 0, 1]
    rows = evaluate_predictions(find(answers), corpus)
    assert rows["predicted_bin"][1:3].tolist() == [6, 7]
    assert rows["log_error"][2] == pytest.approx(abs(2.8125 - rows["log_exponent"][2]), abs=1e-3)


def test_the_answer_without_an_object_of_lime_estimate_is_taken(answers, corpus):
    numbers = {"photo": "x.png", "mask_coverage": 0.0, "warnings": [], "files": [], "made": {}}
    for position in (0, 1):
        (answers / f"0000{position}.json").write_text(json.dumps(numbers), encoding="utf-8")
        photo.write(answers / f"0000{position}-mask.png", np.zeros((SIZE, SIZE, 1)))
    rows = evaluate_predictions(find(answers), corpus)
    assert rows["iou"][:2].tolist() == [0, 0] and rows["answered"].all()
    assert rows["diffuse_found"][0] == pytest.approx(rows["diffuse_found"][1])


@pytest.mark.parametrize(
    "changes, told",
    [
        ({"diffuse_albedo": [0.1, 0.2, 1.01]}, r"diffuse_albedo is \[0.1, 0.2, 1.01\], and not 3"),
        ({"diffuse_albedo": [0.1, 0.2]}, r"and not 3 numbers in \[0, 1\]: clip it"),
        ({"diffuse_albedo": 0.5}, "diffuse_albedo is 0.5, and not 3 numbers"),
        ({"specular_albedo": -0.1}, r"specular_albedo is -0.1, and not a number in \[0, 1\]"),
        ({"specular_albedo": float("nan")}, "specular_albedo is NaN, and not a number"),
        ({"specular_albedo": [0.5]}, r"specular_albedo is \[0.5\], and not a number"),
        ({"specular_albedo": "0.5"}, 'specular_albedo is "0.5", and not a number'),
        ({"specular_albedo": True}, "specular_albedo is true, and not a number"),
        ({"exponent": 0.5}, r"exponent is 0.5, and not a number in \[1, 1000\]: clip it, or leave"),
        ({"exponent": 10**400}, "exponent is 10{59}, and not a number"),
        ({"exponent": float("inf")}, "exponent is Infinity, and not a number"),
        ({"exponent_bin_probabilities": [0.125] * 7}, "and not 8 numbers"),
        ({"exponent_bin_probabilities": [0.1] * 8}, "sum to 0.8: divide them by their sum"),
        ({"diffuse_albedo": [[0.1, 0.2, 0.3]] * 3}, r"and not 3 numbers"),
    ],
)
def test_numbers_that_are_none_are_named(changes, told, answers):
    path = answers / "00002.json"
    with json_files.edited(path) as held:
        held.update(changes)
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))}: .*{told}"):
        Answers(find(answers), COUNT, SIZE, {})


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b"[" * 100_000, b"9" * 9999])
def test_what_is_no_json_is_named(content, answers):
    path = answers / "00002.json"
    path.write_bytes(content)
    with pytest.raises(
        ValueError, match=rf"^{re.escape(str(path))} cannot be read as an answer: .*; write one"
    ):
        Answers(find(answers), COUNT, SIZE, {})


def _layer(values, size=SIZE, channels=1):
    return np.full((size, size, channels), values, np.float32)


@pytest.mark.parametrize(
    "name, pixels, told",
    [
        ("00003-mask.png", _layer(1, 2 * SIZE), "has 64×64 pixels and its photo 32×32"),
        ("00003-mirror.exr", _layer(1, 2 * SIZE), "has 64×64 pixels and its photo 32×32"),
        ("00003-mirror.exr", _layer(np.nan), "holds NaN or infinite pixels"),
        ("00003-specular_shading.exr", _layer(np.inf), "holds NaN or infinite pixels"),
        ("00003-specular_shading.exr", _layer(-1), "holds -1: radiance is at least 0"),
        ("00003-mirror.exr", _layer(1, SIZE, 3), "has 3 channels: a grey layer has one"),
    ],
)
def test_layers_that_are_none_are_named(name, pixels, told, answers, corpus):
    path = answers / name
    photo.write(path, pixels)
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))} .*{told}"):
        evaluate_predictions(find(answers), corpus)


def test_a_layer_that_is_no_picture_or_announces_a_huge_one_is_named(answers, corpus):
    path = answers / "00003-mirror.exr"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match=r"00003-mirror\.exr cannot be read as a picture"):
        evaluate_predictions(find(answers), corpus)
    lying_headers.exr(path, 12_000, 12_000)
    with pytest.raises(ValueError, match=r"00003-mirror\.exr has 12000×12000 pixels, more than"):
        evaluate_predictions(find(answers), corpus)


def test_the_brightest_layers_are_measured(answers, corpus):
    for path in answers.glob("*.exr"):
        photo.write(path, _layer(65504))
    rows = evaluate_predictions(find(answers), corpus)
    for name in ("mirror_relative", "mirror_flip", "specular_shading_flip"):
        assert np.isfinite(rows[name]).all(), name


def test_an_answer_beyond_the_split_is_named(answers, corpus):
    (answers / "00005.json").write_text("{}", encoding="utf-8")
    told = r"00005\.json answers no image: the split has 5, from 00000 to 00004; pass"
    with pytest.raises(ValueError, match=told):
        evaluate_predictions(find(answers), corpus)


def test_files_that_match_no_image_are_told(answers):
    assert find(answers).warning() is None
    strangers = (
        "00000-preview.png",
        "12.json",
        "000003.json",
        "00001-mirror.png",
        "00001-mask.exr",
    )
    for name in (*strangers, ".DS_Store"):
        (answers / name).write_text("")
    (answers / "older").mkdir()
    found = find(answers)
    assert found.left_out == sorted([*strangers, "older"])
    assert len(found.files) == 4 * COUNT
    assert found.warning() == (
        f"{answers}: left out what is named like no answer: 00000-preview.png, 000003.json, "
        "00001-mask.exr and 3 more; answers are called 00000.json, 00000-mask.png, "
        "00000-specular_shading.exr, 00000-mirror.exr"
    )


def test_a_folder_without_answers_is_named(tmp_path, corpus):
    with pytest.raises(ValueError, match="gone is no folder: pass a folder of answers to"):
        find(tmp_path / "gone")
    (tmp_path / "0.json").write_text("{}", encoding="utf-8")
    with pytest.raises(ValueError, match=r"holds no answer: name the files .* 00000\.json, "):
        find(tmp_path)
    (tmp_path / "00000.json").write_text('{"albedo": 1}', encoding="utf-8")
    with pytest.raises(ValueError, match="answers nothing: no JSON in it has one of the keys diff"):
        evaluate_predictions(find(tmp_path), corpus)


def test_an_answer_that_is_no_file_is_named_at_once(tmp_path):
    os.mkfifo(tmp_path / "00000.json")
    with pytest.raises(ValueError, match=r"00000\.json cannot be read as an answer, it is a pipe"):
        find(tmp_path)
