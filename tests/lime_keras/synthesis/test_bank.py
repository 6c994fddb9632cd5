"""The manifest and the textures of a bank, and how broken ones are told."""

import subprocess
import sys

import bank_files
import numpy as np
import pytest

from lime_keras.synthesis import bank


@pytest.fixture
def folder(tmp_path):
    bank_files.write(tmp_path / "bank")
    return tmp_path / "bank"


def test_a_bank_is_told_by_its_manifest(folder, tmp_path):
    assert bank.is_bank(folder) and not bank.is_bank(tmp_path)
    assert bank.manifest(folder)["count"] == 5


def test_an_incomplete_bank_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"bank.json is missing: `lime-render bank "):
        bank.manifest(tmp_path)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"version": 2}, "is of version 2, and this lime-keras reads version 1: render the bank"),
        ({"format": "corpus"}, "is no manifest of a bank"),
        ({"shapes": None}, "has no shapes: delete it and run"),
        ({"shapes": [{}]}, "has no names of shapes: delete it and run"),
        ({"size": "16"}, "has no size: delete it and run"),
        ({"size": 0}, "is of 0 pixels, a bank has 1 to 1024: render it anew"),
        ({"size": 2**31 - 1}, "is of 2147483647 pixels, a bank has 1 to 1024"),
    ],
)
def test_another_manifest_is_refused_by_name(folder, values, told):
    bank_files.change_manifest(folder, **values)
    with pytest.raises(ValueError, match=rf"bank\.json {told}"):
        bank.manifest(folder)


@pytest.mark.parametrize("content", ["{", "[]", "7"])
def test_a_broken_manifest_is_refused_by_name(folder, content):
    (folder / bank.MANIFEST).write_text(content)
    with pytest.raises(ValueError, match=r"bank\.json is (broken|no manifest)"):
        bank.manifest(folder)


def test_textures_are_mapped_from_disk(folder):
    held = bank.textures(folder)
    assert isinstance(held, np.memmap) and held.shape == (3, 24, 24, 3)


def test_missing_textures_are_told(folder):
    (folder / bank.TEXTURES).unlink()
    with pytest.raises(FileNotFoundError, match=r"textures\.npy is missing: delete it and run"):
        bank.textures(folder)


def test_textures_cut_off_are_told(folder):
    path = folder / bank.TEXTURES
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ValueError, match=r"textures\.npy is cut off or broken"):
        bank.textures(folder)


@pytest.mark.parametrize("shape", [(0, 24, 24, 3), (3, 24, 20, 3), (24, 24, 3), (3, 24, 24, 4)])
def test_other_arrays_are_no_textures(folder, shape):
    np.save(folder / bank.TEXTURES, np.zeros(shape, np.uint8))
    with pytest.raises(ValueError, match="no textures"):
        bank.textures(folder)


def test_a_bank_is_read_without_tensorflow(folder):
    """Nor Keras, Mitsuba, OpenImageIO."""
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "import numpy as np\n"
        "from lime_keras.synthesis import bank, geometry, lights\n"
        f"folder = Path({str(folder)!r})\n"
        "geometry.GeometryBank(folder).read(np.arange(5))\n"
        "lights.LightBank(folder).map(1), bank.textures(folder)\n"
        "heavy = {'tensorflow', 'keras', 'mitsuba', 'OpenImageIO', 'scipy'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
