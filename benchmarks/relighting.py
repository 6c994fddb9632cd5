"""The change of the relighting error when only some pixels of an object are lit.

    python benchmarks/relighting.py CORPUS --count 60

For several numbers of pixels, prints the mean PSNR over the test split's first images, for the
material in the middle of all ranges, and the median difference of an image's PSNR from its PSNR
with all pixels.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from lime_keras import console

_PIXELS = (32, 64, 128, 256, 100_000)


def main() -> None:
    """Print a Markdown table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--count", type=int, default=60, help="images (default: 60)")
    options.add_argument("--size", type=int, default=128, help="of the images (default: 128)")
    arguments = options.parse_args()
    console.import_tensorflow()
    from lime_keras.data import pipeline
    from lime_keras.data.corpus import Split
    from lime_keras.eval.accuracy import relighting

    dataset = pipeline.evaluation(
        Split(arguments.corpus, "test").shard_paths(),
        size=arguments.size,
        batch_size=1,
        features=relighting.FEATURES,
    )
    found: dict[int, list[float]] = {pixels: [] for pixels in _PIXELS}
    for batch in tqdm(dataset.take(arguments.count).as_numpy_iterator(), total=arguments.count):
        example = {name: values[0] for name, values in batch.items()}
        for pixels in _PIXELS:
            relighting.PIXELS = pixels
            relit = relighting.relight(example, {"average": relighting.AVERAGE})
            found[pixels].append(relit["average"]["relit"])
    everything = np.array(found[_PIXELS[-1]])
    print("| pixels | mean PSNR | single images off by (median) |\n|---:|---:|---:|")
    for pixels, values in found.items():
        off = np.median(np.abs(np.array(values) - everything))
        name = "all" if pixels == _PIXELS[-1] else str(pixels)
        print(f"| {name} | {np.mean(values):.3f} dB | {off:.2f} dB |")


if __name__ == "__main__":
    main()
