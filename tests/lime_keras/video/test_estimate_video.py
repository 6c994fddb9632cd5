"""From clips to tables and overlays: fusion, cuts, lost objects, interruptions."""

import csv
import dataclasses

import clips
import full_disk
import numpy as np
import pytest
from clips import NOTHING, material

from lime_keras import Estimator, Material
from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.io import video_reader
from lime_keras.io.video_reader import Footage
from lime_keras.material import Caution
from lime_keras.video.estimate_video import estimate_video
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import LOST_AFTER, PARAMETERS, parameters


class Scripted:
    """Answers with one material after the other; raises what is no material."""

    def __init__(self, materials):
        self.materials, self.seen = iter(materials), []

    def estimate(self, image_srgb):
        self.seen.append(image_srgb)
        answer = next(self.materials)
        if isinstance(answer, Material):
            return answer
        raise answer


def scene(count, seed):
    """Frames of one scene: a still picture under a little noise."""
    picture = np.random.default_rng(seed).integers(20, 90) * np.ones((48, 64, 3))
    picture[:, 20:] += 100
    return np.uint8(picture + np.random.default_rng(seed + 1).normal(0, 2, (count, 48, 64, 3)))


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def numbers(row, prefix=""):
    """Five numbers of a row; an empty cell is NaN."""
    return np.array([float(row[prefix + name] or "nan") for name in PARAMETERS])


def linear(values):
    return np.array([*values[:4], 10 ** values[4]])


def run(tmp_path, images, materials, **options):
    clip = clips.write(tmp_path / "clip.mkv", images)
    return estimate_video(str(clip), Scripted(materials), tmp_path / "out", "vase", **options)


# The files.


def test_the_table_and_the_summary(tmp_path):
    images = np.concatenate([scene(6, 0), scene(5, 10)])
    materials = [material(number) for number in range(11)]
    materials[3] = materials[8] = NOTHING
    summary = run(tmp_path, images, materials)
    table = rows(summary.table)
    assert summary.table == tmp_path / "out" / "vase.csv"
    assert [row["frame"] for row in table] == [str(n) for n in range(11)]
    np.testing.assert_allclose([float(row["time"]) for row in table], np.arange(11) / 25, atol=1e-3)
    assert [row["found"] for row in table] == list("11101111011")
    assert [row["cut"] for row in table] == list("00000010000")
    fusion = Fusion()
    for number, (row, one) in enumerate(zip(table, materials, strict=True)):
        if number == 6:
            fusion = Fusion()
        fused = fusion.update(parameters(one))
        assert float(row["coverage"]) == one.mask_coverage
        np.testing.assert_allclose(numbers(row), linear(parameters(one)), rtol=1e-5)
        np.testing.assert_allclose(numbers(row, "fused_"), linear(fused), rtol=1e-5)
    assert (summary.frames, summary.found, summary.cuts, summary.remarks) == (11, 9, 1, ())
    assert summary.seconds == pytest.approx(10 / 25, abs=1e-3)
    np.testing.assert_allclose(parameters_of(summary), fused, rtol=1e-6)
    with Footage(str(summary.overlay)) as footage:
        shown = list(footage)
    assert summary.overlay == tmp_path / "out" / "vase-overlay.mp4" and len(shown) == 11
    assert shown[0].image_srgb.shape == (480, 640 + 380, 3)
    np.testing.assert_allclose([f.time for f in shown], np.arange(11) / 25, atol=1e-3)


def parameters_of(summary):
    found = summary.material
    return [*found.diffuse_albedo, found.specular_albedo, np.log10(found.exponent)]


def test_the_estimator_is_given_floats_in_0_to_1(tmp_path):
    images = clips.noise(2)
    estimator = Scripted([material(0), material(1)])
    estimate_video(str(clips.write(tmp_path / "c.mkv", images)), estimator, tmp_path, "c")
    assert estimator.seen[0].dtype == np.float32
    np.testing.assert_array_equal(np.rint(255 * np.stack(estimator.seen)), images)


def test_the_last_object_outlives_its_loss(tmp_path):
    materials = [material(0), material(0), *[NOTHING] * (LOST_AFTER + 2)]
    summary = run(tmp_path, scene(len(materials), 0), materials)
    assert rows(summary.table)[-1]["fused_specular"] == ""
    assert summary.material.specular_albedo == pytest.approx(material(0).specular_albedo)


def test_a_video_without_any_object(tmp_path):
    summary = run(tmp_path, scene(3, 0), [NOTHING] * 3)
    assert (summary.frames, summary.found) == (3, 0)
    assert summary.material == Material(warnings=(NO_OBJECT,))
    for row in rows(summary.table):
        assert np.isnan([*numbers(row), *numbers(row, "fused_")]).all()


def test_an_object_of_which_masks_alone_are_asked_is_found(tmp_path):
    seen = Material(mask_coverage=0.25, layers={"mask": np.ones((48, 64, 1), np.float32)})
    summary = run(tmp_path, scene(3, 0), [seen] * 3)
    assert summary.found == 3 and summary.material.warnings == ()


