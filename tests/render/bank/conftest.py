"""Banks that several test modules read."""

import shutil

import pytest
import small_banks
from render_scenes import write_inputs


@pytest.fixture(scope="session")
def inputs(shared):
    """A folder with two meshes and two maps, one of each for each split."""

    def make(folder):
        folder.mkdir()
        write_inputs(folder)

    return shared("bank-inputs", make)


@pytest.fixture(scope="session")
def rendered(shared, inputs, mitsuba_choice):
    """A bank of the user's files, with progress told; not to be changed."""

    def make(folder):
        small_banks.render(
            folder,
            mitsuba_choice,
            count=20,
            shard_size=8,
            shapes=str(inputs / "shapes"),
            environments=str(inputs / "environments"),
        )

    return shared("bank", make)


@pytest.fixture
def bank(rendered, tmp_path):
    """A copy of the bank, to be broken."""
    return shutil.copytree(rendered, tmp_path / "bank")
