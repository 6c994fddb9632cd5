"""`lime-export`: SavedModel or ONNX."""

import argparse
from pathlib import Path

from lime_keras import console
from lime_keras.version import __version__

_OUTPUTS = (
    "mask",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "exponent_bin_probabilities",
    "log_exponent",
    "reflectance_map",
)

_EXAMPLE = """
examples:
  lime-export exported --format onnx --weights runs/quickstart
  lime-export exported --format savedmodel --weights runs/quickstart --only mask

Both take `image` (B, S, S, 3), sRGB in [0, 1], and answer the named outputs. The written model is
run on fresh images and compared with Keras; it is kept only if they agree.
"""


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    out = argparse.ArgumentParser(
        prog="lime-export",
        description="Write a trained model as TensorFlow SavedModel or ONNX and prove it equal.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    out.add_argument("out", type=Path, metavar="OUT", help="folder to write to")
    out.add_argument("--format", choices=("savedmodel", "onnx"), required=True)
    out.add_argument("--weights", type=Path, required=True, metavar="RUN", help="run of lime-train")
    out.add_argument(
        "--only",
        type=_names,
        metavar="NAMES",
        help=f"comma-separated outputs: {', '.join(_OUTPUTS)} (default: all that RUN has)",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Export a model; returns the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: _export(options), "nothing was left half-written in its place")


def _export(options: argparse.Namespace) -> int:
    console.import_tensorflow()
    from lime_keras.export import export

    differences = export(options.out, options.format, options.weights, options.only)
    print(f"{options.format} model in {options.out}; largest difference from Keras:")
    for name, value in differences.items():
        print(f"  {name:28s} {value:.1e}")
    return 0


def _names(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(","))
    unknown = [name for name in names if name not in _OUTPUTS]
    if unknown:
        raise argparse.ArgumentTypeError(
            f"unknown: {', '.join(unknown)}; choose from {', '.join(_OUTPUTS)}"
        )
    return names
