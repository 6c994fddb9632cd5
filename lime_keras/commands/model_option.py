"""The option `--weights`: the model that a command runs."""

import argparse

from lime_keras.model import folder as model_folder


def add(
    parser: "argparse.ArgumentParser | argparse._ArgumentGroup",
    default: str = model_folder.DEFAULT,
) -> None:
    """Add the option to a command or a group of its options.

    Its value is the folder of a model, or None if it is left out.

    Whether the folder holds a model is not checked (`model_folder.find`).

    Args:
        parser: the command, or the group.
        default: name of the set that the command uses without the option, for the help.
    """
    parser.add_argument(
        "--weights",
        type=model_folder.find,
        metavar="RUN",
        help="run of lime-train, or the name of a set that comes with the package "
        f"({', '.join(model_folder.shipped())}; default: {default})",
    )
