"""The verification of a split on disk against its manifest, for `lime-render verify`.

Every shard is read, hashed and decoded; memory holds a few examples at a time. The verification
goes on after a fault and reports all faults.
"""

import functools
import itertools
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import tensorflow as tf

from lime_keras import processors
from lime_keras.data import records
from lime_keras.data.corpus import SPLITS, Split
from lime_keras.io import untrusted

from ..jobs import inputs
from . import record_checks

Fault = tuple[str, str]
"""A fault: its kind, in a word, and a text that begins with the file that it is in."""

_AHEAD = 16  # number of records per thread that are held in memory at once
_BUILT_IN = re.compile(r"room-\d{4,}\.exr|sky-\d{4,}|endless-\d{5,}-\d{2}")
"""Names of lights and bodies that a corpus may have beside those of the user's files."""
_READ = (
    *("shards", "count", "sha256", "shapes", "lights", "inputs"),
    *("seed", "size", "shard_size", "lobe"),
)
"""Properties of a split that its manifest must record."""


def verify(corpus: Path, split: str, on_example: Callable[[int, int], None]) -> Iterator[Fault]:
    """Check one split of a corpus, files, counts, checksums, and every record; yield its faults.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        on_example: called with (done, total) as examples are read; a damaged one does not count.
    """
    files = Split(corpus, split)
    if unreadable := _unreadable(files):
        yield unreadable
        return
    yield from _manifest(files)
    if files.shards > len(files.sha256):
        return  # it may tell of a billion shards
    yield from _inputs(files)
    yield from _other_split(files)
    yield from _strays(files)
    count, shard_size, read = files.count, files.shard_size, itertools.count(1)

    def on_read() -> None:
        on_example(next(read), count)

    with ThreadPoolExecutor(processors.count()) as threads:
        for shard in range(files.shards):
            path = files.shard_path(shard)
            indices = range(shard * shard_size, min((shard + 1) * shard_size, count))
            if not path.is_file():
                yield "file", f"{path}: the shard is missing: render the split again"
                continue
            yield from _digests(path, files.sha256[shard:][:1], len(indices))
            yield from _records(path, indices, files, threads, on_read)


def _unreadable(split: Split) -> Fault | None:
    """Return the fault of a manifest that cannot be read or is not whole; else None."""
    path = split.manifest_path
    try:
        for name in _READ:
            getattr(split, name)
    except (FileNotFoundError, ValueError) as error:
        return "manifest", f"{path}: {str(error).removeprefix(f'{path} ')}"
    return None


