"""The benchmark of photographs: names and labels, measures against slow references, the table."""

import itertools
import json
import sys

import numpy as np
import photo_answers
import photographs
import pytest
import record
from sklearn.metrics import roc_auc_score

from lime_keras.optics import colour, shading

RNG = np.random.default_rng(5)
NAN = np.nan


@pytest.fixture
def folder(tmp_path):
    """Return a function that makes empty files of these names, and the folder they are in."""

    def make(*names, labels=None):
        for name in names:
            (tmp_path / "photos" / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "photos" / name).touch()
        if labels is not None:
            (tmp_path / "photos" / "labels.csv").write_text(labels, encoding="utf-8")
        return tmp_path / "photos"

    return make


def test_photos_masks_and_labels(folder):
    text = (
        "\ufeffphoto, finish, note, dielectric, pair\n"
        'a.png, glossy, "a cup, white", 1, white\n'
        "deep/b.png,matte,,0,\n"
        "1input.png\n"
    )
    names = ("a.png", "a_mask.png", "deep/b.png", "1input.png", "1mask.png", ".d.png", "clip.mp4")
    place = folder(*names, labels=text)
    one, a, b = photographs.read_folder(place)
    assert (one.name, one.mask, one.finish, one.pair) == (
        "1input.png",
        place / "1mask.png",
        None,
        None,
    )
    assert (a.mask, a.finish, a.dielectric, a.pair) == (
        place / "a_mask.png",
        "glossy",
        True,
        "white",
    )
    assert (b.name, b.mask, b.finish, b.dielectric) == ("deep/b.png", None, "matte", False)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("photo,finish\nb.png,matte\n", r"labels\.csv: there is no photo b\.png"),
        ("photo,finish\na_mask.png,matte\n", "there is no photo a_mask"),
        ("photo,finnish\na.png,matte\n", "has the columns photo, finnish: .*may have finish, note"),
        ("finish\nmatte\n", "it needs photo"),
        ("", "of no header"),
        ("photo,finish\na.png,shiny\n", "line 2: finish is 'shiny': write glossy or matte"),
        ("photo,dielectric\na.png,yes\n", "line 2: dielectric is 'yes': write 1 or 0"),
        ("photo\na.png\na.png\n", r"line 3: a\.png is named twice"),
        ("photo,note\na.png,old, red\n", "line 2: more fields than columns: quote"),
        (f'photo,note\na.png,"{"x" * 2**18}\n', r"labels\.csv cannot be read as labels"),
    ],
)
def test_labels_that_cannot_be_right_are_refused(folder, text, message):
    with pytest.raises(ValueError, match=message):
        photographs.read_folder(folder("a.png", "a_mask.png", labels=text))


def test_a_folder_without_photos_is_refused(folder):
    with pytest.raises(ValueError, match="has no photos"):
        photographs.read_folder(folder("notes.txt"))


def order(score, glossy, pair=None):
    return photographs.gloss_order(np.array(score, float), np.array(glossy, bool), pair)


def test_the_gloss_order_is_the_area_under_the_roc_curve():
    for ties in (3, 1000):
        score, glossy = RNG.integers(ties, size=40) / 1.0, RNG.random(40) < 0.4
        expected = roc_auc_score(glossy, score)
        assert order(score, glossy)[0] == pytest.approx(expected)
        assert order(-score, glossy)[0] == pytest.approx(1 - expected)


@pytest.mark.parametrize(
    ("score", "glossy", "expected"),
    [
        ([], [], NAN),
        ([1.0, 2.0], [True, True], NAN),
        ([1.0, 2.0], [False, False], NAN),
        ([1.0, 1.0], [True, False], 0.5),
        ([NAN, 1.0], [True, False], 0.5),
        ([np.inf, -np.inf], [True, False], 1.0),
        # NaN is a tie with both matte photos: (½ + ½ + 1 + 1) / 4.
        ([NAN, 5.0, 1.0, 2.0], [True, True, False, False], 0.75),
    ],
)
def test_the_gloss_order_at_its_extremes(score, glossy, expected):
    assert order(score, glossy)[0] == pytest.approx(expected, nan_ok=True)


