"""The kinds of sources, told by their names."""

from lime_keras.io.sources import is_camera, is_video


def test_names_tell_videos_and_cameras():
    for name in ("a.mp4", "a/b.MOV", "x.webm"):
        assert is_video(name) and not is_camera(name)
    for name in ("camera:0", "/dev/video0", "camera:My.jpg"):
        assert is_video(name) and is_camera(name)
    for name in ("a.png", "mp4", "a.mp4.jpg", "", "photos"):
        assert not is_video(name)
