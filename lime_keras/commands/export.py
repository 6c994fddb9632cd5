"""`lime-export`: write a model as SavedModel, ONNX, weights of half the size, or graphs."""

import argparse
import os
from pathlib import Path

from lime_keras import console
from lime_keras.commands import model_option
from lime_keras.model import folder as model_folder
from lime_keras.outputs import OUTPUTS

_EXAMPLE = """
examples:
  lime-export exported --format savedmodel
  lime-export exported --format onnx --weights runs/mine
  lime-export exported --format onnx --precision int8 --corpus corpus
  lime-export exported --format onnx --only mask,diffuse_albedo
  lime-export small --format graphs --precision int8 --weights live --corpus corpus
  lime-export half --format weights --weights runs/mine

savedmodel and onnx take `image` (B, S, S, 3), sRGB in [0, 1], any B, and return the outputs by
name. The command compares every format with Keras on images that it was not made with, and prints
the differences: in float32 the largest one of each output (relative above 1), else the mean one
over the output's mean magnitude. Where they are too large, no file is written.

  format      writes                 for
  savedmodel  OUT/saved_model/1/     TensorFlow, TensorFlow Serving
  onnx        OUT/lime.onnx          ONNX Runtime; with --precision, OUT/lime-float16.onnx and so on
  weights     OUT/model/             --weights OUT of lime-train and lime-eval: half the size
  graphs      OUT/onnx/              --weights OUT of every command: an ONNX file a subnetwork; with
                                     --precision int8, OUT/onnx-int8/ beside it, for
                                     --precision int8 of lime-estimate and lime-live
With --only, the outputs are in the name: OUT/lime-mask.onnx.

More: docs/how-to/exporting.md.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = console.parser(
        prog="lime-export",
        usage="lime-export OUT --format {savedmodel,onnx,weights,graphs} [options]",
        description="Write a trained model as TensorFlow SavedModel, as ONNX, as weights of half "
        "the size, or as the graphs that lime-estimate runs, and check that it gives the same "
        "answers.",
        epilog=_EXAMPLE,
    )
    inputs = out.add_argument_group("input")
    model_option.add(inputs)
    inputs.add_argument(
        "--corpus",
        type=Path,
        metavar="CORPUS",
        help="corpus of lime-render: 64 pictures of its test split are compared, too; 64 of its "
        "train split calibrate int8, which needs them",
    )
    written = out.add_argument_group("output")
    written.add_argument("out", type=Path, metavar="OUT", help="folder to write to")
    written.add_argument(
        "--format",
        choices=("savedmodel", "onnx", "weights", "graphs"),
        required=True,
        help="see the table below",
    )
    written.add_argument(
        "--only",
        type=console.names(tuple(OUTPUTS)),
        metavar="NAMES",
        help=f"comma-separated outputs: {', '.join(OUTPUTS)} (default: all that RUN has)",
    )
    speed = out.add_argument_group("speed")
    speed.add_argument(
        "--precision",
        choices=model_folder.PRECISIONS,
        help="of the weights and layers of ONNX files; images and answers stay float32 "
        "(default: float32)",
    )
    return out


def main(argv: list[str] | None = None) -> int:
    """Export a model and return the exit status."""
    command = parser()
    options = command.parse_args(argv)
    if options.format not in ("onnx", "graphs") and options.precision is not None:
        command.error("--precision is for --format onnx and --format graphs")
    if options.precision == "int8" and options.corpus is None:
        command.error("--precision int8 is calibrated on pictures: pass --corpus CORPUS")
    return console.run(lambda: _export(options), "nothing was left half-written in its place")


def _export(options: argparse.Namespace) -> int:
    console.check_folder(options.out, "OUT")
    console.require("lime-export", *console.EXPORTING)
    os.environ["KERAS_BACKEND"] = "tensorflow"  # whose tracing writes all formats
    console.import_tensorflow()
    from lime_keras.export.exporter import FORMATS, export, target

    precision = options.precision or FORMATS[options.format].precisions[0]
    differences = export(
        options.out,
        options.format,
        options.weights,
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
        row = "".join(f"{of_images[name]:12.1e}" for of_images in differences.values())
        print(f"  {name:28s}{row}")
    return 0
