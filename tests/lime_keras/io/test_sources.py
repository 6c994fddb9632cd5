"""The kinds of sources, told by their names."""

from lime_keras.io.sources import is_camera, is_video, mask_beside, photo_of_mask


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
