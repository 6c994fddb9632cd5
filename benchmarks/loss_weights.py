"""The effect of the loss terms' weights: a run is trained again with one weight changed.

    python benchmarks/loss_weights.py CORPUS RUN --out DIR [--terms compositing] [--factors 0.2 5]

RUN is a finished run of `lime-train`. Its stages without the changed term are reused; the others
are trained again with the same config. Prints the held-out loss terms, unweighted, at the end of
the last stage. Runs that are already in DIR are not trained again.
"""

import argparse
import csv
import dataclasses
from pathlib import Path

from tqdm import tqdm

from lime_keras.train import trainer
from lime_keras.train.config import Config
from lime_keras.train.stage_training import Progress
from lime_keras.train.terms import TERMS


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("corpus", type=Path)
    parser.add_argument("run", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--terms", nargs="+", default=["compositing"])
    parser.add_argument("--factors", nargs="+", type=float, default=[0.2, 5.0])
    options = parser.parse_args()
    config = Config.read(options.run)
    chosen = dict(TERMS)
    rows = {"as chosen": _last_row(options.run)}
    for term in options.terms:
        for factor in options.factors:
            weight = chosen[term].weight * factor
            TERMS.update(chosen | {term: dataclasses.replace(chosen[term], weight=weight)})
            name = f"{term} × {factor:g}"
            run = options.out / f"{term}-{factor:g}"
            _train(name, options.corpus, run, config, options.run)
            rows[name] = _last_row(run)
    terms = list(rows["as chosen"])
    print("| weights | " + " | ".join(terms) + " |")
    print("|---|" + "---:|" * len(terms))
    for name, row in rows.items():
        print(f"| {name} | " + " | ".join(f"{row[term]:.4f}" for term in terms) + " |")


def _train(name: str, corpus: Path, run: Path, config: Config, reuse: Path) -> None:
    with tqdm(desc=name, unit="step") as bar:

        def tell(_: Progress) -> None:
            bar.update()

        trainer.train([corpus], run, config, tell, reuse=reuse)


def _last_row(run: Path) -> dict[str, float]:
    """Return the held-out loss terms, by name, at the end of a run's last stage."""
    path = max((run / "curves").iterdir())
    with path.open(newline="", encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    prefix = "validation_"
    return {
        name.removeprefix(prefix): float(value)
        for name, value in last.items()
        if name.startswith(prefix) and name != "validation_loss"
    }


if __name__ == "__main__":
    main()
