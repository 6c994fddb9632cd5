"""A run over many photos with one model: a photo is estimated while one before it is written."""

import contextlib
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from lime_keras.estimate import files, interchange
from lime_keras.estimate.estimator import Estimator
from lime_keras.estimate.results import Results
from lime_keras.estimate.terminal import Printer
from lime_keras.io import normal_map, photo
from lime_keras.io.scanner import AmbiguousName, mask_beside, of_photo
from lime_keras.lighting import guessed_light, illumination
from lime_keras.material import Material
from lime_keras.optics import colour

_WAITING = 1 << 20
"""Largest number of pixels (about 100 MB) that wait to be written while the networks go on."""

Clone = Callable[..., np.ndarray]
"""A renderer of clones: puts another shape of the same material in the object's place.

It takes the photo `(H, W, 3)`, sRGB in [0, 1], the mask `(H, W, 1)` in [0, 1], the material, the
light `(h, 2 h)`, linear radiance; by name `alpha`, the photo's transparency `(H, W, 1)`, or None.
It returns the changed photo, `(H, W, 3)` or, with transparency, `(H, W, 4)`.
"""


class _Input(NamedTuple):
    """A photo that was read, its mask if it has one, and its result's name and provenance."""

    path: Path
    name: str
    provenance: dict[str, Any]
    photo: photo.Photo
    mask: np.ndarray | None


