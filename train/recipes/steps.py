"""The steps of a recipe: which command makes what, and from what, in the folder of its run."""

from dataclasses import dataclass
from pathlib import Path

from .recipe import Corpus, Recipe, Training

DATA, CUTOUTS, PLACES, EVALUATION = "data", "cutouts", "places", "eval"
"""Folders of a run: links to the data, cut-outs, pictures behind them, the evaluation."""
VALIDATION = "corpora/validation"
_PLACES_OF_A_MAP = 10


@dataclass(frozen=True)
class Step:
    """A step: a command, run in the folder of the run, so that its paths are the same anywhere.

    It writes the folder of its name.

    Attributes:
        command: the words of the command.
        product: file or folder whose presence shows, beside the step's record, that it is done.
        needs: names of the steps whose folders it reads.
        begins_with: set of the package whose weights it begins with; None for no set.
    """

    command: tuple[str, ...]
    product: str
    needs: tuple[str, ...] = ()
    begins_with: str | None = None

    def is_there(self, run: Path) -> bool:
        """Return whether the run holds what the step makes."""
        return (run / self.product).exists()


def steps(recipe: Recipe, seed: int, cutouts: bool) -> dict[str, Step]:
    """Return the steps of a recipe by name, in an order in which they can be taken.

    Args:
        recipe: the recipe.
        seed: seed of the trainings.
        cutouts: whether there are cut-outs; without, SegmentationNet learns from renders alone.
    """
    out = {
        f"corpora/{name}": _corpus(f"corpora/{name}", corpus, "train")
        for name, corpus in recipe.corpora.items()
    }
    if cutouts:
        views = ("views", f"{DATA}/environments", PLACES, "--count", str(_PLACES_OF_A_MAP))
        out[PLACES] = Step(("lime-render", *views), PLACES)
    for name, training in recipe.trainings.items():
        out[f"trainings/{name}"] = _training(recipe, name, training, seed, cutouts)
    out[VALIDATION] = _corpus(VALIDATION, recipe.validation, "test")
    out[EVALUATION] = Step(
        ("lime-eval", VALIDATION, "--weights", ".", "--out", EVALUATION),
        f"{EVALUATION}/metrics.json",
        (VALIDATION, last(recipe)),
    )
    return out


def last(recipe: Recipe) -> str:
    """Return the name of the step whose model is the set."""
    return f"trainings/{list(recipe.trainings)[-1]}"


def _corpus(folder: str, corpus: Corpus, split: str) -> Step:
    options = {
        "--split": split,
        "--count": corpus.count,
        "--seed": corpus.seed,
        "--size": corpus.size,
        "--materials": corpus.materials,
        "--shapes": f"{DATA}/meshes" if corpus.meshes else None,
        "--environments": f"{DATA}/environments" if corpus.maps else None,
        "--endless": corpus.endless,
    }
    return Step(("lime-render", folder, *_words(options)), f"{folder}/{split}/manifest.json")


def _training(recipe: Recipe, name: str, training: Training, seed: int, cutouts: bool) -> Step:
    folder, before = f"trainings/{name}", training.start_from
    earlier = f"trainings/{before}" if before in recipe.trainings else None
    corpora = tuple(f"corpora/{one}" for one in training.corpora)
    sees = cutouts and training.cutouts
    options = {
        "--out": folder,
        "--preset": training.preset or recipe.preset,
        "--stages": training.stages,
        "--steps": training.steps,
        "--rate": training.rate,
        "--batch-size": training.batch_size,
        "--photos": training.photos,
        "--materials": training.materials,
        "--optimizer": training.optimizer,
        "--average": training.average,
        "--precision": training.precision,
        "--size": training.size or recipe.size,
        "--start-from": f"./{earlier}" if earlier else before,
        "--freeze": training.freeze,
        "--cutouts": (f"{CUTOUTS}/things", PLACES) if sees else (),
        "--seed": seed,
    }
    needs = (*corpora, *([earlier] if earlier else []), *([PLACES] if sees else []))
    words = ("lime-train", *corpora, *_words(options), *training.options)
    product, begins_with = f"{folder}/model/architecture.json", None if earlier else before
    return Step(words, product, needs, begins_with)


def _words(options: dict[str, object]) -> list[str]:
    """Return options as words; those of None, or of nothing, are left out."""
    out: list[str] = []
    for name, value in options.items():
        values = value if isinstance(value, tuple) else () if value is None else (value,)
        out += [name, *map(str, values)] if values else []
    return out
