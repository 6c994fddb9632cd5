"""`lime-estimate`: photos and videos in, materials out."""

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lime_keras import console
from lime_keras.version import __version__

if TYPE_CHECKING:
    import numpy as np

    from lime_keras.estimate import Estimator
    from lime_keras.material import Material

_ONLY = ("mask", "specular", "mirror", "albedo", "exponent", "diffuse", "reflectance_map")
_BATCH, _BATCH_PIXELS = 8, 25_000_000
"""Photos whose networks run at once: at most so many, and some 1 GB of pixels."""

_EXAMPLE = """
examples:
  lime-estimate photo.jpg
  lime-estimate photos/ --out materials --only albedo,exponent
  lime-estimate photo.jpg --mask mask.png --weights runs/mine

Photos: JPEG, PNG, HEIC, TIFF, WebP, OpenEXR, Radiance and more, up to 50 million pixels.
The object is looked for in the whole photo and, if it is small, once more from near. A photo with
transparency brings its own mask. A file that cannot be read is told by name; the rest is done.

Each photo's numbers go to standard output and to OUT/NAME.json, and into OUT/NAME.mtl (Wavefront),
NAME.gltf (glTF 2.0, on a sphere) and NAME-mitsuba.json (a scene for mitsuba.load_dict); its layers,
of the photo's size, to NAME-LAYER.png and, of linear radiance (specular shading, mirror image; of
the baseline, its reflectance map), NAME-LAYER.exr; all in one picture is NAME-preview.png.
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
    out.add_argument(
        "photos", type=Path, nargs="+", metavar="PHOTO", help="picture, or folder of pictures"
    )
    out.add_argument(
        "--weights",
        type=Path,
        metavar="RUN",
        help="run of lime-train (default: the model that comes with the package)",
    )
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
    out.add_argument(
        "--mask",
        type=Path,
        metavar="FILE",
        help="picture of the photo's size, white where the object is, in place of looking for it; "
        "for several photos, a folder with one of the same name for each",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Estimate the material of each photo; returns the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _estimate(options), "photos done so far are in the output folder")


def _estimate(options: argparse.Namespace) -> int:
    console.import_tensorflow()
    from lime_keras import estimate_files, weights
    from lime_keras.estimate import Estimator

    photos = _photos(options.photos)
    if options.mask and not options.mask.is_dir() and len(photos) > 1:
        raise ValueError(
            f"--mask {options.mask} is one file for {len(photos)} photos: pass a folder that holds "
            "a mask of the same name for each"
        )
    estimator = Estimator(options.weights or weights.SHIPPED, options.only)
    options.out.mkdir(parents=True, exist_ok=True)
    work = _Work(options, estimator, photos, estimate_files.distinct_names(photos))
    work.run()
    print(work.summary(), file=sys.stderr)
    return 1 if work.failed else 0


class _Work:
    """The photos of one command, batch by batch, and how it went."""

    def __init__(
        self,
        options: argparse.Namespace,
        estimator: "Estimator",
        photos: list[Path],
        names: list[str],
    ):
        self._options, self._estimator = options, estimator
        self._photos, self._names = photos, names
        self._seconds = {"reading": 0.0, "networks": 0.0, "writing": 0.0}
        self._masks_looked_for = self._done = self._empty = 0
        self.failed = 0

    def run(self) -> None:
        """Estimate and write all."""
        from tqdm import tqdm

        with tqdm(total=len(self._photos), unit="photo", delay=2) as bar:
            for batch in self._batches():
                self._estimate(batch)
                bar.update(self._done + self.failed - bar.n)
            bar.update(self._done + self.failed - bar.n)

    def summary(self) -> str:
        """What was done, in one line."""
        ran = [
            name
            for name in self._estimator.subnetworks
            if name != "segmentation" or self._masks_looked_for
        ]
        each = {
            name: f"{1000 * s / max(self._done, 1):.0f} ms" for name, s in self._seconds.items()
        }
        return (
            f"{self._done} done, {self.failed} failed, {self._empty} without an object, in "
            f"{self._options.out}; a photo took {each['networks']} in the networks "
            f"({', '.join(ran) or 'none'}), {each['reading']} to read, {each['writing']} to write"
        )

    def _batches(self) -> Iterator[list[tuple[Any, ...]]]:
        """Some photos with their path, name and mask; those that cannot be read are told."""
        batch: list[tuple[Any, ...]] = []
        pixels = 0
        for path, name in zip(self._photos, self._names, strict=True):
            begun = time.perf_counter()
            try:
                image, mask = self._read(path)
            except (ValueError, OSError) as error:
                self._tell_failure(path, error)
                continue
            finally:
                self._seconds["reading"] += time.perf_counter() - begun
            if batch and pixels + image[..., 0].size > _BATCH_PIXELS:
                yield batch
                batch, pixels = [], 0
            batch.append((path, name, image, mask))
            pixels += image[..., 0].size
            if len(batch) == _BATCH:
                yield batch
                batch, pixels = [], 0
        if batch:
            yield batch

    def _read(self, path: Path) -> tuple["np.ndarray", "np.ndarray | None"]:
        """The photo and, if there is one, its mask."""
        from lime_keras import photo

        image, alpha = photo.read(path)
        masks = self._options.mask
        if masks is None:
            return image, alpha
        if masks.is_dir():
            masks = _mask_of(path, masks)
        return image, photo.read_mask(masks, *image.shape[:2])

    def _estimate(self, batch: list[tuple[Any, ...]]) -> None:
        from lime_keras import estimate_files

        paths, names, images, masks = zip(*batch, strict=True)
        self._masks_looked_for += sum(mask is None for mask in masks)
        begun = time.perf_counter()
        materials = self._estimator.estimate_many(images, masks)
        for path, name, image in zip(paths, names, images, strict=True):
            material = next(materials)
            estimated = time.perf_counter()
            text = estimate_files.write(self._options.out, name, path, image, material)
            self._tell(path, material, text)
            self._seconds["networks"] += estimated - begun
            begun = time.perf_counter()
            self._seconds["writing"] += begun - estimated

    def _tell(self, path: Path, material: "Material", text: str) -> None:
        from tqdm import tqdm

        tqdm.write(text)
        self._done += 1
        if material.mask_coverage == 0:
            self._empty += 1
            tqdm.write(
                f"warning: {path}: no object was found, so its numbers mean nothing: pass --mask, "
                "or a photo that shows it larger",
                file=sys.stderr,
            )

    def _tell_failure(self, path: Path, error: Exception) -> None:
        from tqdm import tqdm

        self.failed += 1
        told = str(error)
        tqdm.write(f"error: {told if str(path) in told else f'{path}: {told}'}", file=sys.stderr)


def _photos(given: list[Path]) -> list[Path]:
    """The files named, and all pictures of the folders named."""
    from lime_keras.photo import SUFFIXES

    out: list[Path] = []
    for path in given:
        if not path.is_dir():
            out.append(path)
            continue
        found = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        if not found:
            raise ValueError(f"{path} holds no pictures: {', '.join(SUFFIXES)} are looked for")
        out += found
    return out


def _mask_of(path: Path, folder: Path) -> Path:
    found = sorted(file for file in folder.iterdir() if file.stem == path.stem)
    if not found:
        raise ValueError(
            f"{folder} holds no mask for {path}: name it {path.stem}.png, or leave out --mask"
        )
    return found[0]


def _names(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(","))
    unknown = [name for name in names if name not in _ONLY]
    if unknown:
        raise argparse.ArgumentTypeError(
            f"unknown: {', '.join(unknown)}; choose from {', '.join(_ONLY)}"
        )
    return names
