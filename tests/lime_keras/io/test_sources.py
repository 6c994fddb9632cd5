"""The kinds of sources, told by their names."""

from lime_keras.io import result_json
from lime_keras.io.sources import inside, is_camera, is_video, mask_beside, photo_of_mask


def test_names_tell_videos_and_cameras():
    for name in ("a.mp4", "a/b.MOV", "x.webm"):
        assert is_video(name) and not is_camera(name)
    for name in ("camera:0", "/dev/video0", "camera:My.jpg"):
        assert is_video(name) and is_camera(name)
    for name in ("a.png", "mp4", "a.mp4.jpg", "", "photos"):
        assert not is_video(name)


def test_a_mask_lies_beside_its_photo(tmp_path):
    for name in ("a.jpg", "a_mask.png", "b.PNG", "b_mask.png", "c_mask.png", "d.png", "d_mask.jpg"):
        (tmp_path / name).touch()
    (tmp_path / "d_mask.png").mkdir()
    for name in "ab":
        mask = tmp_path / f"{name}_mask.png"
        assert photo_of_mask(mask).stem == name and mask_beside(photo_of_mask(mask)) == mask
    # Without its photo it is a photo; and no mask has a mask.
    for name in ("c_mask.png", "d_mask.jpg", "d_mask.png", "d.png", "gone_mask.png"):
        assert photo_of_mask(tmp_path / name) is None
    assert mask_beside(tmp_path / "d.png") is None
    assert mask_beside(tmp_path / "a_mask.png") is None


def test_pictures_in_all_folders_below_in_a_fixed_order(tmp_path):
    names = ("b.png", "a.JPG", "c.mp4", "notes.txt", "z/a.png", "d/e/f.webm", "d/x.tif")
    for name in (*names, ".git/a.png", "partial-a/a.png", ".a.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "z" / "loop").symlink_to(tmp_path)
    found = [path.relative_to(tmp_path).as_posix() for path in inside(tmp_path)]
    assert found == ["a.JPG", "b.png", "c.mp4", "d/x.tif", "d/e/f.webm", "z/a.png"]


def test_what_the_command_wrote_is_no_source(tmp_path):
    for name in ("a.png", "a-mask.png", "a-overlay.mp4", "b-mask.png"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "b.json").write_text('{"files": ["b-mask.png"]}')
    result_json.write(tmp_path / "a.json", {}, {}, ["a-mask.png", "a-overlay.mp4", "a.json"])
    assert [path.name for path in inside(tmp_path)] == ["a.png", "b-mask.png"]
