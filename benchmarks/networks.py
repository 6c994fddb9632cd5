"""The cost of each preset's subnetworks: parameters, arithmetic, and time for one image.

    python benchmarks/networks.py --presets smoke paper --threads 2

Measures the five subnetworks and the whole system. Needs no corpus and no training: the weights are
fresh and the images noise, which does not change the time. Arithmetic is that of convolutions and
dense layers; multiplications and additions are counted separately. Times are medians, on the
processor, of the Keras model under `tf.function` and of ONNX Runtime with the same number of
threads. Each repeat runs every subnetwork once under both, so that other programs disturb all of
them alike; ratios are therefore more reliable than the times themselves. The last column has the
paper's times on a Titan Xp and, for the whole system, their sum. The conversion of the paper preset
to ONNX takes 9 GB of memory and minutes.
"""

import argparse
import math
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from tqdm import tqdm

from lime_keras.export import formats, parity
from lime_keras.networks import PRESETS, Architecture, assemble, build

TITAN_XP = {
    "segmentation": 2.83,
    "specular": 3.30,
    "mirror": 2.99,
    "albedo": 2.68,
    "exponent": 1.92,
}
"""The paper's run times of its subnetworks on a Titan Xp, milliseconds for one image."""
WHOLE = "whole system"
WARM_UP = 3  # number of rounds that are not timed, because the first rounds trace and allocate
_COUNTED = keras.layers.Conv2D | keras.layers.DepthwiseConv2D | keras.layers.Dense


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--presets", nargs="+", choices=PRESETS, default=list(PRESETS))
    options.add_argument("--threads", type=int, default=2, help="of each runtime (default: 2)")
    options.add_argument("--repeat", type=int, default=20, help="timed rounds (default: 20)")
    arguments = options.parse_args()
    tf.config.set_visible_devices([], "GPU")
    tf.config.threading.set_intra_op_parallelism_threads(arguments.threads)
    tf.config.threading.set_inter_op_parallelism_threads(1)
    cores, threads, repeat = len(os.sched_getaffinity(0)), arguments.threads, arguments.repeat
    print(f"{cores} cores, {threads} threads, untrained weights, medians of {repeat}\n")
    print(
        "| preset | subnetwork | parameters | GFLOP | Keras ms | ONNX Runtime ms "
        "| paper, Titan Xp ms |"
    )
    print("|---|---|" + "---:|" * 5)
    for preset in arguments.presets:
        networks = _networks(PRESETS[preset])
        times = _measure(networks, threads, repeat, preset)
        title = f"{preset}, {PRESETS[preset].size} × {PRESETS[preset].size}"
        for name, network in networks.items():
            print(
                f"| {title} | {name} | {_count(network.count_params())} "
                f"| {1e-9 * flop(network):.2f} | "
                + " | ".join(f"{1e3 * seconds:.1f}" for seconds in times[name])
                + f" | {TITAN_XP.get(name, sum(TITAN_XP.values())):.2f} |",
                flush=True,
            )


def _networks(architecture: Architecture) -> dict[str, keras.Model]:
    subnetworks = build(architecture)
    return {**{name: subnetworks[name] for name in TITAN_XP}, WHOLE: assemble(subnetworks)}


def _measure(
    networks: dict[str, keras.Model], threads: int, repeat: int, preset: str
) -> dict[str, np.ndarray]:
    """Return the median seconds of each network under Keras and ONNX Runtime, by name."""
    runners = {
        name: _runners(network, threads)
        for name, network in tqdm(networks.items(), f"{preset}: exporting", leave=False)
    }
    seconds: dict[str, list] = {name: [] for name in networks}
    for _ in tqdm(range(WARM_UP + repeat), f"{preset}: measuring", leave=False):
        for name, pair in runners.items():
            seconds[name].append([_seconds(run) for run in pair])
    return {name: np.median(taken[WARM_UP:], axis=0) for name, taken in seconds.items()}


def _runners(network: keras.Model, threads: int) -> tuple[Callable, Callable]:
    """Return two functions that run the network on one image of noise: Keras and ONNX Runtime."""
    serve = formats.served(network)
    rng = np.random.default_rng(0)
    shapes = {spec.name: (1, *spec.shape[1:]) for spec in serve.input_signature}
    images = {name: rng.uniform(size=shape).astype(np.float32) for name, shape in shapes.items()}
    tensors = [tf.constant(image) for image in images.values()]
    session = _session(network, threads)
    expected = serve(*tensors)
    for name, value in expected.items():
        [answer] = session.run([name], images)
        np.testing.assert_allclose(answer, value, parity.TOLERANCE, parity.TOLERANCE)
    return lambda: serve(*tensors), lambda: session.run(None, images)


def _session(network: keras.Model, threads: int) -> Any:
    import onnxruntime  # after lime_keras, which switches its telemetry off

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    # Idle threads would otherwise wait in a busy loop while TensorFlow is timed.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        formats.write_onnx(network, path)
        return onnxruntime.InferenceSession(
            path.read_bytes(), options, providers=["CPUExecutionProvider"]
        )


def _seconds(run: Callable) -> float:
    began = time.perf_counter()
    run()
    return time.perf_counter() - began


def flop(network: keras.Model) -> int:
    """Count the multiplications and additions of convolutions and dense layers for one image.

    Biases are not counted. A batch normalisation counts as 0: for inference it is folded into the
    convolution before it.

    Raises:
        ValueError: if a layer of another kind holds weights.
    """
    total = 0
    for layer in network.layers:
        if isinstance(layer, keras.Model):
            total += flop(layer)
        elif isinstance(layer, _COUNTED):
            positions = math.prod(layer.output.shape[1:-1])
            total += 2 * math.prod(layer.kernel.shape) * positions
        elif layer.weights and not isinstance(layer, keras.layers.BatchNormalization):
            kind = type(layer).__name__
            raise ValueError(f"{network.name}/{layer.name} is a {kind}: count its arithmetic too")
    return total


def _count(number: int) -> str:
    return f"{number / 1e6:.2f} M" if number >= 1e6 else f"{number / 1e3:.0f} k"


if __name__ == "__main__":
    main()
