"""The cards of a corpus: what it holds, for people and for programs."""

from pathlib import Path

from lime_keras.data.corpus import SPLITS, Split
from lime_keras.io import atomic

from . import croissant, data_card


def write(folder: Path) -> list[Path]:
    """Write `README.md` and `croissant.json` of what is complete in a folder; else nothing.

    Both are written anew each time; the same content gives the same bytes. A `README.md` without
    the line `data_card.WRITTEN` is somebody's own, and is left alone.

    Returns:
        The paths of the files that were written.
    """
    splits = [Split(folder, name) for name in SPLITS]
    parts = [split for split in splits if split.manifest_path.is_file()]
    if not parts:
        return []
    name = folder.resolve().name
    texts = {folder / "croissant.json": croissant.text(name, parts)}
    if data_card.is_ours(folder / "README.md"):
        texts[folder / "README.md"] = data_card.text(name, parts)
    for path, content in texts.items():
        # Both splits may be rendered at once.
        atomic.write(path, content, shared=True)
    return list(texts)
