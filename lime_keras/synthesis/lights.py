"""The lights of a bank: environment maps of one size, and from where each shines most."""

from pathlib import Path

import numpy as np

from lime_keras.io import untrusted
from lime_keras.optics import environment

from . import bank

SHAPE = (256, 512)
"""Rows and columns of every map."""
KINDS = ("photograph", "room", "sky")
"""Kinds of lights: from the user's maps, path-traced rooms, skies with a sun."""
RADIANCE, LISTED = "lights/radiance.npy", "lights/lights.json"
_TRUSTED = 0.01
"""Largest relative error of the mean of a map; half floats cause less than a tenth of it."""


class LightBank:
    """The lights of a bank.

    Attributes:
        names: name of each map.
        kinds: kind of each map, one of `KINDS`.
        radiance: linear radiance, `(N, 256, 512)` float16, read from disk as it is asked for:
            equirectangular, one channel. Times `scale`, the spherical mean of each map is 1.
        scale: factor of each map, `(N,)` float32, by which the largest value of a map that has a
            tiny sun fits a half float.
        strong_direction: unit direction from which most light comes, in the map's frame, `(N, 3)`
            float32.

    Args:
        folder: folder by `lime-render bank`.

    Raises:
        FileNotFoundError: if the bank is incomplete or a file is missing.
        ValueError: if the bank is of another version, a file is cut off or broken, or a map is not
            finite, has negative values or another mean than 1.
    """

    def __init__(self, folder: Path):
        bank.manifest(folder)
        path, listed = bank.file(folder, RADIANCE), bank.file(folder, LISTED)
        again = f"delete {path.parent} and run the same `lime-render bank` again"
        try:
            entries = untrusted.read_json(listed, list)
            self.names: list[str] = [str(entry["name"]) for entry in entries]
            self.kinds: list[str] = [str(entry["kind"]) for entry in entries]
            self.scale = np.array([entry["scale"] for entry in entries], np.float32)
            strong = np.array([entry["strong_direction"] for entry in entries], np.float32)
            self.strong_direction = strong.reshape(len(entries), 3)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{listed} is broken ({error!r}): {again}") from error
        self.radiance = bank.array(path, again)
        unknown = sorted(set(self.kinds) - set(KINDS))
        if unknown:
            raise ValueError(f"{listed} names lights of kind {', '.join(unknown)}: {again}")
        expected = (len(entries), *SHAPE)
        if self.radiance.shape != expected or self.radiance.dtype != np.float16 or not entries:
            raise ValueError(
                f"{path} is {self.radiance.dtype} of {self.radiance.shape}, expected float16 of "
                f"{expected}: {again}"
            )
        for number, name in enumerate(self.names):
            if wrong := self._fault(number):
                raise ValueError(f"{path}: map {number}, {name}, {wrong}: {again}")

    def __len__(self) -> int:
        return len(self.names)

    def map(self, number: int) -> np.ndarray:
        """Return a map of spherical mean 1, linear radiance `(256, 512)` float32."""
        return self.radiance[number].astype(np.float32) * self.scale[number]

    def _fault(self, number: int) -> str | None:
        """Return what is wrong with a map, or None."""
        radiance = self.map(number)
        try:
            environment.check(radiance)
        except ValueError as error:
            return str(error)
        mean = environment.spherical_mean(radiance)
        if not abs(mean - 1) <= _TRUSTED:
            return f"has a mean of {mean:.3g}, expected 1"
        if not abs(np.linalg.norm(self.strong_direction[number]) - 1) <= 1e-3:
            return "has a strongest light without a direction"
        return None
