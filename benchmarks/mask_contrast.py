"""The effect on the errors of stretching the estimated mask about one half.

What it measured is in docs/lab/2026-11-22-answers.md.

    python benchmarks/mask_contrast.py --weights RUN CORPUS CORPUS ... --count 320

Uses the first images that training on each corpus would hold out, without the camera model. Prints
the errors with SegmentationNet's prediction stretched by each contrast, and with the true mask.
Below them stand the differences from the unstretched mask, with half of their 95 % interval.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from lime_keras import console, metrics
from lime_keras.optics import shininess

_CONTRASTS = (1.0, 1.5, 2.0, 3.0, 5.0)
_BATCH = 16
_COLUMNS = (
    "mask MAE",
    "IoU",
    "right bin",
    "within one",
    "cross-entropy",
    "log10 s",
    "m_d",
    "m_s",
    "S",
)


def main() -> None:
    """Print a Markdown table of means, and one of differences."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpora", type=Path, nargs="+", help="of lime-render, train split")
    options.add_argument("--weights", type=Path, required=True, help="run of lime-train")
    options.add_argument("--count", type=int, default=320, help="images a corpus (default: 320)")
    arguments = options.parse_args()
    console.import_tensorflow()
    rows = _measured(arguments.corpora, arguments.weights, arguments.count)
    print(_line("mask", *_COLUMNS), _line("---", *["---:"] * len(_COLUMNS)), sep="\n")
    for name, found in rows.items():
        print(_line(name, *(f"{mean:.4f}" for mean in found.mean(axis=0))))
    for name, found in list(rows.items())[1:]:
        change = found - rows[str(_CONTRASTS[0])]
        half = 1.96 * change.std(axis=0) / np.sqrt(len(change))
        pairs = zip(change.mean(axis=0), half, strict=True)
        print(_line(f"{name} − 1", *(f"{mean:+.4f} ± {width:.4f}" for mean, width in pairs)))


def _measured(corpora: list[Path], run: Path, count: int) -> dict[str, np.ndarray]:
    """Return errors `(N, 9)` by name of the mask, with the images in the same order for each."""
    from lime_keras.data import pipeline
    from lime_keras.networks import assemble, weights

    architecture, networks = weights.load(run)
    system = assemble(networks, given={"mask"})
    rows: dict[str, list[np.ndarray]] = {}
    with tqdm(total=count * len(corpora), unit="image") as bar:
        for corpus in corpora:
            held_out = pipeline.evaluation(
                pipeline.training_shards(corpus)[1],
                size=architecture.size,
                batch_size=_BATCH,
            )
            for batch in held_out.take(-(-count // _BATCH)).as_numpy_iterator():
                found = networks["segmentation"].predict_on_batch(batch["image"])
                masks = {str(k): np.clip((found - 0.5) * k + 0.5, 0, 1) for k in _CONTRASTS}
                for name, mask in (masks | {"true": batch["mask"]}).items():
                    answer = system.predict_on_batch({"image": batch["image"], "mask": mask})
                    rows.setdefault(name, []).append(_errors(batch, mask, answer))
                bar.update(len(found))
    return {name: np.concatenate(found) for name, found in rows.items()}


def _errors(
    truth: dict[str, np.ndarray], mask: np.ndarray, answer: dict[str, np.ndarray]
) -> np.ndarray:
    inside, shading = truth["mask"], truth["specular_shading"]
    probabilities, true_bin = answer["exponent_bin_probabilities"], truth["exponent_bin"]
    distance = np.abs(probabilities.argmax(axis=-1) - true_bin)
    likely = np.maximum(probabilities[np.arange(len(true_bin)), true_bin], 1e-7)
    log_error = np.abs(shininess.log_expected(probabilities) - np.log10(truth["shininess"]))
    missed = (np.abs(answer["specular_shading"] - shading) * inside).sum(axis=(1, 2, 3))
    there = np.maximum((shading * inside).sum(axis=(1, 2, 3)), 1e-9)
    return np.stack(
        [
            np.abs(mask - inside).mean(axis=(1, 2, 3)),
            metrics.intersection_over_union(inside, mask),
            distance == 0,
            distance <= 1,
            -np.log(likely),
            log_error,
            np.abs(answer["diffuse_albedo"] - truth["diffuse_albedo"]).mean(axis=-1),
            np.abs(answer["specular_albedo"][:, 0] - truth["specular_albedo"]),
            np.minimum(missed / there, 5),  # a nearly black S would dominate the mean
        ],
        axis=-1,
    )


def _line(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
