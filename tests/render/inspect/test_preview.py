"""The contact sheet and the histograms, and the numbers that they are drawn from."""

import numpy as np
import pytest
import sphere_corpus
from matplotlib import image as png
from scipy import stats

from lime_keras.data import records
from lime_keras.optics import colour, environment, material_law
from lime_keras.render.inspect import contact_sheet, histograms, preview, quantities
from lime_keras.render.scene import sampling

COUNT = 7


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(
        tmp_path_factory.mktemp("corpus"), "test", [range(4), range(4, COUNT)]
    )


@pytest.fixture
def figures(monkeypatch):
    """What is drawn, by the name of its file; no file is written."""
    drawn = {}
    monkeypatch.setattr(preview, "_save", lambda self, path: drawn.update({path.name: self}))
    return drawn


def parsed(index, size=sphere_corpus.SIZE):
    serialized = records.encode(sphere_corpus.example(index, size=size))
    return {name: value.numpy() for name, value in records.parse(serialized).items()}


def panel(figure, start):
    """The axes whose title begins so."""
    (axes,) = (a for a in figure.axes if a.get_title().startswith(start))
    return axes


def columns(count, seed=0):
    """Quantities as a sound corpus has them."""
    rng = np.random.default_rng(seed)
    materials = [material_law.sample_material(rng) for _ in range(count)]
    rgb = np.array([material.diffuse_albedo for material in materials])
    out = {panel.name: rng.uniform(0.55, 0.9, count) for panel in histograms._PANELS}
    out |= dict(zip(("red", "green", "blue"), rgb.T, strict=True))
    out |= dict(zip("yuv", colour.rgb_to_yuv(rgb).T, strict=True))
    out |= {
        "specular_albedo": np.array([material.specular_albedo for material in materials]),
        "ambient": np.array([material.ambient for material in materials]),
        "log_exponent": np.log10([material.exponent for material in materials]),
    }
    return out


def chart(values, **uses):
    uses = {"shapes": {"sphere": 3, "cube": 0}, "lights": {"lamp": 3}} | uses
    return histograms.draw(values, uses, 500, "corpus/test")


def test_both_pictures_lie_beside_the_shards(corpus):
    told = []
    paths = preview.preview(corpus, "test", lambda *progress: told.append(progress))
    assert paths == [corpus / "test" / name for name in ("preview.png", "histograms.png")]
    for path in paths:
        height, width, _ = png.imread(path).shape
        assert width > 1500 and height > 500
    assert told == [(done, COUNT) for done in range(1, COUNT + 1)]


def test_names_with_dollar_signs_are_no_formulas(tmp_path):
    corpus = sphere_corpus.write_split(tmp_path / r"a$\x$", "test", [range(2)])
    for path in preview.preview(corpus, "test", lambda *_: None):
        assert path.is_file()
    assert not list((corpus / "test").glob("partial-*"))


def test_the_sheet_tells_every_parameter_of_every_example(corpus, figures):
    preview.preview(corpus, "test", lambda *_: None)
    texts = [text.get_text() for text in figures["preview.png"].texts]
    assert texts[1].startswith("7 of 7 examples")
    for heading in ("Input", "Mask", "D", "S", "M", "Normals", "E"):
        assert texts.count(heading) == 2  # of either block
    for index in range(COUNT):
        record = parsed(index)
        start = texts.index(str(index))
        bin_and_exponent, m_d, grey, coverage, shape, light = texts[start + 1 : start + 7]
        assert bin_and_exponent.endswith(f"s = {record['shininess']:.3g}")
        assert m_d == "m_d = " + "  ".join(f"{value:.2f}" for value in record["diffuse_albedo"])
        assert grey == f"m_s = {record['specular_albedo']:.2f}   m_a = 0.020"
        assert coverage == f"coverage {record['mask'].mean():.0%}"
        assert (shape, light) == ("sphere", "lamp")


