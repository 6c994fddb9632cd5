"""The answers of another system for a test split: a folder of files (docs/reference/benchmark.md).

An answer's files are named after the image's position in the split, from 0, in five digits.
"""

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.estimate.results import digest
from lime_keras.io import photo, untrusted
from lime_keras.optics import shininess
from lime_keras.runtime.engine import Arrays

_NUMBERS = ".json"
_LAYERS: dict[str, Callable[[Path, int, int], np.ndarray]] = {
    "-mask.png": photo.read_coverage,
    "-specular_shading.exr": photo.read_radiance,
    "-mirror.exr": photo.read_radiance,
}
"""Readers of the layers, by the ends of their files' names: `-NAME.SUFFIX`."""
_ENDS = (_NUMBERS, *_LAYERS)
_NAMES = ", ".join(f"00000{end}" for end in _ENDS)
_FILE = re.compile(rf"(\d{{5,}})({'|'.join(map(re.escape, _ENDS))})")
_VALUES = {
    "diffuse_albedo": (3, 0, 1),
    "specular_albedo": (1, 0, 1),
    "exponent": (1, 1, 1000),
    "exponent_bin_probabilities": (8, 0, 1),
}
"""Number of values, lowest and highest value of each key of a JSON that is read."""
_SUM_WITHIN = 1e-3  # deviation of the probabilities' sum from 1 that their rounding may cause
_SHOWN = 3  # number of files left out that are named
_LONGEST = 60  # largest number of characters of a wrong value in a message


@dataclass(frozen=True)
class Predictions:
    """The files of a system's answers, not yet read.

    Attributes:
        folder: folder of the files.
        files: path of each file by the position of its image and the end of its name (`_ENDS`).
        left_out: names of other files and folders in the folder, without hidden ones.
    """

    folder: Path
    files: dict[tuple[int, str], Path]
    left_out: list[str]

    def digest(self) -> str:
        """Return a hash of the names and contents of all files.

        Raises:
            OSError: if a file cannot be read.
        """
        content = {path.name: digest(path) for path in self.files.values()}
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def warning(self) -> str | None:
        """Return a sentence that names what was left out, or None."""
        if not self.left_out:
            return None
        shown, more = ", ".join(self.left_out[:_SHOWN]), len(self.left_out) - _SHOWN
        return (
            f"{self.folder}: left out what is named like no answer: {shown}"
            f"{f' and {more} more' if more > 0 else ''}; answers are called {_NAMES}"
        )


def find(folder: Path) -> Predictions:
    """Return the files of the answers in a folder, in the order of their positions.

    Raises:
        ValueError: if the folder is none or holds no answer, or if what is named like an answer is
            no file.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder: pass a folder of answers to --predictions")
    files: dict[tuple[int, str], Path] = {}
    left_out: list[str] = []
    for path in sorted(folder.iterdir()):
        named = _FILE.fullmatch(path.name)
        if named and f"{int(named[1]):05d}" == named[1]:
            untrusted.check(path, "an answer")
            files[int(named[1]), named[2]] = path
        elif not path.name.startswith("."):
            left_out.append(path.name)
    if not files:
        raise ValueError(
            f"{folder} holds no answer: name the files after the images, as in {_NAMES}"
        )
    return Predictions(folder, dict(sorted(files.items())), left_out)


class Answers:
    """The answers of a system for each image of a split, what is absent filled in.

    Args:
        predictions: files of the answers.
        count: number of images in the split.
        size: height and width of the images in pixels.
        absent: answer for images of which the system does not answer a quantity that it answers
            for others; a value for each output (`lime_keras.outputs`), without the batch axis.

    Raises:
        ValueError: if an answer lies beyond the split, or its numbers are no JSON or out of range;
            or if no file holds a quantity.
    """

    def __init__(self, predictions: Predictions, count: int, size: int, absent: Arrays):
        self._size, self._absent = size, absent
        self._numbers: list[dict[str, np.ndarray]] = [{} for _ in range(count)]
        self._layers: list[dict[str, tuple[str, Path]]] = [{} for _ in range(count)]
        for (position, end), path in predictions.files.items():
            if position >= count:
                raise ValueError(
                    f"{path} answers no image: the split has {count}, from 00000 to "
                    f"{count - 1:05d}; pass the answers for this split, or delete the file"
                )
            if end == _NUMBERS:
                self._numbers[position] = _numbers(path)
            else:
                layer = end.removeprefix("-").partition(".")[0]
                self._layers[position][layer] = end, path
        given = set().union(*self._numbers, *self._layers)
        if not given:
            raise ValueError(
                f"{predictions.folder} answers nothing: no JSON in it has one of the keys "
                f"{', '.join(_VALUES)}, and there are no layers"
            )
        self.quantities = tuple(name for name in absent if name in given)

    @property
    def answered(self) -> np.ndarray:
        """Truth values `(count,)`: whether the system answers anything for an image."""
        pairs = zip(self._numbers, self._layers, strict=True)
        return np.array([bool(numbers or layers) for numbers, layers in pairs])

    def batch(self, first: int, number: int) -> dict[str, np.ndarray]:
        """Return the answers for `number` images from position `first` on, by output.

        Each output of `quantities` has the shape and unit of a system's (`lime_keras.outputs`).

        Raises:
            ValueError: if a layer cannot be read, or has another size than the images.
        """
        each = [self._one(position) for position in range(first, first + number)]
        return {
            name: np.stack([one.get(name, self._absent[name]) for one in each])
            for name in self.quantities
        }

    def _one(self, position: int) -> dict[str, np.ndarray]:
        layers = {
            name: _LAYERS[end](path, self._size, self._size)
            for name, (end, path) in self._layers[position].items()
        }
        numbers = self._numbers[position]
        if "log_exponent" in numbers and "exponent_bin_probabilities" not in numbers:
            [own] = shininess.bin_of_log(numbers["log_exponent"]).astype(int)
            row = np.eye(shininess.BIN_COUNT, dtype=np.float32)[own]
            numbers = numbers | {"exponent_bin_probabilities": row}
        return numbers | layers


def _numbers(path: Path) -> dict[str, np.ndarray]:
    """Return the numbers of a JSON by output, float32 `(K,)`; other keys are not read."""
    with untrusted.naming(path, "an answer", "write one JSON object, or delete the file"):
        content = untrusted.read_json(path)
    numbers = {name: _checked(path, name, content[name]) for name in _VALUES if name in content}
    if "exponent" in numbers:
        numbers["log_exponent"] = np.log10(numbers.pop("exponent"))
    elif "exponent_bin_probabilities" in numbers:
        expected = shininess.log_expected(numbers["exponent_bin_probabilities"])
        numbers["log_exponent"] = np.atleast_1d(expected)
    return numbers


def _checked(path: Path, name: str, content: Any) -> np.ndarray:
    """Return the values of a key as float32 `(K,)`; raise ValueError if one is wrong."""
    count, low, high = _VALUES[name]
    values = content if isinstance(content, list) else [content]
    are_numbers = all(type(value) in (int, float) and low <= value <= high for value in values)
    if len(values) != count or isinstance(content, list) != (count > 1) or not are_numbers:
        raise ValueError(
            f"{path}: {name} is {json.dumps(content)[:_LONGEST]}, and not "
            f"{'a number' if count == 1 else f'{count} numbers'} in [{low}, {high}]: clip it, or "
            "leave it out where there is no answer"
        )
    if name == "exponent_bin_probabilities" and abs(sum(values) - 1) > _SUM_WITHIN:
        raise ValueError(f"{path}: {name} sum to {sum(values):.4g}: divide them by their sum")
    return np.array(values, np.float32)
