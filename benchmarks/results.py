"""Measure again what no longer fits its file in docs/results: `make results DATA=folder`.

    python benchmarks/results.py [DATA] [--list]

Each file names the weights, the corpus and the number of the benchmark (`CODE`) that it was
measured with. Where one of these differs, the file's command is run in the folder DATA, which holds
the corpora by their names. A benchmark writes its file at its end, so that a command which was
stopped goes on with the files that are left. `--list` only names them.
"""

import argparse
import ast
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import record

from lime_keras.model import folder as model_folder


def main() -> int:
    """Name the files that no longer fit, and measure them again; return the exit status."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("data", type=Path, nargs="?", default=Path(), help="folder of the corpora")
    options.add_argument("--list", action="store_true", help="only name what no longer fits")
    arguments = options.parse_args()
    failed = False
    for path in sorted(record.FOLDER.glob("*.json")):
        content = record.read(path)
        command = shlex.split(content["command"])
        reasons = list(differences(content, arguments.data))
        print(f"{path.stem} ({content['commit']}): {'; '.join(reasons) or 'current'}", flush=True)
        if not reasons or arguments.list:
            continue
        if content["code"] is None:
            print(f"  by hand: {content['command']}")
            continue
        script = record.ROOT / command[1]
        done = subprocess.run([sys.executable, script, *command[2:]], cwd=arguments.data)
        failed |= done.returncode != 0
    return int(failed)


def differences(content: Mapping[str, Any], data: Path) -> Iterator[str]:
    """Yield what differs between a file and the present: the code, weights, or the corpus.

    Args:
        content: what `record.read` returns.
        data: folder of the corpora and runs; one that is not there counts as unchanged.
    """
    _, script, *rest = shlex.split(content["command"])
    if content["code"] is not None and (now := code(record.ROOT / script)) != content["code"]:
        yield f"{script} is number {now}, and was {content['code']}"
    for name, digest in content["weights"].items():
        model = model_folder.find(name)
        model = model if name in model_folder.shipped() else data / model
        is_there = (model_folder.folder(model) / model_folder.ARCHITECTURE).is_file()
        if is_there and model_folder.digest(model) != digest:
            yield f"the weights {name} are others"
    if content["corpus"] is not None and rest and (data / rest[0]).is_dir():
        if record.digest(data / rest[0]) != content["corpus"]:
            yield f"{rest[0]} is another corpus"


def code(script: Path) -> int | None:
    """Return the number `CODE` of a benchmark, without running it; None if it has none."""
    for node in ast.parse(script.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "CODE":
            return int(ast.literal_eval(node.value))
    return None


if __name__ == "__main__":
    sys.exit(main())