def test_a_frames_warnings_stand_in_its_line_and_a_scenes_in_the_summary(tmp_path):
    """The scene's are those of most frames since the last cut."""
    dark, parts = Caution("too-dark", "dark"), Caution("many-parts", "parts")
    told = [(parts,), (parts,), (dark, parts), (dark,), ()]
    made = [
        dataclasses.replace(material(index), warnings=warnings, mask_confidence=0.5 + index / 10)
        for index, warnings in enumerate(told)
    ]
    clip = np.concatenate([scene(2, 0), scene(3, 1)])
    summary = run(tmp_path, clip, made)
    written = rows(summary.table)
    assert summary.cuts == 1
    assert [row["warnings"] for row in written] == [
        *("many-parts", "many-parts", "too-dark many-parts", "too-dark", "")
    ]
    confidences = [float(row["mask_confidence"]) for row in written]
    np.testing.assert_allclose(confidences, 0.5 + np.arange(5) / 10)
    assert [caution.code for caution in summary.material.warnings] == ["too-dark"]
    assert summary.material.mask_confidence == pytest.approx(0.8)


def test_one_frame(tmp_path):
    summary = run(tmp_path, scene(1, 0), [material(0)])
    assert (summary.frames, summary.seconds) == (1, 0)
    np.testing.assert_allclose(parameters_of(summary), parameters(material(0)), rtol=1e-6)


def test_progress_goes_to_standard_error(tmp_path, capsys):
    run(tmp_path, scene(5, 0), map(material, range(5)))
    told = capsys.readouterr()
    assert told.out == "" and "5/5" in told.err and "frame/s" in told.err


# Interruptions.


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("broken")])
def test_what_stops_a_file_leaves_valid_files(error, tmp_path):
    with pytest.raises(type(error)):
        run(tmp_path, scene(9, 0), [*map(material, range(5)), error])
    table = rows(tmp_path / "out" / "vase.csv")
    assert len(table) == 5 and None not in table[-1].values()
    with Footage(str(tmp_path / "out" / "vase-overlay.mp4")) as footage:
        assert len(list(footage)) == 5


def test_the_table_can_be_read_while_it_grows(tmp_path):
    lengths = []

    class Curious(Scripted):
        def estimate(self, image_srgb):
            lengths.append(len(rows(tmp_path / "vase.csv")))
            return super().estimate(image_srgb)

    clip = clips.write(tmp_path / "clip.mkv", scene(4, 0))
    estimate_video(str(clip), Curious(map(material, range(4))), tmp_path, "vase")
    assert lengths == [0, 1, 2, 3]


def test_a_camera_runs_until_it_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setitem(video_reader._DEVICES, video_reader.sys.platform, "lavfi")
    estimator = Scripted([*map(material, range(7)), KeyboardInterrupt()])
    summary = estimate_video("camera:testsrc=size=64x48:rate=20", estimator, tmp_path, "live")
    assert (summary.frames, summary.found) == (7, 7)
    assert len(rows(summary.table)) == 7


def test_a_damaged_video_is_read_as_far_as_it_goes(tmp_path):
    path = clips.write(tmp_path / "clip.mp4", clips.noise(20), codec="libx264")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    summary = estimate_video(str(path), Scripted(map(material, range(20))), tmp_path, "half")
    assert 5 < summary.frames < 15 and len(rows(summary.table)) == summary.frames
    assert "damaged packets" in summary.remarks[0]


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_of_a_video_without_a_frame_nothing_is_written(share, tmp_path):
    path = clips.write(tmp_path / "clip.mp4", clips.noise(20), codec="libx264")
    data = path.read_bytes()
    # The header, and as good as nothing behind it.
    path.write_bytes(data[: data.index(b"mdat") + 4 + int(share * 1000)])
    with pytest.raises(ValueError, match=r"clip\.mp4 holds no frame .+ export it anew"):
        estimate_video(str(path), Scripted([]), tmp_path / "out", "none")
    assert not (tmp_path / "out").exists()


def test_a_missing_video_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        estimate_video(str(tmp_path / "a.mp4"), Scripted([]), tmp_path / "out", "none")
    assert not (tmp_path / "out").exists()


# The network.


def test_a_network_estimates_each_frame(tiny_model, tmp_path):
    images = np.random.default_rng(0).integers(60, 196, (7, 32, 32, 3), dtype=np.uint8)
    estimator = Estimator(tiny_model)
    clip = clips.write(tmp_path / "clip.mkv", images)
    summary = estimate_video(str(clip), estimator, tmp_path, "tiny")
    fusion, found = Fusion(), 0
    for row, image in zip(rows(summary.table), images, strict=True):
        one = estimator.estimate(image / np.float32(255))
        if row["cut"] == "1":
            fusion = Fusion()
        fused = fusion.update(parameters(one))
        found += one.mask_coverage > 0
        np.testing.assert_allclose(numbers(row, "fused_"), linear(fused), rtol=1e-4)
    assert summary.found == found > 3


def test_a_network_asked_for_albedo_alone(tiny_model, tmp_path):
    estimator = Estimator(tiny_model, ["albedo"])
    clip = clips.write(tmp_path / "clip.mkv", clips.noise(2, (32, 32)))
    summary = estimate_video(str(clip), estimator, tmp_path, "tiny")
    assert summary.material.exponent is None and summary.material.specular_albedo is not None
    assert {row["exponent"] for row in rows(summary.table)} == {""}


def test_a_table_that_finds_no_room_is_told(tmp_path):
    clip = str(clips.write(tmp_path / "clip.mkv", scene(3, 0)))
    with (
        pytest.raises(OSError, match=r"vase\.csv cannot be written: .*; "),
        full_disk.files_end_after(100),
    ):
        estimate_video(clip, Scripted([material(0)] * 3), tmp_path / "out", "vase")