def _manifest(split: Split) -> Iterator[Fault]:
    """Check that the manifest agrees with itself and with the description beside it."""
    path, description = split.manifest_path, split.manifest["description"]
    for name, found, expected in (
        ("split", description.get("split"), split.name),
        ("examples", split.count, description.get("count")),
        ("shards", split.shards, -(-split.count // split.shard_size)),
        ("number of checksums", len(split.sha256), split.shards),
    ):
        if found != expected:
            yield "manifest", f"{path}: {name} is {found}, expected {expected}"
    beside = split.description_path
    if not beside.is_file():
        yield "file", f"{beside}: is missing"
    elif untrusted.json_or_none(beside) != description:
        yield "manifest", f"{beside}: differs from the description in {path.name}"


def _inputs(split: Split) -> Iterator[Fault]:
    """Check that the findings agree with the manifest beside them, and names with the findings."""
    path = split.inputs_path
    try:
        findings = inputs.read(path)
    except ValueError as error:
        yield "inputs", f"{error}, and render again"
        return
    if findings is None:
        yield "inputs", f"{path}: is missing: render again"
        return
    recorded = inputs.digests(findings)
    if recorded != split.inputs:
        yield "inputs", f"{path}: differs from the inputs in the manifest: render again"
    for kind, names in (("shapes", split.shapes), ("environments", split.lights)):
        used, named = set(recorded.get(kind, {})), set(names)
        others = {name for name in named - used if not _BUILT_IN.fullmatch(name)}
        if used and (used - named or others):
            some = ", ".join(sorted((used - named) | others)[:5])
            yield "inputs", f"{path}: has other {kind} than the manifest: {some}; render again"


def _other_split(split: Split) -> Iterator[Fault]:
    """Check what the two splits may not share, or must, if the other one is complete."""
    other = Split(split.corpus, next(name for name in SPLITS if name != split.name))
    if _unreadable(other):
        return
    described = split.manifest["description"], other.manifest["description"]
    for clash in inputs.clashes(described, (split.inputs, other.inputs)):
        yield "split", f"{split.manifest_path}: {clash}"


def _strays(split: Split) -> Iterator[Fault]:
    """Check that no files of an interrupted or another run are left in the folder."""
    folder, shards = split.folder, split.shards
    known = {split.shard_path(shard) for shard in range(shards)}
    known |= {split.sidecar_path(shard) for shard in range(shards)}
    known |= {split.manifest_path, split.description_path, split.inputs_path}
    for path in sorted([*folder.glob("*"), *folder.glob("rooms/partial-*")]):
        if path.name.startswith("partial-"):
            yield "file", f"{path}: was left by an interrupted run: delete it"
        elif path.suffix in (".tfrecord", ".json") and path not in known:
            yield "file", f"{path}: is none of the split's {shards} shards: delete it"


def _digests(path: Path, listed: list[str], count: int) -> Iterator[Fault]:
    """Check the bytes and the count of a shard against the manifest and the sidecar."""
    digest = untrusted.sha256(path)
    beside = path.with_suffix(".json")
    sidecar = untrusted.json_or_none(beside)
    if listed and digest != listed[0]:
        yield "sha256", f"{path}: is {digest}, expected {listed[0]} of the manifest"
    if not isinstance(sidecar, dict):
        yield "file", f"{beside}: is missing or no JSON: it has the shard's checksum"
        return
    if digest != sidecar.get("sha256"):
        yield "sha256", f"{path}: is {digest}, expected {sidecar.get('sha256')} of its .json"
    if sidecar.get("examples") != count:
        yield "count", f"{beside}: tells {sidecar.get('examples')} examples, expected {count}"


def _records(
    path: Path,
    indices: range,
    split: Split,
    threads: ThreadPoolExecutor,
    on_read: Callable[[], None],
) -> Iterator[Fault]:
    """Check the records of a shard in several threads; each that can be read calls `on_read`."""
    lost: list[str] = []
    serialized, done = _serialized(path, lost), 0
    check = functools.partial(_check_record, split=split)
    while some := list(itertools.islice(serialized, _AHEAD * processors.count())):
        for index, found in threads.map(check, some):
            where = f"{path}, record {done}"
            if index is not None:
                on_read()
            if index not in (None, indices.start + done):
                yield "index", f"{where}: is example {index}, expected {indices.start + done}"
            for kind, what in found:
                yield kind, f"{where}: {what}"
            done += 1
    for what in lost:
        yield "record", f"{path}, record {done}: {what}"
    if done != len(indices):
        yield "count", f"{path}: holds {done} readable records, expected {len(indices)}"


def _serialized(path: Path, lost: list[str]) -> Iterator[tf.Tensor]:
    """Yield the records of a shard up to one with a wrong checksum, which `lost` gets."""
    try:
        yield from tf.data.TFRecordDataset(str(path))
    except tf.errors.DataLossError as error:
        what = f"{str(error).splitlines()[0]}: it and all after it are lost; delete the shard "
        lost.append(what + "and render the split again")


def _check_record(serialized: tf.Tensor, split: Split) -> tuple[int | None, list[tuple[str, str]]]:
    """Return the index and the faults of a record; the index is None if decoding fails."""
    try:
        example = {name: value.numpy() for name, value in _parse(serialized).items()}
    except records.DAMAGED as error:
        return None, [("record", f"cannot be decoded: {records.words(error)}")]
    return int(example["index"]), record_checks.faults(example, split)


@tf.function(input_signature=[tf.TensorSpec([], tf.string)])
def _parse(serialized: tf.Tensor) -> dict[str, tf.Tensor]:
    return records.parse(serialized)