def test_in_pairs_only_photos_of_one_name_are_compared():
    score, glossy = RNG.integers(5, size=30) / 1.0, RNG.random(30) < 0.5
    pair = RNG.choice(["", "a", "b", "c"], 30)
    right = [
        (score[i] > score[j]) + (score[i] == score[j]) / 2
        for i, j in itertools.product(range(30), repeat=2)
        if glossy[i] and not glossy[j] and pair[i] and pair[i] == pair[j]
    ]
    assert order(score, glossy, pair)[0] == pytest.approx(np.mean(right))
    assert np.isnan(order(score, glossy, np.full(30, ""))[0])
    assert order(score, glossy, np.full(30, "a"))[0] == order(score, glossy)[0]


def test_bootstrap_samples_draw_photos_of_each_finish():
    score, glossy = RNG.normal(size=24) + np.repeat([1.0, 0.0], 12), np.repeat([True, False], 12)
    value, samples = order(score, glossy)
    # The same draws, one by one: a photo drawn twice counts twice.
    rng = np.random.default_rng(photographs._SEED)
    drawn = [rng.multinomial(12, np.full(12, 1 / 12), size=1000) for _ in range(2)]
    for row in (0, 999):
        index = np.repeat(np.arange(24), np.concatenate([part[row] for part in drawn]))
        assert samples[row] == pytest.approx(roc_auc_score(glossy[index], score[index]))
    low, high = photographs._interval(samples)
    assert low < value < high
    assert photographs._interval(order([1, 2, 3], [True, False, False])[1]) is None
    # Samples that hold no couple do not count.
    few = order([2, 0, 1, 3], [True, True, False, False], np.array(["a", "b", "a", "b"]))[1]
    assert 0 < np.isnan(few).sum() < 1000 and photographs._interval(few) == (0, 1)


def test_means_leave_out_unknown_values():
    value, samples = photographs.mean(np.array([1.0, NAN, 3.0]))
    assert value == 2 and photographs._interval(samples) == (1, 3)
    assert np.isnan(samples).sum() == pytest.approx(1000 / 27, abs=25), "all three drawn are NaN"
    for few in ([], [NAN, NAN], [5.0], [5.0, NAN]):
        assert photographs._interval(photographs.mean(np.array(few))[1]) is None
    normal = RNG.normal(size=400)
    low, high = photographs._interval(photographs.mean(normal)[1])
    assert (high - low) / 2 == pytest.approx(1.96 * normal.std() / 20, rel=0.1)


def test_the_lobes_peak_is_the_radiance_of_a_lights_mirror_image():
    up, energy = np.array([[0.0, 0.0, 1.0]]), np.ones(1)
    for exponent in (0.0, 1.0, 30.0, 1000.0):
        radiance = 0.3 * shading.specular(up, up, exponent, up, energy)
        assert photographs.lobe_peak(0.3, exponent) == pytest.approx(radiance[0])
    unknown = photographs.lobe_peak(np.array([NAN, 0.5]), np.array([3.0, NAN]))
    assert np.isnan(unknown).all()


def test_the_mean_colour_is_of_the_objects_unclipped_pixels():
    image = np.zeros((2, 3, 3), np.float32)
    image[0] = [[0.2, 0.4, 0.6], [0.6, 0.4, 0.2], [1.0, 0.4, 0.2]]
    mask = np.zeros((2, 3, 1), np.float32)
    mask[0] = 0.5
    expected = colour.srgb_to_linear(image[0, :2].astype(float)).mean(0)
    np.testing.assert_allclose(photographs.mean_colour(image, mask), expected, rtol=1e-6)
    assert np.isnan(photographs.mean_colour(image, mask * 0.9)).all()