class Batch:
    """A run over many photos, with its times.

    Args:
        results: folder for the files, and what this run makes them with.
        printer: what prints the results.
        masks: mask of the only photo, or folder with a mask of the same name for each photo; None
            to use `NAME_mask.png` beside a photo, its alpha channel, or else SegmentationNet.
        normals: file with the normals of the only photo (`normal_map.read`), or folder with a file
            of the same name for each photo; None to guess them (`guessed_light.estimate`).
        clone: renderer of another shape in the object's place. With it or with normals, the light
            of each photo is written as well, as `NAME-environment.exr` and `.png`.

    Attributes:
        finished: content of the JSON of each photo that this run has estimated, by name.
    """

    def __init__(
        self,
        results: Results,
        printer: Printer,
        *,
        masks: Path | None = None,
        normals: Path | None = None,
        clone: Clone | None = None,
    ):
        self._results, self._printer, self._masks = results, printer, masks
        self._normals, self._clone = normals, clone
        # One photo's files are written while the networks look at the next.
        self._writer = ThreadPoolExecutor(1)
        self._written: deque[tuple[_Input, Future[tuple[dict[str, Any], list[str]]]]] = deque()
        self._seconds = {"reading": 0.0, "networks": 0.0, "writing": 0.0}
        self._subnetworks: list[str] = []
        self.finished: dict[str, dict[str, Any]] = {}

    def check_names(self, photos: Iterable[Path]) -> None:
        """Raise ValueError if a mask or normals could be meant for several photos."""
        for folder in (self._masks, self._normals):
            if folder is None or not folder.is_dir():
                continue
            owner: dict[Path, Path] = {}
            for path in photos:
                try:
                    file = of_photo(path, folder)
                except AmbiguousName:
                    raise
                except ValueError:
                    continue  # reported when its turn comes
                other = owner.setdefault(file, path)
                if other.parent != path.parent:
                    raise AmbiguousName(
                        f"{file} could be meant for {other} and for {path}: put the files of "
                        f"{folder} into folders named as those of the photos"
                    )

    def provenance(self, path: Path) -> dict[str, Any]:
        """Return what the result of a photo depends on (`Results.provenance`)."""
        beside = {"mask": self._mask_file(path)}
        if self._normals is not None:
            beside["normals"] = _file_for(path, self._normals)
        return self._results.provenance(path, {name: file for name, file in beside.items() if file})

    def run(self, estimator: Estimator, photos: Mapping[str, Path]) -> None:
        """Estimate photos by the names of their results; write files, and print numbers."""
        try:
            with tqdm(total=len(photos), unit="photo", delay=2, disable=None) as bar:
                for _ in self._estimate(estimator, photos):
                    bar.update()
        finally:
            self._writer.shutdown(cancel_futures=True)
            # What was written when the run was interrupted is there, too.
            self.finished |= {
                one.name: written.result()[0]
                for one, written in self._written
                if not (written.cancelled() or written.exception())
            }

    def timing(self) -> str:
        """Return the mean times of a photo, and which subnetworks took part, in words."""
        count = max(1, len(self.finished))
        each = {name: f"{1000 * s / count:.0f} ms" for name, s in self._seconds.items()}
        return (
            f"a photo took {each['networks']} in the networks "
            f"({', '.join(self._subnetworks) or 'none'}), {each['reading']} to read, "
            f"{each['writing']} to write"
        )

    def _mask_file(self, path: Path) -> Path | None:
        """Return the file of a photo's mask; None if it has none."""
        return mask_beside(path) if self._masks is None else _file_for(path, self._masks)

    def _read(self, path: Path) -> tuple[photo.Photo, np.ndarray | None]:
        """Read a photo and its mask; None if it has none."""
        read = photo.load(path)
        file = self._mask_file(path)
        if file is None:
            # Without a file of its own, the mask is the photo's transparency.
            return read, read.alpha
        mask = photo.read_mask(file, *read.image.shape[:2])
        if self._masks is None:
            tqdm.write(f"{file} is taken as the mask of {path}", file=sys.stderr)
        return read._replace(alpha=None), mask

    def _estimate(self, estimator: Estimator, photos: Mapping[str, Path]) -> Iterator[None]:
        """Estimate photos and write their files, and yield after each; report unreadable ones."""
        is_searched = False
        for name, path in photos.items():
            begun = time.perf_counter()
            try:
                # Hashed first: a file that is replaced meanwhile must not pass for what was read.
                one = _Input(path, name, self.provenance(path), *self._read(path))
            except (ValueError, OSError, MemoryError) as error:
                self._fail(path, error)
                yield
                continue
            finally:
                self._seconds["reading"] += time.perf_counter() - begun
            is_searched |= one.mask is None
            self._subnetworks = [
                name for name in estimator.subnetworks if name != "segmentation" or is_searched
            ]
            begun = time.perf_counter()
            with _naming_photo(path):
                material = estimator.estimate(one.photo, one.mask)
            self._seconds["networks"] += time.perf_counter() - begun
            self._written.append((one, self._writer.submit(self._write, one, material)))
            yield from self._finish(_WAITING)
        yield from self._finish(0)

    def _finish(self, most: int) -> Iterator[None]:
        """Wait until no more than `most` pixels are to be written, and yield after each photo."""
        while sum(one.photo.image[..., 0].size for one, _ in self._written) > most:
            one, written = self._written[0]  # stays there if the wait is interrupted
            try:
                with _naming_photo(one.path):
                    numbers, remarks = written.result()
            except ValueError as error:
                self._written.popleft()
                self._fail(one.path, error)
            else:
                self._written.popleft()
                self.finished[one.name] = numbers
                self._printer.result(numbers, self._results.json(one.name).parent, remarks)
            yield

    def _write(self, one: _Input, material: Material) -> tuple[dict[str, Any], list[str]]:
        """Write the files of an estimate; return the content of its JSON, and remarks on it."""
        begun = time.perf_counter()
        with self._results.writing(one.name, one.provenance) as draft:
            folder, stem = draft.folder, Path(one.name).name
            files.write_pictures(folder, stem, material)
            files.write_formats(folder, stem, material)
            draft.numbers = {"photo": str(one.path)} | material.to_json()
            if (self._normals or self._clone) and material.mask_coverage:
                self._write_light(folder, stem, one, material)
        self._seconds["writing"] += time.perf_counter() - begun
        return draft.numbers, interchange.remarks(material)

    def _write_light(self, folder: Path, stem: str, one: _Input, material: Material) -> None:
        """Write the light that an object shows and, with a renderer, `STEM-clone.png`."""
        image, mask = one.photo.image, material.layers["mask"]
        if self._normals is None:
            light = guessed_light.estimate(image, material)
        else:
            path = _file_for(one.path, self._normals)
            normal = normal_map.read(path)
            photo.check_fits(path, "a normal map", normal.shape, *mask.shape[:2])
            light = illumination.estimate(illumination.from_material(material, normal))
        photo.write(folder / f"{stem}-environment.exr", light[..., None])
        mapped = colour.linear_to_srgb(light / (1 + light))
        photo.write(folder / f"{stem}-environment.png", mapped[..., None])
        if self._clone is not None:
            shown = self._clone(image, mask, material, light, alpha=one.photo.alpha)
            photo.write(folder / f"{stem}-clone.png", shown)

    def _fail(self, path: Path, error: Exception) -> None:
        text = str(error)
        self._printer.error(text if str(path) in text else f"{path}: {text}")


@contextlib.contextmanager
def _naming_photo(path: Path) -> Iterator[None]:
    """Name the photo for which memory was used up."""
    try:
        yield
    except MemoryError as error:
        raise MemoryError(
            f"{path} and what is estimated from it do not fit into memory: close other programs, "
            "or give a smaller copy"
        ) from error


def _file_for(path: Path, file: Path) -> Path:
    """Return a file or, of a folder, the file with the photo's name."""
    return of_photo(path, file) if file.is_dir() else file
