"""The option `--weights`, by which a command is told its model."""

import argparse

from lime_keras.io import model_folder


def add(parser: argparse.ArgumentParser) -> None:
    """Add the option to a command; its value is the folder of a model, or None if it is left out.

    Whether the folder holds a model is not checked (`model_folder.find`).
    """
    parser.add_argument(
        "--weights",
        type=model_folder.find,
        metavar="RUN",
        help="run of lime-train, or name of a set that comes with the package "
        f"({', '.join(model_folder.shipped())}; default: {model_folder.DEFAULT})",
    )