def test_angles_between_colours():
    red, green = np.eye(3)[:2]
    assert photographs.angle(red, red + green) == pytest.approx(45)
    # An arc cosine of the dot product loses all digits here.
    assert photographs.angle(red, red + 1e-9 * green) == pytest.approx(np.degrees(1e-9))
    for black in (np.zeros(3), np.full(3, NAN), np.array([np.inf, 0, 0])):
        for measure in (photographs.angle, photographs.unexplained_angle):
            assert np.isnan(measure(red, black)) and np.isnan(measure(black, red))


def test_the_unexplained_angle_is_the_least_over_all_amounts_of_grey():
    albedo, pixels = RNG.uniform(0.01, 1, (2, 200, 3))
    shares = np.linspace(0, 1, 2001)[:, None, None]
    slow = photographs.angle(pixels - shares * pixels.min(-1, keepdims=True), albedo).min(0)
    np.testing.assert_allclose(photographs.unexplained_angle(albedo, pixels), slow, atol=0.03)
    for gloss in (0.0, 0.3, 5.0):
        assert photographs.unexplained_angle(albedo, 0.7 * albedo + gloss).max() < 1e-4
    grey = np.ones(3)
    expected = photographs.angle(pixels, grey)
    np.testing.assert_allclose(photographs.unexplained_angle(pixels, grey), expected)


@pytest.fixture
def photos(tmp_path, monkeypatch):
    """A glossy photo (much green) with its mask, a matte one, and one whose answer is NaN."""
    place = tmp_path / "photos"
    photo_answers.write(place / "cup.png", [153, 204, 102], mask=photo_answers.disc(8))
    photo_answers.write(place / "deep" / "cloth.png", [102, 51, 77])
    photo_answers.write(place / "red.png", [204, 0, 0])
    text = "photo,finish,dielectric\ncup.png,glossy,1\ndeep/cloth.png,matte,\nred.png,matte,1\n"
    (place / "labels.csv").write_text(text, encoding="utf-8")
    engines = {
        "best": photo_answers.Engine(specular=0.4),
        "nano": photo_answers.Engine(specular=0.04, red=0.05, sharper=1),
    }
    photo_answers.install(monkeypatch, engines)
    return place


def test_the_command_measures_prints_and_records(photos, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(record, "FOLDER", tmp_path / "results")
    arguments = [photographs.__file__, str(photos), "--weights", "best", "nano", "--record", "mine"]
    monkeypatch.setattr(sys, "argv", arguments)
    photographs.main()
    printed = capsys.readouterr().out
    within = next(line for line in printed.splitlines() if "within a factor" in line)
    marks = [cell.strip()[-1] for cell in within.strip("|").split("|")[2:]]
    assert marks == ["]", "]", "+", "+"], "the second model is better by more than chance"
    assert "| deep/cloth.png | matte" in printed

    kept = json.loads((tmp_path / "results" / "mine.json").read_text(encoding="utf-8"))
    assert kept["code"] == photographs.CODE and kept["weights"].keys() == {"best", "nano"}
    own, given = kept["figures"]["best, own mask"], kept["figures"]["best, given mask"]
    # Cloth is put right, and the photo that has no answer counts as a tie.
    assert own["order_exponent"]["value"] == 0.75
    assert own["specular_ratio"]["value"] == pytest.approx(10)
    assert own["within_2"] == {"value": 0, "interval": [0, 0], "count": 2}
    assert own["unanswered"]["value"] == pytest.approx(1 / 3)
    assert own["iou"]["value"] == pytest.approx((8 / 12) ** 2, abs=0.08)
    assert "iou" not in given and "pairs_peak" not in own, "a figure that there is none of"


def test_a_mask_of_another_size_is_refused_by_name(photos):
    photo_answers.write(photos / "cup.png", [0, 204, 0], mask=np.ones((48, 40)))
    with pytest.raises(ValueError, match=r"cup_mask\.png has 40×48 pixels and its photo 48×48"):
        photographs.answers(photographs.read_folder(photos), ["best"])
