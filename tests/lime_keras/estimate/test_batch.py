"""The files of one photo after another: its light, and clones."""

import functools
import subprocess
import sys
from concurrent.futures import Future

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh

from lime_keras import Estimator
from lime_keras.estimate.batch import Batch
from lime_keras.estimate.results import Results
from lime_keras.estimate.terminal import Printer
from lime_keras.io import photo
from lime_keras.render import cloning

SHAPE = (48, 64)


@pytest.fixture(scope="module")
def picture():
    """A photo of a disc and the disc's mask, of 8 bits."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5
    mask = ((rows - 24) ** 2 + (columns - 32) ** 2 < 18**2)[..., None].astype(np.float32)
    shade = np.clip(1.2 - columns / SHAPE[1], 0, 1)[..., None] * np.array([0.7, 0.4, 0.3])
    return np.round(255 * np.where(mask > 0, shade, 0.5)).astype(np.float32) / 255, mask


@pytest.fixture(scope="module")
def estimator(tiny_model):
    return Estimator(tiny_model)


@pytest.fixture
def batch_of(estimator, tmp_path):
    """`batch_of(image, mask, **options)`: a batch that has estimated the photo `a.png`."""

    def run(image, mask, **options):
        photo.write(tmp_path / "a.png", image)
        if mask is not None:
            photo.write(tmp_path / "a_mask.png", mask)
        results = Results(tmp_path / "out", "weights", {}, overwrite=True)
        batch = Batch(results, Printer(for_people=False), **options)
        batch.run(estimator, {"a": tmp_path / "a.png"})
        return batch

    return run


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "ball.ply"
    trimesh.creation.icosphere(3).export(path)
    return path


def normals_of_a_dome(mask):
    """Normals of a hemisphere, 8 bits a channel, black in the background."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5
    x, y = (columns - 32) / 18, -(rows - 24) / 18
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return np.where(mask > 0, (np.stack([x, y, z], axis=-1) + 1) / 2, 0)


def onto(mesh):
    return functools.partial(cloning.clone, mesh_path=mesh)


def keep(image, mask, material, light, *, alpha):
    """A renderer of clones that leaves the photo as it is."""
    return image


def test_the_light_is_a_map_in_camera_space(picture, batch_of, tmp_path):
    photo.write(tmp_path / "n.png", normals_of_a_dome(picture[1]))
    maps = []
    for options in ({"normals": tmp_path / "n.png"}, {"clone": keep}):
        batch_of(*picture, **options)
        found = oiio.ImageBuf(str(tmp_path / "out" / "a-environment.exr")).get_pixels(oiio.FLOAT)
        assert found.reshape(64, 128, -1).shape == (64, 128, 1)
        assert np.isfinite(found).all() and found.min() >= 0 and found.max() > 0
        maps.append(found)
        assert (tmp_path / "out" / "a-environment.png").is_file()
        assert (tmp_path / "out" / "a-clone.png").exists() == ("clone" in options)
    # One light is seen by the normals given, the other by normals guessed.
    assert not np.array_equal(*maps)


def test_a_transparent_photo_stays_transparent_around_its_clone(
    picture, batch_of, mesh, mitsuba_choice, tmp_path
):
    image, mask = picture
    batch_of(np.concatenate([image * mask, mask], axis=-1), None, clone=onto(mesh))
    _, alpha = photo.read(tmp_path / "out" / "a-clone.png")
    assert alpha is not None
    assert not alpha[:3].any() and alpha[mask > 0].mean() > 0.5


def test_a_clone_takes_the_objects_place(picture, batch_of, mesh, mitsuba_choice, tmp_path):
    image, mask = picture
    batch_of(image, mask, clone=onto(mesh))
    found = photo.read_srgb(tmp_path / "out" / "a-clone.png")
    assert found.shape == image.shape
    far = np.zeros(SHAPE, bool)
    far[:3], far[-3:], far[:, :8], far[:, -8:] = True, True, True, True
    np.testing.assert_allclose(found[far], image[far], atol=0.5 / 255 + 1e-6)
    assert np.abs(found - image)[mask[..., 0] > 0].mean() > 0.01


def test_normals_of_another_size_are_named(picture, batch_of, tmp_path, capsys):
    photo.write(tmp_path / "n.png", np.tile(np.array([0.5, 0.5, 1.0]), (20, 20, 1)))
    batch = batch_of(*picture, normals=tmp_path / "n.png")
    assert "n.png has 20×20 pixels and its photo 64×48" in capsys.readouterr().err
    assert not batch.finished and not (tmp_path / "out" / "a.json").exists()


@pytest.mark.slow
def test_the_command_loads_mitsuba_before_tensorflow(picture, tiny_model, mesh, tmp_path):
    """In a process of its own: the other order ends in a crash."""
    image, mask = picture
    photo.write(tmp_path / "photo.png", image)
    photo.write(tmp_path / "mask.png", mask)
    program = "import sys; from lime_keras.render.commands import clone; sys.exit(clone.main())"
    command = [sys.executable, "-c", program, str(tmp_path / "photo.png")]
    options = {"--mask": tmp_path / "mask.png", "--clone-onto": mesh, "--weights": tiny_model}
    for option, value in (options | {"--out": tmp_path / "out"}).items():
        command += [option, str(value)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "photo-clone.png").is_file()


def test_a_photo_that_is_written_while_the_run_is_interrupted_is_finished(
    estimator, picture, tmp_path, monkeypatch
):
    """As by Ctrl-C, which falls into the wait for the writer."""
    photo.write(tmp_path / "a.png", picture[0])
    results = Results(tmp_path / "out", "weights", {})
    batch = Batch(results, Printer(for_people=False))

    def interrupted(future, timeout=None):
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(Future, "result", interrupted)
    with pytest.raises(KeyboardInterrupt):
        batch.run(estimator, {"a": tmp_path / "a.png"})
    assert list(batch.finished) == ["a"] and (tmp_path / "out" / "a.json").is_file()
