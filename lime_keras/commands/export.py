"""`lime-export`: write a model as SavedModel, ONNX, weights of half the size, or graphs."""

import argparse
from pathlib import Path

from lime_keras import console
from lime_keras.commands import model_option
from lime_keras.io import model_folder
from lime_keras.outputs import OUTPUTS
from lime_keras.version import __version__

_PRECISIONS = ("float32", "float16", "int8")

_EXAMPLE = """
examples:
  lime-export exported --format onnx --weights runs/quickstart
  lime-export exported --format onnx --weights runs/quickstart --precision int8 --corpus corpus
  lime-export exported --format savedmodel --weights runs/quickstart --only mask
  lime-export small --format weights --weights runs/quickstart

What is written takes `image` (B, S, S, 3), sRGB in [0, 1], any B, and answers the named outputs:
  OUT/lime.onnx, OUT/lime-float16.onnx, OUT/lime-int8.onnx
      with the version, architecture, colour space, units and bins as the file's properties;
  OUT/saved_model/1/
      with the same in assets.extra/lime.json. The signature serving_default answers everything, and
      each output has one of its own name, which computes no more than it needs.
  OUT/model/
      the weights in float16, half as large, for --weights OUT of every command.
  OUT/onnx/
      --format graphs: an ONNX file for each subnetwork. lime-estimate runs them where OUT is RUN,
      and makes them itself where they are missing or of other weights.
With --only, the outputs are in the name: OUT/lime-mask.onnx, OUT/saved_model-mask/1/. So it takes
the place of no fuller model.

It is run on fresh images, extremes among them, and compared with Keras: what is printed is the
largest difference of each output (above 1 relative) in float32, and the mean difference over the
output's mean magnitude otherwise. It is kept only if that is small.

TensorFlow Serving loads the SavedModel, and answers POST requests to
http://localhost:8501/v1/models/lime:predict such as {"signature_name": "mask", "instances": [...]}:
  tensorflow_model_server --rest_api_port=8501 --model_name=lime \\
      --model_base_path=$PWD/exported/saved_model
  docker run -p 8501:8501 -v $PWD/exported/saved_model:/models/lime -e MODEL_NAME=lime \\
      tensorflow/serving
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = argparse.ArgumentParser(
        prog="lime-export",
        description="Write a trained model as TensorFlow SavedModel, as ONNX, as weights of half "
        "the size, or as the graphs that lime-estimate runs, and prove it equal.",
        epilog=_EXAMPLE,
        formatter_class=console.Help,
    )
    out.add_argument("out", type=Path, metavar="OUT", help="folder to write to")
    out.add_argument("--format", choices=("savedmodel", "onnx", "weights", "graphs"), required=True)
    model_option.add(out)
    out.add_argument(
        "--only",
        type=console.names(tuple(OUTPUTS)),
        metavar="NAMES",
        help=f"comma-separated outputs: {', '.join(OUTPUTS)} (default: all that RUN has)",
    )
    out.add_argument(
        "--precision",
        choices=_PRECISIONS,
        help="of an ONNX model's weights and layers; images and answers are float32 in any case "
        "(default: float32; of --format weights, float16)",
    )
    out.add_argument(
        "--corpus",
        type=Path,
        metavar="CORPUS",
        help="of lime-render: compare on 64 pictures of its test split, too; 64 of its train split "
        "calibrate int8, which needs them",
    )
    out.add_argument("--version", action="version", version=__version__)
    return out


def main(argv: list[str] | None = None) -> int:
    """Export a model and return the exit status."""
    command = parser()
    options = command.parse_args(argv)
    if options.format != "onnx" and options.precision is not None:
        command.error("--precision is for --format onnx")
    if options.precision == "int8" and options.corpus is None:
        command.error("--precision int8 is calibrated on pictures: pass --corpus CORPUS")
    return console.run(lambda: _export(options), "nothing was left half-written in its place")


def _export(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    console.require("lime-export", *console.EXPORTING)
    console.import_tensorflow()
    from lime_keras.export.exporter import PRECISIONS, export, target

    precision = options.precision or PRECISIONS[options.format][0]
    differences = export(
        options.out,
        options.format,
        options.weights or model_folder.SHIPPED,
        options.only,
        precision=precision,
        corpus=options.corpus,
    )
    path = target(options.out, options.format, precision, options.only)
    size = sum(file.stat().st_size for file in [path, *path.rglob("*")] if file.is_file())
    means = "largest difference" if precision == "float32" else "mean difference over magnitude"
    print(f"{path}, {precision}, {size / 2**20:.1f} MiB; {means} from Keras:")
    print(" " * 30 + "".join(f"{name:>12s}" for name in differences))
    for name in differences["extremes"]:
        row = "".join(f"{found[name]:12.1e}" for found in differences.values())
        print(f"  {name:28s}{row}")
    return 0
