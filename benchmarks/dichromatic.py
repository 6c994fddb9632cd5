"""The error of the dichromatic split where photographs are not ideal.

    python benchmarks/dichromatic.py CORPUS [--count 200]

For each flaw of a photograph, of its mask or of the light, prints the median over the scenes of the
error of the most that m_d · D can be, mean(m_d) D over its own mean; of the grey light m_s S + m_a
over the mean of the image; and the angle to the hue of m_d. The first row is without flaws, where
what is left is the bound itself: no pixel of a real object has S = 0.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scenes

from lime_keras.eval.markdown_table import aligned
from lime_keras.optics import camera_law, colour, dichromatic
from lime_keras.optics.compositing import compose

Scene = tuple[np.ndarray, np.ndarray]
"""Linear image `(1, S, S, 3)`, clipped at 1, and mask `(1, S, S, 1)`."""


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--split", default="train", choices=("train", "test"))
    options.add_argument("--count", type=int, default=200)
    arguments = options.parse_args()
    errors: dict[str, list[tuple[float, float, float]]] = {flaw: [] for flaw in FLAWS}
    for record in scenes.scenes(arguments.corpus, arguments.split, count=arguments.count, size=128):
        batch = {name: np.asarray(value)[None] for name, value in record.items()}
        for flaw, change in FLAWS.items():
            found = _errors(batch, change)
            if found is not None:
                errors[flaw].append(found)
    lines = [
        [flaw, f"{diffuse:.3f}", f"{grey:.3f}", f"{hue:.1f}°"]
        for flaw, rows in errors.items()
        for diffuse, grey, hue in [np.median(rows, axis=0)]
    ]
    print(aligned([["flaw", "diffuse light", "grey light", "hue"], *lines]))


def _errors(
    record: dict[str, np.ndarray], change: Callable[[Scene], Scene]
) -> tuple[float, float, float] | None:
    """Return the errors of a scene's split; None for a grey object, which has none."""
    m_d, m_s, m_a = (record[name] for name in ("diffuse_albedo", "specular_albedo", "ambient"))
    if np.ptp(m_d) < 0.05 or record["mask"].sum() < 100:
        return None
    shade, gloss, mask = (record[name] for name in ("diffuse_shading", "specular_shading", "mask"))
    behind = colour.srgb_to_linear(record["image"]) * (1 - mask)
    whole = np.clip(mask * compose(m_d, m_s, m_a, shade, gloss) + behind, 0, 1)
    image, seen = change((whole, mask))
    levels = scenes.levels(colour.linear_to_srgb(image))
    if change is FLAWS["JPEG of quality 70"]:
        levels = scenes.jpeg(levels[0], 70)[None]
    parts = dichromatic.split(levels.astype(np.float32) / 255, seen)
    inside = (mask >= 1) & (seen > 0) & (whole.max(-1, keepdims=True) < 1)
    if not inside.any() or not parts.trusted.any():
        return None
    true_diffuse = m_d.mean() * shade[inside]
    true_grey = (m_s * gloss + m_a)[inside]
    chroma = (m_d - m_d.mean())[0]
    cosine = parts.hue[0] @ chroma / np.linalg.norm(chroma)
    size = max(true_diffuse.mean(), 1e-6)
    return (
        float(np.abs(parts.diffuse[inside] - true_diffuse).mean() / size),
        float(np.abs(parts.grey[inside] - true_grey).mean() / (size + true_grey.mean())),
        float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
    )


def _moved(pixels: int) -> Callable[[Scene], Scene]:
    """Return a function that dilates a mask by some pixels, or erodes it by minus as many."""

    def change(scene: Scene) -> Scene:
        image, mask = scene
        sign = 1 if pixels > 0 else -1
        grown = sign * mask
        for axis in (1, 2):
            shifts = range(-abs(pixels), abs(pixels) + 1)
            grown = np.max([np.roll(grown, shift, axis) for shift in shifts], axis=0)
        return image, sign * grown

    return change


def _leaking(scene: Scene) -> Scene:
    """Let a patch of background into the mask, as large as a twentieth of the object."""
    image, mask = scene
    rows, columns = np.nonzero(mask[0, ..., 0] == 0)
    if not len(rows):
        return scene
    middle = len(rows) // 2
    distance = np.hypot(rows - rows[middle], columns - columns[middle])
    nearest = np.argsort(distance)[: int(mask.sum() / 20)]
    leaked = mask.copy()
    leaked[0, rows[nearest], columns[nearest]] = 1
    return image, leaked


def _tinted(cast: float) -> Callable[[Scene], Scene]:
    """Return a function that errs in white balance, red over blue, by a share."""

    def change(scene: Scene) -> Scene:
        gains = camera_law.balance(
            np.array([[np.log1p(cast), 0, 0, 0]]), camera_law.places(scene[0].shape[1])
        )
        return np.clip(scene[0] * gains, 0, 1), scene[1]

    return change


FLAWS: dict[str, Callable[[Scene], Scene]] = {
    "none": lambda scene: scene,
    "5 % of background in the mask": _leaking,
    "mask eroded by 2 pixels": _moved(-2),
    "mask dilated by 2 pixels": _moved(2),
    "JPEG of quality 70": lambda scene: scene,
    **{f"light off grey by {cast} %": _tinted(cast / 100) for cast in (2, 5, 10, 20)},
}
"""Function of each flaw, by name; JPEG comes after 8-bit levels."""


if __name__ == "__main__":
    main()
