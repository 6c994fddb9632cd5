"""`lime-estimate`: photos in, materials out."""

import argparse
import json
import os
import sys
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_ONLY = ("mask", "specular", "mirror", "albedo", "exponent", "diffuse", "reflectance_map")

_EXAMPLE = """
examples:
  lime-estimate photo.jpg --weights runs/quickstart
  lime-estimate photos/*.png --weights runs/quickstart --out materials --only albedo,exponent

Each photo's numbers go to standard output and to OUT/NAME.json, its layers to OUT/NAME-LAYER.png
(mask, the photo's diffuse part) and .exr (specular shading, mirror image: linear radiance; of the
baseline, its reflectance map).
"""


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    out = argparse.ArgumentParser(
        prog="lime-estimate",
        description="Estimate mask, specular shading, mirror image, albedos and shininess of the "
        "one object in each photo.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("photos", type=Path, nargs="+", metavar="PHOTO")
    out.add_argument("--weights", type=Path, required=True, metavar="RUN", help="run of lime-train")
    out.add_argument(
        "--out", type=Path, default=Path("materials"), metavar="DIR", help="(default: materials)"
    )
    out.add_argument(
        "--only",
        type=_names,
        metavar="NAMES",
        help=f"comma-separated: {', '.join(_ONLY)}; only the subnetworks it takes are run "
        "(default: all that RUN can estimate)",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Estimate the material of each photo; returns the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _estimate(options), "photos done so far are in the output folder")


def _estimate(options: argparse.Namespace) -> int:
    console.import_tensorflow()
    from tqdm import tqdm

    from lime_keras.estimate import Estimator
    from lime_keras.photo import read_srgb

    estimator = Estimator(options.weights, options.only)
    options.out.mkdir(parents=True, exist_ok=True)
    names = _distinct_names(options.photos)
    failed = 0
    bar = tqdm(list(zip(options.photos, names, strict=True)), unit="photo", delay=2)
    for path, name in bar:
        try:
            material = estimator.estimate(read_srgb(path))
        except ValueError as error:
            failed += 1
            tqdm.write(f"error: {path}: {error}", file=sys.stderr)
            continue
        if material.mask_coverage == 0:
            tqdm.write(
                f"warning: {path}: no object was found; its numbers mean nothing",
                file=sys.stderr,
            )
        numbers = json.dumps({"photo": str(path)} | material.to_json(), indent=1)
        tqdm.write(numbers)
        _write_layers(options.out, name, material)
        partial = options.out / f"partial-{name}.json"
        partial.write_text(numbers + "\n", encoding="utf-8")
        os.replace(partial, options.out / f"{name}.json")
    return 1 if failed else 0


def _write_layers(folder: Path, name: str, material) -> None:
    """Write each layer in the format that keeps its range."""
    import numpy as np

    from lime_keras import colour, photo

    for layer, image in material.layers.items():
        if layer == "mask":
            photo.write(folder / f"{name}-mask.png", image)
        elif layer == "diffuse":
            encoded = colour.linear_to_srgb(np.clip(image, 0, 1))
            photo.write(folder / f"{name}-diffuse.png", encoded)
        else:
            photo.write(folder / f"{name}-{layer}.exr", image)
            # The eye's copy: bright parts compressed, then encoded for a screen.
            seen = colour.linear_to_srgb(image / (1 + image))
            photo.write(folder / f"{name}-{layer}.png", seen)


def _distinct_names(photos: list[Path]) -> list[str]:
    """A file stem for each photo; those of the same stem are numbered."""
    names: list[str] = []
    for path in photos:
        name, number = path.stem, 2
        while name in names:
            name, number = f"{path.stem}-{number}", number + 1
        names.append(name)
    return names


def _names(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(","))
    unknown = [name for name in names if name not in _ONLY]
    if unknown:
        raise argparse.ArgumentTypeError(
            f"unknown: {', '.join(unknown)}; choose from {', '.join(_ONLY)}"
        )
    return names