def test_the_sheet_shows_the_layers(corpus, tmp_path):
    """Thumbnails of the record's size are the record's own pixels."""
    example = parsed(0, size=128)
    contact_sheet.draw([example], 1, "corpus/test").savefig(tmp_path / "sheet.png")
    sheet = png.imread(tmp_path / "sheet.png")[..., :3]
    left, top, step = contact_sheet._MARGIN, contact_sheet._HEAD, 128 + contact_sheet._GAP
    thumbs = [sheet[top : top + 128, left + k * step : left + k * step + 128] for k in range(6)]
    shading = example["diffuse_shading"]
    np.testing.assert_allclose(thumbs[0], example["image"], atol=1 / 255)
    np.testing.assert_allclose(thumbs[1], example["mask"].repeat(3, -1), atol=1 / 255)
    curve = colour.linear_to_srgb(shading / (1 + shading)).repeat(3, -1)
    np.testing.assert_allclose(thumbs[2], curve, atol=1 / 255)
    inside = example["mask"][..., 0] > 0
    np.testing.assert_allclose(thumbs[5][inside], (example["normal"][inside] + 1) / 2, atol=1 / 255)
    assert np.all(thumbs[5][~inside] == 1)
    right = left + 6 * step + 256 + contact_sheet._GAP
    patch = sheet[top + 10, right + contact_sheet._TEXT_WIDTH - contact_sheet._SWATCH]
    albedo = colour.linear_to_srgb(example["diffuse_albedo"])
    np.testing.assert_allclose(patch, albedo, atol=1 / 255)


def test_long_names_are_shortened_in_the_middle():
    name = "a_very_long_name_of_an_environment_map_4k.hdr"
    short = contact_sheet._shortened(name)
    assert len(short) == contact_sheet._LONGEST_NAME
    assert short.startswith("a_very_long") and short.endswith("_map_4k.hdr")
    assert contact_sheet._shortened("lamp.hdr") == "lamp.hdr"


def test_the_examples_shown_are_spread_over_the_split():
    shown = sorted(preview._spread(1000, 24))
    assert len(shown) == 24 and shown[0] == 0 and shown[-1] == 999
    assert np.ptp(np.diff(shown)) <= 1
    assert preview._spread(3, 24) == {0, 1, 2}


def test_images_of_a_large_split_are_sampled(corpus, figures, monkeypatch):
    monkeypatch.setattr(preview, "_PICTURED", 3)
    preview.preview(corpus, "test", lambda *_: None)
    assert "7 examples (3 for what is marked *)" in figures["histograms.png"].get_suptitle()


def test_quantities_are_those_of_the_scene():
    rng = np.random.default_rng(1)
    size, camera = 64, np.array([100.0, 100.0, 20.0, 50.0])
    mask = np.zeros((size, size, 1), np.float32)
    mask[10:26, 30:62] = 1  # 32 across, 16 down, its centre at (46, 18)
    light = rng.uniform(0, 0.1, environment.STORED_SHAPE)
    light[16, 80] = 50.0  # 45° up; 225° + about the vertical: 45° to the right of the camera
    example = {
        "mask": mask,
        "camera": camera,
        "environment": light[..., None],
        "diffuse_albedo": np.array([0.2, 0.5, 0.7], np.float32),
        "specular_albedo": 0.3,
        "shininess": 100.0,
        "ambient": 0.02,
    }
    found = quantities.of_record(example)
    expected = {
        "coverage": 0.125,
        "fill": 0.5,
        "shift_across": 46 / 64 - 0.5,
        "shift_up": 0.5 - 18 / 64,
        "off_axis_across": np.degrees(np.arctan(0.26)),
        "off_axis_up": np.degrees(np.arctan(0.32)),
        "field_of_view": np.degrees(2 * np.arctan(0.32)),
        "log_exponent": 2.0,
        "green": 0.5,
        "y": 0.299 * 0.2 + 0.587 * 0.5 + 0.114 * 0.7,
        "mean_radiance": environment.spherical_mean(light),
    }
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-5)
    azimuth, elevation = -45 - 360 / 256, 90 - 180 * 16.5 / 64
    assert (found["azimuth"], found["elevation"]) == pytest.approx((azimuth, elevation))


def test_brightness_is_measured_where_the_object_is():
    image = np.full((4, 4, 3), 0.5, np.float32)
    image[0, 0, 1] = image[3, 3] = 1.0
    mask = np.zeros((4, 4, 1), np.float32)
    mask[:2], mask[2] = 1, 0.5
    layer = mask * np.arange(16).reshape(4, 4, 1)
    example = {"image": image, "mask": mask} | dict.fromkeys(quantities.PICTURED[2:], layer)
    found = quantities.of_pictures(example)
    assert found["clipped"] == 1 / 8 and found["level"] == pytest.approx((24 * 0.5 + 0.5) / 24)
    assert (found["mirror_mean"], found["mirror_max"]) == (3.5, 7.0)
    assert quantities.of_pictures(example | {"mask": 0.5 * mask}) == {}


