"""The accuracy of sets of weights on the test split of a corpus, beside the best blind answer.

    python benchmarks/accuracy.py CORPUS --weights uniform --record accuracy-uniform

Prints the measures of `lime-eval CORPUS --weights SET` for each set, also with the true mask. What
was measured is kept in `results/accuracy`, so that a repeated command goes on where it was stopped.
"""

import argparse
from pathlib import Path

import record

from lime_keras import console
from lime_keras.eval import kept
from lime_keras.eval.accuracy import measures
from lime_keras.eval.markdown_table import ABSENT, aligned
from lime_keras.model import folder as model_folder

CODE = 1
CHANCE = "chance"


def main() -> None:
    """Measure the sets and print their table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path)
    options.add_argument("--weights", nargs="+", default=["live"], help="runs, or sets that ship")
    record.add_option(options)
    arguments = options.parse_args()
    console.import_tensorflow()
    results = record.ROOT / "results" / f"accuracy-{CODE}"
    columns: dict[str, dict[str, record.Figure]] = {}
    for name in arguments.weights:
        evaluated = kept.evaluation(results, model_folder.find(name), arguments.corpus)
        summary = measures.summarise(evaluated)
        columns[name] = {
            measure: record.Figure(
                summary[measure], tuple(summary["interval"][measure]), summary["count"]
            )
            for measure in measures.MEASURES
            if measure in summary
        }
        columns[f"{name}, true mask"] = {
            measure: record.Figure(value, None, summary["count"])
            for measure, value in summary["true_mask"].items()
        }
        columns.setdefault(CHANCE, {}).update(
            (measure, record.Figure(value, None, summary["count"]))
            for measure, value in summary["chance"].items()
        )
    print(_table(columns))
    if arguments.record:
        record.write(
            arguments.record, columns, code=CODE, weights=arguments.weights, corpus=arguments.corpus
        )


def _table(columns: record.Columns) -> str:
    lines = [["measure", *columns]]
    for name, measure in measures.MEASURES.items():
        form = ".1%±" if measure.unit == measures.PER_CENT else ".3f±"
        figures = [of.get(name) for of in columns.values()]
        lines.append(
            [measure.title, *(ABSENT if one is None else f"{one:{form}}" for one in figures)]
        )
    return aligned(lines)


if __name__ == "__main__":
    main()
