"""The training batches of banks: scenes that are made on the device that trains."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from lime_keras.optics.material_law import UNIFORM
from lime_keras.synthesis import batches as scenes

from ..config import Config

Batch = dict[str, Any]

_ALWAYS = ("shininess",)
"""Features that are always made, so that all stages' scenes are made by one compiled function."""


class Banks:
    """Banks of geometry and lights, of which some shapes and lights are held out.

    Every scene is drawn anew from the seed and its position, light, material and photo, whatever
    the schedule does with the scenes of corpora.

    Args:
        folders: folders of complete banks.
        config: config of the run.
        rows: (k, n): the training batches hold only the k-th of n equal parts of each batch.
    """

    def __init__(self, folders: Sequence[Path], config: Config, rows: tuple[int, int]):
        self._folders, self._config, self._rows = list(folders), config, rows

    def training(self, seed: int, features: Collection[str], first_step: int) -> Iterator[Batch]:
        """Yield batches without end, from a step on; the seed determines them.

        The banks take turns.
        """
        config = self._config
        batches = scenes.training(
            self._folders,
            size=config.architecture.size,
            batch_size=config.schedule.batch_size,
            seed=seed,
            first_step=first_step,
            camera=config.camera,
            features={*features, *_ALWAYS},
            materials=config.materials or (UNIFORM,),
            rows=self._rows,
        )
        return ({name: batch[name] for name in features} for batch in batches)

    def held_out(self, features: Collection[str], batches: int) -> Iterator[Batch]:
        """Yield `batches` batches of each bank, of shapes and lights kept from training."""
        config = self._config
        for folder in self._folders:
            yield from scenes.held_out(
                folder,
                size=config.architecture.size,
                batch_size=config.schedule.batch_size,
                count=batches,
                camera=config.camera,
                features=features,
                materials=config.materials or (UNIFORM,),
            )

    def blamed(self, step: int, origins: Sequence[tuple[int, int]]) -> str:
        """Return words for scenes of a step, of these seeds and positions, and what mends them."""
        folder = self._folders[step % len(self._folders)]
        named = ", ".join(f"scene at position {index} of seed {seed}" for seed, index in origins)
        return (
            f"{named} of bank {folder}: check the bank with `lime-render verify {folder}`, or try "
            "another --seed"
        )
