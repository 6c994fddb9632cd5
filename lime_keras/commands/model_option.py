"""The options `--weights` and `--precision`: the model that a command runs, and its graphs."""

import argparse
from pathlib import Path

from lime_keras.model import folder as model_folder


def add(
    parser: "argparse.ArgumentParser | argparse._ArgumentGroup",
    default: Path = model_folder.DEFAULT,
) -> None:
    """Add the option to a command or a group of its options; its value is the folder of a model.

    Whether the folder holds a model is not checked (`model_folder.find`).

    Args:
        parser: the command, or the group.
        default: folder of the set that the command uses without the option.
    """
    parser.add_argument(
        "--weights",
        type=model_folder.find,
        default=default,
        metavar="RUN",
        help="run of lime-train, or the name of a set that comes with the package "
        f"({', '.join(model_folder.shipped())}; default: {default.name})",
    )


def add_precision(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Add the option `--precision` of the graphs that ONNX Runtime runs."""
    parser.add_argument(
        "--precision",
        choices=model_folder.PRECISIONS,
        default=model_folder.PRECISIONS[0],
        help="of the graphs that ONNX Runtime runs; others than float32 are written once, by "
        "`lime-export OUT --format graphs --precision int8 --weights RUN --corpus CORPUS`, and "
        "--weights is then OUT (default: float32)",
    )
