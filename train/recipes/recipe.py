"""What a recipe is made of: corpora, pictures, trainings and the set that they make.

A recipe is data. `train.recipes.run` carries it out.
"""

import dataclasses
import importlib
import runpy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lime_keras.model.folder import shipped

NAMES = ("best", "live", "live_adam", "nano", "uniform", "builtin")
"""The recipes that come with the package, each a module beside this one."""
_PARTS = (
    *("segmentation", "specular", "mirror", "albedo", "exponent"),
    *("reflectance_map", "material"),
)


@dataclass(frozen=True)
class Corpus:
    """A corpus, as `lime-render` renders it.

    Attributes:
        count: number of examples.
        seed: seed of everything random in it.
        size: height and width in pixels, a multiple of 32.
        meshes: whether its shapes are those of DATA/meshes; built-in shapes without.
        maps: whether its lights are made of the maps of DATA/environments; built-in rooms without.
        materials: law of the materials, for scenes that are shown as they are rendered.
        endless: share of the bodies that are random shapes; None for the usual one.
    """

    count: int
    seed: int
    size: int = 128
    meshes: bool = True
    maps: bool = True
    materials: str = "uniform"
    endless: float | None = None


@dataclass(frozen=True)
class Package:
    """A package of a public registry that holds cut-out pictures.

    Attributes:
        client: `npm` or `apt`, whose client downloads it.
        name: name of the package.
        version: its version.
        ranges: first and last name of the pictures that are used, without their suffixes, joined by
            a hyphen; names of another length are left out. All pictures are used if it is empty.
    """

    client: str
    name: str
    version: str
    ranges: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return client, name and version."""
        return f"{self.client} {self.name} {self.version}"


@dataclass(frozen=True)
class Training:
    """A run of `lime-train`.

    Attributes:
        stages: names of its stages.
        corpora: names of the recipe's corpora that it learns from together.
        steps: number of batches of each stage.
        rate: largest learning rate, which falls to 0 along half a cosine.
        photos: largest number of photos that it learns from.
        batch_size: number of examples in a batch.
        materials: laws of the albedos.
        optimizer: `muon` or `adam`. Under `muon`, MirrorNet is trained by Adam, and so are heads,
            dense layers and pretrained ones.
        start_from: name of the earlier training, or of the set that comes with the package, whose
            weights it begins with; None for fresh ones.
        freeze: subnetworks that keep these weights.
        average: momentum of the optimiser's moving average of the weights (`use_ema` of Keras),
            which takes their place at the end of a stage; None for the last weights.
        cutouts: whether SegmentationNet sees cut-outs of `Recipe.packages`, too.
        precision: of the inner layers; in bfloat16 a processor without its instructions takes some
            sixteen times as long.
        size: height and width of the networks' images; None for the recipe's.
        preset: its preset, where it is not the recipe's.
        options: further options of `lime-train`.
    """

    stages: tuple[str, ...]
    corpora: tuple[str, ...]
    steps: int
    rate: float
    photos: int
    batch_size: int = 32
    materials: tuple[str, ...] = ("uniform", "natural")
    optimizer: str = "muon"
    start_from: str | None = None
    freeze: tuple[str, ...] = ()
    average: float | None = None
    cutouts: bool = False
    precision: str = "float32"
    size: int | None = None
    preset: str | None = None
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """A recipe of a set of weights, from nothing to a folder that ships.

    Attributes:
        preset: the preset whose architecture, losses and images it has.
        corpora: corpora by name.
        trainings: trainings by name, in their order. The last one's model is the set.
        validation: the corpus of validation scenes, which alone choose; its meshes and maps are
            kept out of all others.
        size: height and width of the networks' images; None for the preset's.
        held_out: numbers of meshes and of maps on the validation side.
        packages: packages of cut-outs.
        seed: seed of the trainings, where `lime-train --seed` passes no other.
    """

    preset: str
    corpora: Mapping[str, Corpus]
    trainings: Mapping[str, Training]
    validation: Corpus
    size: int | None = None
    held_out: tuple[int, int] = (60, 15)
    packages: tuple[Package, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        """Raise ValueError if a training names what the recipe does not have."""
        before: list[str] = []
        for name, training in self.trainings.items():
            stages = (*training.stages, *training.freeze)
            parts = [part for one in stages for part in one.split("+")]
            for what, named, known in (
                ("corpus", training.corpora, self.corpora),
                ("earlier training", filter(None, [training.start_from]), [*before, *shipped()]),
                ("subnetwork", parts, _PARTS),
            ):
                if unknown := [one for one in named if one not in known]:
                    raise ValueError(
                        f"the training {name} names the {what} {unknown[0]}, and the recipe has "
                        f"{', '.join(known) or 'none'}"
                    )
            if name in shipped() or "validation" in self.corpora:
                raise ValueError(
                    f"{name if name in shipped() else 'validation'} is a name of the package: call "
                    "this training or corpus otherwise"
                )
            before.append(name)
        if not self.trainings:
            raise ValueError("a recipe without trainings makes no set: add one to `trainings`")

    @property
    def reads(self) -> dict[str, int]:
        """The folders of data that it reads, with the number of files that validation keeps."""
        every = [self.validation, *self.corpora.values()]
        places = bool(self.packages) and any(one.cutouts for one in self.trainings.values())
        read = any(one.meshes for one in every), places or any(one.maps for one in every)
        folders = zip(("meshes", "environments"), self.held_out, read, strict=True)
        return {folder: count for folder, count, is_read in folders if is_read}

    def scaled(self, factor: float) -> "Recipe":
        """Return the recipe with `factor` times the batches, photos and examples, for a trial.

        Each corpus keeps at least 40 examples, so that it has some for validation.
        """

        def times(number: int, least: int = 1) -> int:
            return max(least, round(number * factor))

        def corpus(one: Corpus) -> Corpus:
            return dataclasses.replace(one, count=times(one.count, 40))

        return dataclasses.replace(
            self,
            corpora={name: corpus(one) for name, one in self.corpora.items()},
            validation=corpus(self.validation),
            trainings={
                name: dataclasses.replace(
                    one, steps=times(one.steps), photos=times(one.photos, one.batch_size)
                )
                for name, one in self.trainings.items()
            },
        )


def find(name: str) -> Recipe:
    """Return the recipe of that name, or of a user's file.

    Args:
        name: one of `NAMES`, or the path of a Python file that defines `RECIPE`. The file is run.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if it is neither, or the file defines no recipe.
    """
    if not name.endswith(".py"):
        if name not in NAMES:
            raise ValueError(
                f"no recipe {name}: there are {', '.join(NAMES)}, or pass a file such as my.py"
            )
        return importlib.import_module(f"{__package__}.{name}").RECIPE
    path = Path(name)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: pass a recipe's file, or {', '.join(NAMES)}")
    try:
        recipe = runpy.run_path(str(path)).get("RECIPE")
    except Exception as error:  # whatever a user's lines raise
        raise ValueError(f"{path} is no recipe: {type(error).__name__}: {error}") from error
    if not isinstance(recipe, Recipe):
        raise ValueError(f"{path} defines no RECIPE: see docs/how-to/recipes.md for what it is")
    return recipe
