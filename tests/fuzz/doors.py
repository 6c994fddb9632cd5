"""The doors: for each kind of input, what a command reads it with.

A door is called with the folder of one input, and either returns or raises. Its imports wait until
then, because the list of the doors is needed for `--help`, and each takes other libraries.
"""

import functools
import itertools
import socket
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Door:
    """A way into the program.

    Attributes:
        read: function that reads the input in a folder as a command does. It raises an error that
            a command tells in a sentence, or returns; all else is a fault.
        seeds: maker of its sound inputs (`seeds.MAKERS`).
        share: number of its inputs beside those of other doors; slow doors have fewer.
        is_named: whether what it refuses names a file; requests of the live page have none.
    """

    read: Callable[[Path], None]
    seeds: str
    share: int
    is_named: bool = True


def _file(folder: Path) -> Path:
    [path] = folder.iterdir()
    return path


# ---- pictures --------------------------------------------------------------------------------


def _photo(folder: Path) -> None:
    from lime_keras.io import photo

    photo.load(_file(folder))


def _mask(folder: Path) -> None:
    from lime_keras.io import photo

    from . import seeds

    photo.read_mask(_file(folder), seeds.HEIGHT, seeds.WIDTH)


def _normals(folder: Path) -> None:
    from lime_keras.io import normal_map

    normal_map.read(_file(folder))


def _background(folder: Path) -> None:
    import numpy as np

    from lime_keras.render.scene import backgrounds

    backgrounds.photograph(_file(folder), np.random.default_rng(0), 16)


def _environment(folder: Path) -> None:
    from lime_keras.render.scene import environments

    environments.resized(environments.read(_file(folder))[0], 2)


# ---- meshes and videos -----------------------------------------------------------------------


def _mesh(folder: Path) -> None:
    from lime_keras.render.shapes import meshes

    meshes.may_cover(meshes.read(_file(folder))[0], 0.05)


def _video(folder: Path) -> None:
    from lime_keras.io.video_reader import Footage

    with Footage(str(_file(folder))) as footage:
        for _ in itertools.islice(footage, 100):
            pass


# ---- corpora ---------------------------------------------------------------------------------


def _corpus(folder: Path) -> None:
    """Read a split as `lime-render verify` does."""
    from lime_keras.render.inspect import verification

    faults = list(verification.verify(folder, "train", lambda done, total: None))
    if faults:
        raise ValueError("\n".join(map(": ".join, faults)))


def _records(folder: Path) -> None:
    """Read a shard whose checksum fits as `lime-train` does."""
    from lime_keras.data import pipeline

    paths = sorted(folder.glob("*.tfrecord"))
    batches = pipeline.evaluation(paths, size=16, batch_size=2)
    for _ in pipeline.naming_damage(batches, paths):
        pass


def _training(folder: Path) -> None:
    """Read what a split's manifest says as `lime-train` does."""
    from lime_keras.data import pipeline
    from lime_keras.data.corpus import Split
    from lime_keras.train import config

    split = Split(folder, "train")
    pipeline.training_shards(folder)
    config.corpus_sha256([folder])
    _ = split.count, split.size, split.inputs, split.shard_size


# ---- models ----------------------------------------------------------------------------------


def _weights(folder: Path) -> None:
    from lime_keras.model import weights

    weights.load(folder)


def _graphs(folder: Path) -> None:
    """Open a model's graphs and run them; those that are described otherwise are exported anew."""
    import numpy as np

    from lime_keras.estimate.estimator import Estimator
    from lime_keras.model import folder as model_folder

    model_folder.digest(folder)
    if model_folder.read_description(model_folder.graphs(folder)):
        Estimator(folder).estimate(np.full((64, 64, 3), 99, np.uint8))


def _graph_weights(folder: Path) -> None:
    """Read the weights of graphs as Keras does."""
    from lime_keras.model import folder as model_folder
    from lime_keras.model import weights_in_graphs

    for path in sorted(model_folder.graphs(folder).glob("*.onnx")):
        weights_in_graphs.read(path.read_bytes(), path)


def _masker(folder: Path) -> None:
    import numpy as np

    from lime_keras.runtime.masker import Masker

    Masker(_file(folder))(np.full((16, 24, 3), 0.5, np.float32))


# ---- JSON ------------------------------------------------------------------------------------


