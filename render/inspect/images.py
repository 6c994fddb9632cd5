"""The images of a test split as files, for systems that read no TFRecords.

`lime-render images` writes them; `docs/reference/benchmark.md` says what is asked of each.
"""

from collections.abc import Callable
from pathlib import Path

import tensorflow as tf

from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.io import atomic, untrusted


def write(corpus: Path, out: Path, on_image: Callable[[int, int], None]) -> int:
    """Write each image of the test split as `00000.png`, named after its position, from 0.

    The files are the PNGs of the records, byte for byte: 8 bits, sRGB, the object over its
    background. Those that are there already are left alone.

    Args:
        corpus: folder of a corpus by `lime-render`.
        out: folder of the images; it is made if it does not exist.
        on_image: called with (done, total) after each image.

    Returns:
        The number of images.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if a record is damaged, or another file has the name of an image.
        OSError: if an image cannot be written.
    """
    split = Split(corpus, "test")
    shards = pipeline.verified_shards(split)
    dataset = tf.data.TFRecordDataset([str(path) for path in shards]).map(records.image_png)
    for position, png in enumerate(pipeline.naming_damage(dataset.as_numpy_iterator(), shards)):
        path = out / f"{position:05d}.png"
        if path.exists():
            untrusted.check(path, "an image of the split")
            if path.read_bytes() != png:
                raise ValueError(
                    f"{path} is there and shows something else: pass another folder, or delete it"
                )
        else:
            atomic.write(path, png)
        on_image(position + 1, split.count)
    return split.count
