"""The gallery: what it shows, in which order it may be brought, and that it needs nothing else."""

import csv
import re
from html.parser import HTMLParser
from urllib.parse import unquote

import json_files
import numpy as np
import pytest

from lime_keras import Material
from lime_keras.estimate import files, gallery
from lime_keras.io import result_json

PHOTO = np.full((32, 40, 3), 0.5, np.float32)
MASK = np.ones((32, 40, 1), np.float32)


class Page(HTMLParser):
    """The cards of a page, and the addresses it refers to."""

    def __init__(self, path):
        super().__init__()
        self.cards, self.links, self.pictures, self.text = [], [], [], ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "article":
            self.cards.append(attributes)
        self.links += [attributes["href"]] if "href" in attributes else []
        self.pictures += [attributes["src"]] if "src" in attributes else []

    def handle_data(self, data):
        self.text += data


def add(out, name, **fields):
    """Write a result as a run does."""
    path = out / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    values = {"diffuse_albedo": np.array([0.5, 0.2, 0.1]), "specular_albedo": 0.4, "exponent": 30.0}
    material = Material(
        **values | fields, mask_coverage=1.0, layers={"mask": MASK}, image_srgb=PHOTO
    )
    files.write_pictures(path.parent, path.stem, material)
    files.write_formats(path.parent, path.stem, material)
    numbers = {"photo": str(out / "photo.png")} | material.to_json()
    written = [path.name, *sorted(file.name for file in path.parent.glob(f"{path.stem}*"))]
    result_json.write(path, numbers, {"source": name}, written)


def update(out, *names):
    gallery.update(out, {name: result_json.read(out / f"{name}.json") for name in names})


