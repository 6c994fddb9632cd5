"""The images of a split as files: the records' own, and nothing else."""

import numpy as np
import pytest
import sphere_corpus
from PIL import Image

from lime_keras.data import records
from lime_keras.render import cli
from lime_keras.render.inspect import images

COUNT = 3


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus")
    return sphere_corpus.write_split(folder, "test", [range(2), range(2, COUNT)], size=32)


def test_they_are_the_records_images_and_nothing_of_the_truth(corpus, tmp_path):
    told = []
    written = images.write(corpus, tmp_path / "images", lambda *done: told.append(done))
    assert written == COUNT and told == [(1, 3), (2, 3), (3, 3)]
    paths = sorted((tmp_path / "images").iterdir())
    assert [path.name for path in paths] == ["00000.png", "00001.png", "00002.png"]
    for index, path in enumerate(paths):
        record = records.parse(records.encode(sphere_corpus.example(index, size=32)))
        with Image.open(path) as image:
            assert image.mode == "RGB" and not image.info
            assert np.array_equal(np.asarray(image), np.round(record["image"] * 255))


def test_what_is_there_is_kept_and_another_picture_refused(corpus, tmp_path):
    images.write(corpus, tmp_path, lambda *_: None)
    kept, gone, other = (tmp_path / f"0000{position}.png" for position in range(COUNT))
    before = kept.stat().st_mtime_ns
    gone.unlink()
    images.write(corpus, tmp_path, lambda *_: None)
    assert kept.stat().st_mtime_ns == before and gone.is_file()
    other.write_bytes(gone.read_bytes())
    with pytest.raises(ValueError, match=r"00002\.png is there and shows something else: pass"):
        images.write(corpus, tmp_path, lambda *_: None)
    assert other.read_bytes() == gone.read_bytes()


def test_the_command_tells_what_it_wrote(corpus, tmp_path, capsys):
    assert cli.main(["images", str(corpus), str(tmp_path / "images")]) == 0
    told = capsys.readouterr()
    assert told.out == f"3 images in {tmp_path / 'images'}\n" and "images: " in told.err
    assert cli.main(["images", str(corpus), str(tmp_path / "images.png")]) == 1
    assert "images.png is named like a file, and OUT is a folder" in capsys.readouterr().err


def test_a_split_that_is_not_complete_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"manifest\.json is missing"):
        images.write(tmp_path, tmp_path / "images", lambda *_: None)
    assert not (tmp_path / "images").exists()
