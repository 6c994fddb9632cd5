"""The rate at which examples are read, and the cost of each step of the pipeline.

    python benchmarks/reading.py CORPUS

Reads the train split on the processor alone; each row adds one step. Beside the rate stands the
processor time of an example, summed over all threads, which other programs disturb less.
"""

import argparse
import os
import time
from pathlib import Path

import tensorflow as tf

from lime_keras.data import camera, pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.data.features import LEARNT_FROM

WARM_UP = 256
"""Number of examples before the clock starts; then the buffer is full and all threads run."""


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("corpus", type=Path)
    options.add_argument("--size", type=int, help="of the images (default: as stored)")
    options.add_argument("--batch", type=int, default=32)
    options.add_argument("--examples", type=int, default=2000)
    arguments = options.parse_args()
    tf.config.set_visible_devices([], "GPU")
    shards = Split(arguments.corpus, "train").shard_paths()
    stored = tf.data.TFRecordDataset([str(path) for path in shards]).repeat()
    size = arguments.size or records.parse(next(iter(stored)), ["mask"])["mask"].shape[0]
    needed = [
        *(name for name in LEARNT_FROM if name in records.FEATURES),
        *("shininess", "seed", "index"),
    ]
    decoded = _mapped(stored, lambda serialized: records.parse(serialized, needed))
    whole = {"size": size, "batch_size": arguments.batch, "seed": 0}
    rows = {
        "records": (stored, 1),
        "+ decoded": (decoded, 1),
        "+ photographed": (_mapped(decoded, camera.photograph), 1),
        f"+ {size} pixels, shuffled, batched": (
            pipeline.training(shards, **whole),
            arguments.batch,
        ),
        "the same without a camera": (
            pipeline.training(shards, **whole, camera=False),
            arguments.batch,
        ),
    }
    print(f"{len(os.sched_getaffinity(0))} cores, {size} × {size}, batches of {arguments.batch}\n")
    print("| | examples/s | processor ms an example |")
    print("|---|---:|---:|")
    for name, (dataset, examples_each) in rows.items():
        rate, milliseconds = _measure(dataset, examples_each, arguments.examples)
        print(f"| {name} | {rate:.0f} | {milliseconds:.2f} |", flush=True)


def _mapped(dataset: tf.data.Dataset, function) -> tf.data.Dataset:
    return dataset.map(function, num_parallel_calls=tf.data.AUTOTUNE, deterministic=True)


def _measure(dataset: tf.data.Dataset, examples_each: int, examples: int) -> tuple[float, float]:
    """Return examples a second, and milliseconds of processor time for each example."""
    iterator = iter(dataset)
    for _ in range(-(-WARM_UP // examples_each)):
        next(iterator)
    elements = -(-examples // examples_each)
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(elements):
        next(iterator)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    return elements * examples_each / wall, 1e3 * processor / (elements * examples_each)


if __name__ == "__main__":
    main()