def rows(out):
    with (out / "materials.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_photo_named_as_a_part_of_a_result_keeps_its_own_links(tmp_path):
    add(tmp_path, "vase-mitsuba")
    update(tmp_path, "vase-mitsuba")
    links = Page(tmp_path / "index.html").links
    assert {"vase-mitsuba.json", "vase-mitsuba-mitsuba.json"} <= set(links)


def test_page_and_table_show_each_result(tmp_path):
    add(tmp_path, "a", exponent_entropy=1.5)
    add(tmp_path, "sub/b", diffuse_albedo=np.array([0.2, 0.2, 0.2]), exponent=300.0)
    update(tmp_path, "a", "sub/b")
    first, second = rows(tmp_path)
    assert tuple(first) == gallery.COLUMNS
    assert (first["json"], first["exponent"], first["colour"]) == ("a.json", "30.0", "#bc7c59")
    assert (second["json"], second["exponent_entropy"]) == ("sub/b.json", "")
    page = Page(tmp_path / "index.html")
    assert [card["data-name"] for card in page.cards] == ["a", "sub/b"]
    assert [10 ** float(card["data-gloss"]) for card in page.cards] == pytest.approx([30, 300])
    assert [card["data-confidence"] for card in page.cards] == ["0.5", ""]
    # Grey stands before all hues.
    assert float(page.cards[1]["data-colour"]) < 0 < float(page.cards[0]["data-colour"])
    assert page.pictures == ["a-preview.png", "sub/b-preview.png"] and "2 materials" in page.text


def test_the_gloss_is_told_with_how_sure_it_is(tmp_path):
    add(tmp_path, "flat", exponent_bin_probabilities=np.full(8, 0.125))
    add(tmp_path, "sure", exponent_bin_probabilities=np.eye(8)[3])
    update(tmp_path, "flat", "sure")
    flat, sure = rows(tmp_path)
    assert flat["gloss"] == sure["gloss"] == "satin to semi-gloss"
    assert [float(flat[f"exponent_{end}"]) for end in ("low", "high")] == [1.99526, 501.187]
    assert float(sure["roughness"]) == pytest.approx(0.42, abs=0.01)
    text = Page(tmp_path / "index.html").text
    assert "satin to semi-gloss" in text
    assert "s 30 (2.0 to 501)" in text and "s 30 (15 to 29)" in text


def test_its_pictures_and_links_lead_to_files(tmp_path):
    add(tmp_path, "sub/100% a#b?")
    update(tmp_path, "sub/100% a#b?")
    page = Page(tmp_path / "index.html")
    assert page.pictures
    assert all((tmp_path / unquote(file)).is_file() for file in (*page.pictures, *page.links))
    assert {"sub/100%25%20a%23b%3F.gltf", "materials.csv"} <= set(page.links)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|//[a-z]|@import|url\(", text)


def test_names_are_told_as_they_are(tmp_path):
    name = "<script>alert(1)</script>"[:8] + '"&'
    add(tmp_path, name)
    update(tmp_path, name)
    page = Page(tmp_path / "index.html")
    assert name in page.text and page.cards[0]["data-name"] == name


def test_half_a_character_is_told_with_the_results_name(tmp_path):
    add(tmp_path, "a")
    with json_files.edited(tmp_path / "a.json") as numbers:
        numbers["photo"] = "\ud800.png"
    with pytest.raises(ValueError, match=r"a\.json cannot be read as a result: .*surrogates"):
        update(tmp_path, "a")


def test_half_a_material_is_refused_by_the_results_name(tmp_path):
    add(tmp_path, "a")
    with json_files.edited(tmp_path / "a.json") as numbers:
        numbers["specular_albedo"] = None
    with pytest.raises(ValueError, match=r"a\.json cannot be read as a result"):
        update(tmp_path, "a")


def test_results_of_earlier_runs_stay_and_removed_ones_go(tmp_path):
    for name in ("a", "b", "c"):
        add(tmp_path, name)
        update(tmp_path, name)
    assert [row["json"] for row in rows(tmp_path)] == ["a.json", "b.json", "c.json"]
    (tmp_path / "b.json").unlink()
    update(tmp_path, "a")
    assert [row["json"] for row in rows(tmp_path)] == ["a.json", "c.json"]


def test_scenes_of_a_video_have_a_card_each(tmp_path):
    scenes = [{"scene": 1, "exponent": 3.0}, {"scene": 4, "exponent": 9.0}]
    names = ["clip.csv", "clip-scene-1.mtl", "clip-scene-4.mtl", "clip-scene-4-preview.png"]
    numbers = {"video": "clip.mp4", "exponent": 9.0, "scenes": scenes}
    result_json.write(tmp_path / "clip.json", numbers, {}, names)
    update(tmp_path, "clip")
    assert [row["scene"] for row in rows(tmp_path)] == ["1", "4"]
    page = Page(tmp_path / "index.html")
    assert [card["data-name"] for card in page.cards] == ["clip, scene 1", "clip, scene 4"]
    assert "clip-scene-4.mtl" in page.links and "clip-scene-1.mtl" in page.links


def test_a_video_without_an_object_has_a_card_and_its_overlay_a_link(tmp_path):
    files = ["clip.csv", "clip-overlay.mp4"]
    for name, scenes in (("none", []), ("two", [{"scene": 1}, {"scene": 2}])):
        numbers = {"video": f"{name}.mp4", "scenes": scenes}
        own = [file.replace("clip", name) for file in files]
        result_json.write(tmp_path / f"{name}.json", numbers, {}, own)
    made = {"made": {"unfinished": True}, "files": [], "video": "w.mp4", "scenes": []}
    update(tmp_path, "none", "two")
    gallery.update(tmp_path, {"w": made})
    page = Page(tmp_path / "index.html")
    assert [card["data-name"] for card in page.cards] == ["none", "two, scene 1", "two, scene 2"]
    assert page.links.count("two-overlay.mp4") == 2 and "none-overlay.mp4" in page.links


def test_an_estimate_of_little_is_shown_by_what_there_is(tmp_path):
    add(tmp_path, "a", diffuse_albedo=None, specular_albedo=None, exponent=None)
    update(tmp_path, "a")
    page = Page(tmp_path / "index.html")
    assert len(page.pictures) == 1 and page.cards[0]["data-gloss"] == ""
    assert rows(tmp_path)[0]["colour"] == ""


@pytest.mark.parametrize("name", ["index.html", "materials.csv"])
def test_another_file_of_that_name_is_refused(name, tmp_path):
    add(tmp_path, "a")
    gallery.check(tmp_path)
    update(tmp_path, "a")
    gallery.check(tmp_path)
    (tmp_path / name).write_text("mine\n")
    with pytest.raises(ValueError, match=rf"{name} is there, and not of lime-estimate"):
        gallery.check(tmp_path)