def test_a_sound_corpus_raises_no_alarm():
    figure = chart(columns(3000))
    alarms = [a.get_title() for a in figure.axes if a.title.get_color() == histograms._ALARM]
    assert alarms == []
    tested = [a.get_title() for a in figure.axes if "p = " in a.get_title()]
    assert len(tested) == 9


@pytest.mark.parametrize(
    ("name", "wrong", "title"),
    [
        ("specular_albedo", lambda v: v**2, "m_s"),
        ("ambient", lambda v: v / 2, "m_a"),
        ("log_exponent", lambda v: np.where(v < 0.375, v + 0.375, v), "log10 s"),
        ("red", lambda v: np.round(v * 4) / 4, "m_d, red"),
        ("y", lambda v: v * 0.8, "m_d, Y"),
        ("specular_albedo", lambda v: np.where(v > 0.99, 1.3, v), "m_s"),
    ],
)
def test_a_wrong_distribution_raises_an_alarm(name, wrong, title):
    values = columns(3000)
    figure = chart(values | {name: wrong(values[name])})
    alarms = [a.get_title() for a in figure.axes if a.title.get_color() == histograms._ALARM]
    assert len(alarms) == 1 and alarms[0].startswith(title)


def test_values_beyond_the_panel_are_counted():
    values = columns(500)
    values["level"] = np.concatenate([values["level"], [1.2, -0.1]])
    assert panel(chart(values), "mean sRGB level").get_title().endswith("2 outside")


def test_bars_hold_every_value():
    values = columns(1000)
    for axes in chart(values).axes:
        if axes.get_title().startswith(("m_s", "m_d, red", "log10 s")):
            assert axes.patches[0].get_data().values.sum() == 1000


def test_the_bins_of_the_exponent_are_counted():
    values = columns(400)
    axes = panel(chart(values), "log10 s")
    counts = [int(text.get_text()) for text in axes.texts]
    assert counts == np.histogram(values["log_exponent"], np.arange(9) * 0.375)[0].tolist()


def test_the_laws_of_the_pose_are_those_of_the_scenes():
    """Drawn anew as `sampling.sample_pose` draws: a change there must change the line."""
    rng = np.random.default_rng(3)
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    found = {"fill": [], "shift_across": [], "shift_up": []}
    for _ in range(2000):
        pose = sampling.sample_pose(rng, vertices, 256)
        fx, fy, cx, cy = pose.camera
        seen = vertices @ pose.rotation.T + pose.translation
        x, y = cx - fx * seen[:, 0] / seen[:, 2], cy + fy * seen[:, 1] / seen[:, 2]
        found["fill"].append(max(np.ptp(x), np.ptp(y)) / 256)
        found["shift_across"].append((x.min() + x.max()) / 512 - 0.5)
        found["shift_up"].append(0.5 - (y.min() + y.max()) / 512)
    laws = {panel.name: panel.law for panel in histograms._PANELS}
    for name, values in found.items():
        assert stats.kstest(values, laws[name]).pvalue > 1e-3, name


def test_the_environment_is_held_against_the_exposure():
    uses = {"shapes": {"sphere": 1}, "lights": {"lamp": 1}}
    figure = histograms.draw(columns(50), uses, 50, "corpus/test")
    (line,) = panel(figure, "mean radiance").lines
    assert line.get_xdata()[0] == pytest.approx(0.4)


def test_unused_names_are_told_and_few_are_labelled():
    values = columns(50)
    figure = chart(values, lights={f"map{k}": k % 5 for k in range(50)})
    shapes = panel(figure, "uses of 2 shapes, 1 unused")
    assert [label.get_text() for label in shapes.get_xticklabels()] == ["sphere", "cube"]
    lights = panel(figure, "uses of 50 lights, 10 unused")
    assert len(lights.get_xticks()) == 0
    heights = [bar.get_height() for bar in lights.patches]
    assert heights == sorted(heights, reverse=True) and sum(heights) == 100


def test_an_incomplete_split_is_told(tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-render"):
        preview.preview(tmp_path, "train", lambda *_: None)
