"""A run over many photos with one model, which reads, estimates and writes batch by batch."""

import contextlib
import json
import os
import sys
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

from lime_keras.estimate import files, terminal
from lime_keras.estimate.estimator import Estimator
from lime_keras.estimate.results import Results
from lime_keras.io import photo
from lime_keras.io.scanner import AmbiguousName, mask_beside, of_photo
from lime_keras.material import Material

if TYPE_CHECKING:
    from lime_keras.lighting.light_files import Clone

_BATCH, _BATCH_PIXELS = 8, 25_000_000
"""Largest number of photos, and of their pixels (about 1 GB), in one batch of the networks."""
_WAITING = 1 << 20
"""Largest number of pixels (about 100 MB) that wait to be written while the networks go on."""


class Batch:
    """A run of one model over many photos, with its counts and times.

    Args:
        estimator: model for all photos.
        results: results in the folder for the files (`files.write`), which are not made again.
        masks: mask of the only photo, or folder with a mask of the same name for each photo; None
            to use `NAME_mask.png` beside a photo, its alpha channel, or else SegmentationNet.
        light: whether to write the light of each photo as well (`light_files.write`).
        normals: file with the normals of the only photo, or folder with a file of the same name for
            each photo; None to guess the normals.
        clone: renderer of another shape in the object's place; used only with `light`.
        for_people: whether standard output gets an answer in words (`terminal.answer`) in place of
            a line of JSON; warnings are then a part of it, else they go to standard error.

    Attributes:
        finished: names of the photos that have a result, from this run or an earlier one.
        failed: number of photos that failed: they could not be read, or their light could not be
            estimated.
        empty: number of photos without an object, which have no material.
    """

    def __init__(
        self,
        estimator: Estimator,
        results: Results,
        *,
        masks: Path | None = None,
        light: bool = False,
        normals: Path | None = None,
        clone: "Clone | None" = None,
        for_people: bool = False,
    ):
        self._estimator, self._results, self._masks = estimator, results, masks
        self._light, self._normals, self._clone = light, normals, clone
        self._for_people = for_people
        # One photo's files are written while the networks look at the next.
        self._writer = ThreadPoolExecutor(1)
        self._written: deque[tuple[Path, str, int, Material, Future[dict[str, Any]]]] = deque()
        self._seconds = {"reading": 0.0, "networks": 0.0, "writing": 0.0}
        self._masks_looked_for = self._done = self._there = 0
        self.finished: list[str] = []
        self.failed = self.empty = 0

    def run(self, photos: Mapping[str, Path]) -> None:
        """Estimate photos and write their files, unless they are there already.

        The numbers go to standard output, the progress and the errors to standard error.

        Args:
            photos: path of each photo, by the name for its files, which may begin with folders.

        Raises:
            ValueError: before any photo is estimated, if a result would replace something else and
                may not (`Results.standing`).
        """
        self._check_names(photos)
        left = dict(photos)
        for name, found in self._standing(photos).items():
            del left[name]
            self.finished.append(name)
            self.empty += not found.get("mask_coverage")
            self._tell(name, found)
        self._there = len(self.finished)
        try:
            with tqdm(total=len(left), unit="photo", delay=2, disable=None) as bar:
                for _ in self._estimated(left):
                    bar.update(self._done + self.failed - bar.n)
                bar.update(self._done + self.failed - bar.n)
        finally:
            self._writer.shutdown(cancel_futures=True)
            # What was written when the run was interrupted is there, too.
            self.finished += [
                name
                for _, name, _, _, written in self._written
                if not (written.cancelled() or written.exception())
            ]

    def _check_names(self, photos: Mapping[str, Path]) -> None:
        """Raise ValueError if a mask or normals could be meant for several photos."""
        for given in (self._masks, self._normals):
            if given is None or not given.is_dir():
                continue
            owner: dict[Path, Path] = {}
            for path in photos.values():
                try:
                    file = of_photo(path, given)
                except AmbiguousName:
                    raise
                except ValueError:
                    continue  # told when its turn comes
                other = owner.setdefault(file, path)
                if other.parent != path.parent:
                    raise AmbiguousName(
                        f"{file} could be meant for {other} and for {path}: put the files of "
                        f"{given} into folders named as those of the photos"
                    )

    def _standing(self, photos: Mapping[str, Path]) -> dict[str, dict[str, Any]]:
        """Return the results that need not be made again; raise ValueError for those in the way."""
        found, conflicts = {}, []
        for name, path in photos.items():
            if not self._results.json(name).exists():
                continue
            try:
                made = self._made(path)
            except (ValueError, OSError):
                continue  # an unreadable photo is reported when its turn comes
            try:
                result = self._results.standing(name, made)
            except ValueError as error:
                conflicts.append(str(error))
                continue
            if result is not None:
                found[name] = result
        if conflicts:
            more = f" ({len(conflicts)} results are in the way)" if len(conflicts) > 1 else ""
            raise ValueError(f"{conflicts[0]}{more}")
        return found

    def _made(self, path: Path) -> dict[str, Any]:
        """Return what the result of a photo is made of and with (`Results.made`)."""
        given = {"mask": self._mask_file(path)}
        if self._normals is not None:
            given["normals"] = _belonging(path, self._normals)
        return self._results.made(path, {name: file for name, file in given.items() if file})

    def _mask_file(self, path: Path) -> Path | None:
        """Return the file of a photo's mask; None if it has none."""
        return mask_beside(path) if self._masks is None else _belonging(path, self._masks)

    def summary(self, missing: int) -> str:
        """Return counts and, if any photo was done, times of the run in one line.

        Args:
            missing: number of sources that were not there; they count as failed.
        """
        there = f"{self._there} there already, " if self._there else ""
        counts = (
            f"{self._done} done, {there}{self.failed + missing} failed, {self.empty} without an "
            f"object, in {self._results.out}"
        )
        if not self._done:
            return counts
        ran = [
            name
            for name in self._estimator.subnetworks
            if name != "segmentation" or self._masks_looked_for
        ]
        each = {name: f"{1000 * s / self._done:.0f} ms" for name, s in self._seconds.items()}
        return (
            f"{counts}; a photo took {each['networks']} in the networks "
            f"({', '.join(ran) or 'none'}), {each['reading']} to read, {each['writing']} to write"
        )

    def _batches(self, photos: Mapping[str, Path]) -> Iterator[list[tuple[Any, ...]]]:
        """Yield batches of path, name, photo and mask; report unreadable photos."""
        batch: list[tuple[Any, ...]] = []
        pixels = 0
        for name, path in photos.items():
            begun = time.perf_counter()
            try:
                read, mask = self._read(path)
            except (ValueError, OSError, MemoryError) as error:
                self._tell_failure(path, error)
                continue
            finally:
                self._seconds["reading"] += time.perf_counter() - begun
            size = read.image[..., 0].size
            if batch and pixels + size > _BATCH_PIXELS:
                yield batch
                batch, pixels = [], 0
            batch.append((path, name, read, mask))
            pixels += size
            if len(batch) == _BATCH:
                yield batch
                batch, pixels = [], 0
        if batch:
            yield batch

    def _read(self, path: Path) -> tuple[photo.Photo, np.ndarray | None]:
        """Read a photo and its mask; None if it has none."""
        read = photo.load(path)
        own = self._mask_file(path)
        if own is None:
            # Without a file of its own, the mask is the photo's transparency.
            return read, read.alpha
        mask = photo.read_mask(own, *read.image.shape[:2])
        if self._masks is None:
            tqdm.write(f"{own} is taken as the mask of {path}", file=sys.stderr)
        return read._replace(alpha=None), mask

    def _estimated(self, left: Mapping[str, Path]) -> Iterator[None]:
        """Estimate photos and write their files, and yield after each."""
        for batch in self._batches(left):
            paths, names, photos, masks = zip(*batch, strict=True)
            self._masks_looked_for += sum(mask is None for mask in masks)
            materials = self._estimator.estimate_many(photos, masks)
            for path, name, read in zip(paths, names, photos, strict=True):
                begun = time.perf_counter()
                with _naming_photo(path):
                    material = next(materials)
                self._seconds["networks"] += time.perf_counter() - begun
                written = self._writer.submit(self._write, path, name, read, material)
                self._written.append((path, name, read.image[..., 0].size, material, written))
                yield from self._settled(_WAITING)
        yield from self._settled(0)

    def _settled(self, most: int) -> Iterator[None]:
        """Wait until no more than `most` pixels are to be written, and yield after each photo."""
        while sum(pixels for _, _, pixels, _, _ in self._written) > most:
            path, name, _, material, written = self._written.popleft()
            try:
                with _naming_photo(path):
                    numbers = written.result()
            except ValueError as error:
                self._tell_failure(path, error)
            else:
                self._finish(path, name, material, numbers)
            yield

    def _write(
        self, path: Path, name: str, read: photo.Photo, material: Material
    ) -> dict[str, Any]:
        """Write the files of an estimate, and return the content of its JSON."""
        begun = time.perf_counter()
        with self._results.writing(name, self._made(path)) as draft:
            folder, stem = draft.folder, Path(name).name
            draft.numbers = files.write(folder, stem, path, read.image, material)
            if self._light and material.mask_coverage:
                # SciPy and scikit-image are large, and only the light needs them.
                from lime_keras.lighting import light_files

                normals = self._normals and _belonging(path, self._normals)
                light_files.write(
                    folder,
                    stem,
                    read.image,
                    material,
                    normals=normals,
                    clone=self._clone,
                    alpha=read.alpha,
                )
        self._seconds["writing"] += time.perf_counter() - begun
        return draft.numbers

    def _finish(self, path: Path, name: str, material: Material, numbers: dict[str, Any]) -> None:
        """Count a photo whose files are written, and print its numbers and warnings."""
        self.finished.append(name)
        self._done += 1
        self.empty += not material.mask_coverage
        remark = files.remark(material)
        self._tell(name, numbers, [remark] if remark else [])
        if self._for_people:
            return
        for message in filter(None, [remark, *(caution.message for caution in material.warnings)]):
            tqdm.write(f"warning: {path}: {message}", file=sys.stderr)

    def _tell(self, name: str, content: dict[str, Any], more: Sequence[str] = ()) -> None:
        """Print a result, given as the content of its JSON."""
        told = json.dumps(content)
        if self._for_people:
            colour = terminal.takes_colour(sys.stdout)
            told = terminal.answer(content, self._results.json(name).parent, more, colour=colour)
        tqdm.write(told)

    def _tell_failure(self, path: Path, error: Exception) -> None:
        self.failed += 1
        told = str(error)
        told = told if str(path) in told else f"{path}: {told}"
        # A name may be no UTF-8, which not every stream takes.
        tqdm.write(f"error: {os.fsencode(told).decode(errors='replace')}", file=sys.stderr)


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


def _belonging(path: Path, given: Path) -> Path:
    """Return the given file or, in a given folder, the file with the photo's name."""
    return of_photo(path, given) if given.is_dir() else given
