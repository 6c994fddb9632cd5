"""Photos, their masks and their labels, found by their names; no picture is opened."""

import pytest

from lime_keras.eval.photos import folder


@pytest.fixture
def photos(tmp_path):
    """Return a function that makes empty files of these names, and the folder they are in."""
    place = tmp_path / "photos"

    def make(*names, labels=None):
        for name in names:
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).touch()
        if labels is not None:
            (place / "labels.csv").write_text(labels, encoding="utf-8")
        return place

    return make


@pytest.fixture
def read(tmp_path):
    return lambda place: folder.read(place, tmp_path / "out")


@pytest.mark.parametrize(
    ("photo", "mask"),
    [
        ("cup.jpg", "cup_mask.png"),
        ("cup.jpg", "cup-mask.jpg"),
        ("cup.jpg", "cup.mask.png"),
        ("Cup.JPG", "cup Mask.PNG"),
        ("1input.png", "1mask.png"),
        ("1_input.png", "1_mask.png"),
        ("room_photo.heic", "room_mask.png"),
        ("photo.png", "mask.png"),
        ("a/deep/cup.jpg", "a/deep/cup_mask.png"),
    ],
)
def test_a_mask_finds_its_photo(photos, read, photo, mask):
    place = photos(photo, mask, "10input.png", "10mask.png", "b/cup.jpg")
    found = {one.name: one.mask for one in read(place)}
    assert found.keys() == {photo, "10input.png", "b/cup.jpg"}
    assert found[photo] == place / mask
    assert found["10input.png"] == place / "10mask.png" and found["b/cup.jpg"] is None


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["cup.jpg", "facemask.png"], r"facemask\.png is named as a mask.* called face:"),
        (["cup.jpg", "b/cup_mask.png"], r"b/cup_mask\.png is named as a mask"),
        (["cup.jpg", "cup.png", "cup_mask.png"], r"does not fit.*cup\.jpg, cup\.png"),
        (["cup.jpg", "cup_mask.png", "cup-mask.png"], r"does not fit.*cup\.jpg, cup-mask\.png"),
    ],
)
def test_a_mask_without_one_photo_is_refused(photos, read, names, told):
    place = photos(*names)
    with pytest.raises(ValueError, match=told):
        read(place)


def test_photos_come_in_order_from_any_depth_and_hidden_files_do_not(photos, read, tmp_path):
    place = photos(
        "b.png", "a/c.JPG", ".d.png", ".thumbs/e.png", "._b.png", "notes.txt", "out/f.png"
    )
    assert [one.name for one in folder.read(place, place / "out")] == ["a/c.JPG", "b.png"]
    assert [one.name for one in read(place)] == ["a/c.JPG", "b.png", "out/f.png"]


def test_without_photos_there_is_an_error(photos, read, tmp_path):
    place = photos("notes.txt", labels="photo,finish\n")
    with pytest.raises(ValueError, match=rf"{place} has no photos: their names end in \.jpg"):
        read(place)
    with pytest.raises(ValueError, match=r"notes\.txt is no folder"):
        read(place / "notes.txt")
    with pytest.raises(ValueError, match="is no folder"):
        read(tmp_path / "missing")
    with pytest.raises(ValueError, match="pass another --out"):
        folder.read(photos("a.png"), place)


def test_photos_without_labels(photos, read):
    [photo] = read(photos("a.png"))
    assert (photo.finish, photo.dielectric, photo.pair) == (None, False, None)


def test_labels(photos, read):
    text = (
        "\ufeffphoto, finish, note, dielectric, pair\n"
        'a.png, glossy, "a cup, white", 1, white\n'
        "deep/b.png,matte,,0,\n"
        "c.png\n"
    )
    a, c, b = read(photos("a.png", "deep/b.png", "c.png", labels=text))
    assert (a.name, a.finish, a.dielectric, a.pair) == ("a.png", "glossy", True, "white")
    assert (b.name, b.finish, b.dielectric, b.pair) == ("deep/b.png", "matte", False, None)
    assert (c.name, c.finish) == ("c.png", None)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("photo,finish\nb.png,matte\n", r"labels\.csv, line 2: there is no photo b\.png"),
        ("photo,finish\na_mask.png,matte\n", "there is no photo a_mask"),
        ("photo,finnish\na.png,matte\n", "has the columns photo, finnish: .*may have finish, note"),
        ("finish\nmatte\n", "it needs photo"),
        ("", "of no header"),
        ("photo,finish\na.png,shiny\n", "line 2: finish is 'shiny': write glossy or matte"),
        ("photo,dielectric\na.png,yes\n", "line 2: dielectric is 'yes': write 1 or 0"),
        ("photo\na.png\na.png\n", r"line 3: a\.png is named in line 2 already"),
        ("photo,note\na.png,old, red\n", "line 2: there are more fields than columns: quote"),
        (
            f'photo,note\na.png,"{"x" * 2**18}\n',
            r"labels\.csv cannot be read as labels: field larger",
        ),
    ],
)
def test_labels_that_cannot_be_right_are_refused(photos, read, text, told):
    place = photos("a.png", "a_mask.png", labels=text)
    with pytest.raises(ValueError, match=told):
        read(place)
