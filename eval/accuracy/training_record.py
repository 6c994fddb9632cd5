"""The record of a run: what it says of its training, beside the weights."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split
from lime_keras.io import untrusted
from lime_keras.model import folder as model_folder


def read(run: Path) -> Mapping[str, Any]:
    """Return the config that a run was trained with; empty for a model without a record.

    Args:
        run: folder of the trained model (see `lime_keras.model.folder`).

    Raises:
        ValueError: if the record cannot be read.
    """
    for path in (run / "config.json", model_folder.folder(run) / "training.json"):
        if path.is_file():
            try:
                return dict(untrusted.read_json(path)["config"])
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"{path} is no record of a run ({error}): train again") from error
    return {}


def check_lobe(run: Path, split: Split) -> None:
    """Raise ValueError if a model's m_s and S have another unit than those of a split."""
    learnt = read(run).get("lobe", "furnace")
    if learnt != split.lobe:
        raise ValueError(
            f"{run} learnt from a corpus of --lobe {learnt}, and {split.folder} has --lobe "
            f"{split.lobe}: their m_s and S have different units; render a test split with --lobe "
            f"{learnt}"
        )


UNITS = {
    "furnace": "m_s and S are normalised to the white furnace; the paper's m_s has another unit, "
    "that of its Eq. 3 without a normaliser",
    "printed": "m_s and S are in the paper's unit: the lobe of its Eq. 3 as printed",
}
"""The unit of m_s and S in words, by the lobe of a corpus."""
