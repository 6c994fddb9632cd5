"""The unit of m_s and S, which models learn from the lobe of their corpora."""

from pathlib import Path

from lime_keras.data.corpus import Split
from lime_keras.model import folder as model_folder


def check_lobe(run: Path, split: Split) -> None:
    """Raise ValueError if a model's m_s and S have another unit than those of a split."""
    learnt = model_folder.lobe(run)
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
