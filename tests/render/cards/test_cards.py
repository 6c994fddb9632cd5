"""The cards of a corpus: what they say is what the manifests record."""

import fnmatch
import json

import pytest

from lime_keras.data.corpus import Split
from lime_keras.render import cards
from lime_keras.render.cards import croissant, data_card

DIGESTS = ["a" * 64, "b" * 64]


def split(folder, name, **changes):
    """A manifest like `lime-render`'s, of a split of three examples in two shards."""
    held = {
        "packages": {"numpy": "2.1.0", "mitsuba": "3.9.1"},
        "description": {"split": name, "count": 3, "seed": 7, "size": 64, "shapes": None},
        "shards": 2,
        "examples": 3,
        "sha256": DIGESTS,
        "failures": [],
        "shapes": ["sphere", "cube"],
        "lights": ["room"],
        "inputs": {"shapes": {}, "environments": {}, "backgrounds": {}},
        "skipped": {},
        "repaired": [],
    } | changes
    path = Split(folder, name).manifest_path
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(held), encoding="utf-8")


@pytest.fixture
def corpus(tmp_path):
    folder = tmp_path / "corpus"
    split(folder, "train")
    return folder


def metadata(folder):
    return json.loads((folder / "croissant.json").read_text(encoding="utf-8"))


def test_every_file_is_listed_with_its_checksum(corpus):
    split(corpus, "test")
    cards.write(corpus)
    listed = {
        entry["contentUrl"]: entry["sha256"]
        for entry in metadata(corpus)["distribution"]
        if entry["@type"] == "cr:FileObject"
    }
    assert listed == {
        f"{name}/0000{number}.tfrecord": digest
        for name in ("train", "test")
        for number, digest in enumerate(DIGESTS)
    }


def test_every_field_has_a_source_that_is_listed(corpus):
    cards.write(corpus)
    found = metadata(corpus)
    sets = {e["@id"]: e for e in found["distribution"] if e["@type"] == "cr:FileSet"}
    files = [e["contentUrl"] for e in found["distribution"] if e["@type"] == "cr:FileObject"]
    [records] = found["recordSet"]
    for field in records["field"]:
        source = sets[field["source"]["fileSet"]["@id"]]
        assert fnmatch.filter(files, source["includes"]) == files
        assert field["source"]["extract"]["column"] == field["name"]
    identities = [e["@id"] for e in (*found["distribution"], records, *records["field"])]
    assert len(set(identities)) == len(identities)


def test_the_fields_are_those_of_records():
    from lime_keras.data import records

    assert tuple(croissant.FIELDS) == records.FEATURES


def test_what_is_not_complete_has_no_card(tmp_path, corpus):
    (corpus / "test").mkdir()
    (corpus / "test" / "description.json").write_text("{}")
    cards.write(corpus)
    assert "| train | 3 | 64 × 64 | 2 | 1 | 2 |" in (corpus / "README.md").read_text("utf-8")
    assert "| test |" not in (corpus / "README.md").read_text("utf-8")
    assert cards.write(tmp_path / "nothing") == []
    assert not (tmp_path / "nothing").exists()


def test_the_same_content_gives_the_same_bytes(corpus):
    before = [path.read_bytes() for path in cards.write(corpus)]
    assert [path.read_bytes() for path in cards.write(corpus)] == before


def test_somebodys_own_card_is_kept(corpus):
    own = "# Mine\nMeshes by A. N. Other, CC BY 4.0."
    (corpus / "README.md").write_text(own)
    assert cards.write(corpus) == [corpus / "croissant.json"]
    assert (corpus / "README.md").read_text() == own


@pytest.mark.parametrize(
    ("change", "licence"), [({}, "mit"), ({"inputs": {"shapes": {"mine.ply": "c" * 64}}}, "other")]
)
def test_only_what_is_built_in_has_a_licence(tmp_path, change, licence):
    folder = tmp_path / "corpus"
    split(folder, "train", **change)
    cards.write(folder)
    assert f"\nlicense: {licence}\n" in (folder / "README.md").read_text("utf-8")
    assert ("license" in metadata(folder)) == (licence == "mit")


def test_any_name_of_a_folder_is_text_in_its_head(tmp_path):
    split(tmp_path / "#2: lime", "train")
    cards.write(tmp_path / "#2: lime")
    text = (tmp_path / "#2: lime" / "README.md").read_text("utf-8")
    assert '\npretty_name: "#2: lime"\n' in text and "\n# #2: lime\n" in text


def test_the_files_of_users_are_named(tmp_path):
    split(tmp_path, "train", inputs={"shapes": {}, "environments": {"hall.exr": "c" * 64}})
    cards.write(tmp_path)
    text = (tmp_path / "README.md").read_text("utf-8")
    assert "files of environments: hall.exr" in text


@pytest.mark.parametrize(
    ("count", "size"), [(1, "n<1K"), (999, "n<1K"), (1_000, "1K<n<10K"), (10**6, "n>1M")]
)
def test_sizes_are_those_of_the_hub(tmp_path, count, size):
    split(tmp_path, "train", examples=count)
    cards.write(tmp_path)
    assert f"\nsize_categories: [{size}]\n" in (tmp_path / "README.md").read_text("utf-8")
    assert data_card.is_ours(tmp_path / "README.md")


@pytest.mark.slow
def test_croissant_is_valid(corpus):
    mlcroissant = pytest.importorskip("mlcroissant")
    cards.write(corpus)
    dataset = mlcroissant.Dataset(corpus / "croissant.json")
    assert not dataset.metadata.issues.errors
