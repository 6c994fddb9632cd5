"""The trade of speed and accuracy, as `lime-eval --tradeoff` measures it.

    python benchmarks/tradeoff.py trade --weights live best nano --record tradeoff

Stopped, it goes on. It wants quiet cores: an hour or two.
"""

import argparse
import json
import math
from pathlib import Path

import record

from lime_keras.eval import cli

CODE = 2  # since 2, graphs in eight bits have unsigned weights


def main() -> None:
    """Measure the trade, print its tables, and keep its figures."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("corpus", type=Path, help="corpus with both splits")
    options.add_argument("--weights", nargs="+", default=["live"], help="runs, or sets that ship")
    folder = Path(f"results/tradeoff-{CODE}")
    options.add_argument("--out", type=Path, default=folder, help="folder of the results")
    record.add_option(options)
    arguments = options.parse_args()
    words = [arguments.corpus, "--tradeoff", *arguments.weights, "--out", arguments.out]
    if status := cli.main(list(map(str, words))):
        raise SystemExit(status)
    figures: dict[str, dict[str, record.Figure]] = {}
    for row in json.loads((arguments.out / "tradeoff.json").read_text())["rows"]:
        use = "{kind}, {asked}, {runtime}, {precision}, {threads}".format(**row)
        of_model = figures.setdefault(row["model"], {})
        for name in {"ms", "p95_ms", "networks_ms"} & row.keys():
            of_model[f"{use}, {name}"] = record.Figure(row[name])
        scores = row.get("errors", {}) | {"score": row.get("score", math.nan)}
        for name, value in scores.items():
            of_model[f"{row['precision']}, {name}"] = record.Figure(value)
    if arguments.record:
        record.write(
            arguments.record, figures, code=CODE, weights=arguments.weights, corpus=arguments.corpus
        )


if __name__ == "__main__":
    main()