def _run_file(folder: Path) -> None:
    """Read a JSON file of a run or a rendering with what reads a file of that name."""
    from lime_keras.render.jobs import inputs, resuming
    from lime_keras.train import config, summary

    folder = folder / "run"
    path = _file(folder)
    if path.name == "config.json":
        config.claim(folder, [], config.Config.read(folder))
    elif path.name == "evaluation.json":
        summary.evaluation(folder)
    elif path.name == "inputs.json":
        found = inputs.read(path)
        inputs.unusable(found)
        inputs.digests(found), inputs.repairs(found)
    elif path.name == "description.json":
        resuming.read_description(path)
    else:
        resuming.sidecar(path)


def _predictions(folder: Path) -> None:
    import numpy as np

    from lime_keras.eval.accuracy import predictions

    from . import seeds

    absent = {name: np.zeros(shape, np.float32) for name, shape in _ANSWERED.items()}
    absent |= {
        name: np.zeros((seeds.SIZE, seeds.SIZE, 1), np.float32)
        for name in ("mask", "specular_shading", "mirror")
    }
    found = predictions.find(folder)
    found.digest()
    predictions.Answers(found, 2, seeds.SIZE, absent).batch(0, 2)


_ANSWERED = {
    "diffuse_albedo": (3,),
    "specular_albedo": (1,),
    "log_exponent": (1,),
    "exponent_bin_probabilities": (8,),
}


def _results(folder: Path) -> None:
    """Go on with a folder of results as `lime-estimate` does."""
    from lime_keras.estimate import gallery
    from lime_keras.estimate.results import Results
    from lime_keras.io import scanner

    gallery.check(folder)
    list(scanner.inside(folder))
    results = Results(folder, "0", {})
    made = {"version": "0", "weights": "0", "source": "0"}
    for name in ("one", "clip"):
        if existing := results.existing({name: lambda: made}):
            gallery.update(folder, existing)


# ---- the live page ---------------------------------------------------------------------------

_ANSWER_WITHIN = 9.0
"""Seconds; less than an input's limit, so that a silent server is told apart from a hang."""


@functools.cache
def _server() -> tuple[int, list[BaseException]]:
    """Start the server of the live page in a thread; return its port and the errors it meets."""
    from lime_keras.estimate.estimator import Estimator
    from lime_keras.live.server import LiveServer

    server, errors = LiveServer(Estimator("nano", streaming=True), 0), []
    server.handle_error = lambda *_: errors.append(sys.exception())  # it keeps them to itself
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server.server_address[1], errors


def _request(folder: Path) -> None:
    """Send a request and judge the answer: one that the server could not give is its fault."""
    port, errors = _server()
    sent = _file(folder).read_bytes().replace(b":PORT", f":{port}".encode())
    answer = b""
    errors.clear()
    with socket.create_connection(("127.0.0.1", port), _ANSWER_WITHIN) as connection:
        try:
            connection.sendall(sent)
            connection.shutdown(socket.SHUT_WR)
            while part := connection.recv(1 << 20):
                answer += part
        except ConnectionError as error:  # it was refused before its end
            raise ValueError(f"the connection was closed: {error}") from error
    if errors and not isinstance(errors[0], ConnectionError):
        raise AssertionError("the server failed and told nobody") from errors[0]
    head, _, body = answer.partition(b"\r\n\r\n")
    status = head[9:12].decode("latin-1")
    if status == "500":
        raise AssertionError(f"the server failed: {body[:1000]!r}")
    if not status.startswith("2"):
        raise ValueError(f"the server refused it: {body[:1000]!r}")


DOORS = {
    "photo": Door(_photo, "pictures", 40),
    "mask": Door(_mask, "masks", 16),
    "normals": Door(_normals, "normals", 16),
    "background": Door(_background, "backgrounds", 20),
    "environment": Door(_environment, "environments", 20),
    "mesh": Door(_mesh, "meshes", 24),
    "video": Door(_video, "clips", 12),
    "corpus": Door(_corpus, "corpora", 2),
    "training": Door(_training, "corpora", 1),
    "records": Door(_records, "records", 1),
    "weights": Door(_weights, "weights", 1),
    "graphs": Door(_graphs, "graphs", 1),
    "graph-weights": Door(_graph_weights, "graphs", 4),
    "masker": Door(_masker, "maskers", 8),
    "run": Door(_run_file, "runs", 8),
    "predictions": Door(_predictions, "predictions", 12),
    "results": Door(_results, "results", 8),
    "live": Door(_request, "requests", 8, is_named=False),
}
"""The doors by name, in the order of the table."""
