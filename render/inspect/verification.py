"""The verification of a split on disk against its manifest, for `lime-render verify`.

Every shard is read, hashed and decoded; memory holds a few examples at a time. The verification
goes on after a fault and reports all faults.
"""

import functools
import itertools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import tensorflow as tf

from lime_keras import processors
from lime_keras.data import records
from lime_keras.data.corpus import SPLITS, Split
from lime_keras.io import untrusted

from . import input_checks, record_checks
from .faults import Faults

_AHEAD = 16  # number of records per thread that are held in memory at once
_READ = (
    *("shards", "count", "sha256", "shapes", "lights", "inputs"),
    *("seed", "size", "shard_size", "lobe"),
)
"""Properties of a split that its manifest must record."""


def verify(corpus: Path, split: str, on_example: Callable[[int, int], None]) -> Faults:
    """Check one split of a corpus: files, counts, checksums, and every record.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        on_example: called with (done, total) as records are checked.
    """
    faults = Faults()
    files = Split(corpus, split)
    if not _is_readable(files, faults):
        return faults
    _check_manifest(files, faults)
    if files.shards > len(files.sha256):
        return faults  # it may tell of a billion shards
    input_checks.check(files.inputs_path, files.manifest, faults)
    _check_other_split(files, faults)
    _check_strays(files, faults)
    count, shard_size = files.count, files.shard_size
    expected = record_checks.Expected(
        seed=files.seed,
        size=files.size,
        lobe=files.lobe,
        shapes=frozenset(files.shapes),
        lights=frozenset(files.lights),
    )
    with ThreadPoolExecutor(processors.count()) as threads:
        for shard in range(files.shards):
            path = files.shard_path(shard)
            indices = range(shard * shard_size, min((shard + 1) * shard_size, count))
            if not path.is_file():
                faults.add("file", path, "the shard is missing: render the split again")
            else:
                _check_digests(path, files.sha256[shard:][:1], len(indices), faults)
                for done in _check_records(path, indices, expected, threads, faults):
                    on_example(min(indices.start + done, count), count)
            on_example(min(indices.stop, count), count)
    return faults


def _is_readable(split: Split, faults: Faults) -> bool:
    """Return whether the manifest can be read and is whole; else add a fault."""
    path = split.manifest_path
    try:
        for name in _READ:
            getattr(split, name)
    except (FileNotFoundError, ValueError) as error:
        faults.add("manifest", path, str(error).removeprefix(f"{path} "))
        return False
    return True


def _check_manifest(split: Split, faults: Faults) -> None:
    """Check that the manifest agrees with itself and with the description beside it."""
    path, description = split.manifest_path, split.manifest["description"]
    for name, found, expected in (
        ("split", description.get("split"), split.name),
        ("examples", split.count, description.get("count")),
        ("shards", split.shards, -(-split.count // split.shard_size)),
        ("number of checksums", len(split.sha256), split.shards),
    ):
        if found != expected:
            faults.add("manifest", path, f"{name} is {found}, expected {expected}")
    beside = split.description_path
    if not beside.is_file():
        faults.add("file", beside, "is missing")
    elif untrusted.json_or_none(beside) != description:
        faults.add("manifest", beside, f"differs from the description in {path.name}")


def _check_other_split(split: Split, faults: Faults) -> None:
    """Check that none of the user's shapes and environment maps is in both splits.

    Built-in shapes and rooms need no check: they are seeded by split. A test split under known
    lights must have those of the train split.
    """
    other = Split(split.corpus, next(name for name in SPLITS if name != split.name))
    try:
        beside = other.inputs
        known = split.light_split == other.light_split
        rooms = [(one.lights, one.seed) for one in (split, other)]
    except (FileNotFoundError, ValueError):
        return
    maps = [of_one.get("environments") for of_one in (split.inputs, beside)]
    if known and (maps[0] != maps[1] or (not maps[0] and rooms[0] != rooms[1])):
        what = f"has other lights or another seed than the {other.name} split, expected the same"
        faults.add("split", split.manifest_path, what)
    for kind in ("shapes",) if known else ("shapes", "environments"):
        # Contents are compared: files of one name may differ, and one file may have two names.
        theirs = set(beside.get(kind, {}).values())
        ours = split.inputs.get(kind, {})
        shared = sorted(name for name, digest in ours.items() if digest in theirs)
        if shared:
            faults.add(
                "split",
                split.manifest_path,
                f"{kind} {', '.join(shared[:5])} {'…' if len(shared) > 5 else ''}are in the "
                f"{other.name} split too, expected none in both",
            )


def _check_strays(split: Split, faults: Faults) -> None:
    """Check that no files of an interrupted or another run are left in the folder."""
    folder, shards = split.folder, split.shards
    known = {split.shard_path(shard) for shard in range(shards)}
    known |= {split.sidecar_path(shard) for shard in range(shards)}
    known |= {split.manifest_path, split.description_path, split.inputs_path}
    for path in sorted([*folder.glob("*"), *folder.glob("rooms/partial-*")]):
        if path.name.startswith("partial-"):
            faults.add("file", path, "was left by an interrupted run: delete it")
        elif path.suffix in (".tfrecord", ".json") and path not in known:
            faults.add("file", path, f"is none of the split's {shards} shards: delete it")


def _check_digests(path: Path, listed: list[str], count: int, faults: Faults) -> None:
    """Check the bytes and the count of a shard against the manifest and the sidecar."""
    digest = untrusted.sha256(path)
    beside = path.with_suffix(".json")
    sidecar = untrusted.json_or_none(beside)
    if listed and digest != listed[0]:
        faults.add("sha256", path, f"is {digest}, expected {listed[0]} of the manifest")
    if not isinstance(sidecar, dict):
        faults.add("file", beside, "is missing or no JSON: it vouches for the shard")
        return
    if digest != sidecar.get("sha256"):
        faults.add("sha256", path, f"is {digest}, expected {sidecar.get('sha256')} of its .json")
    if sidecar.get("examples") != count:
        faults.add("count", beside, f"tells {sidecar.get('examples')} examples, expected {count}")


def _check_records(
    path: Path,
    indices: range,
    expected: record_checks.Expected,
    threads: ThreadPoolExecutor,
    faults: Faults,
) -> Iterator[int]:
    """Check the records of a shard in several threads; yield the number of checked records."""
    read, done = _serialized(path, faults), 0
    check = functools.partial(_check_record, expected=expected)
    while some := list(itertools.islice(read, _AHEAD * processors.count())):
        for index, found in threads.map(check, some):
            where = f"{path}, record {done}"
            faults.examples += index is not None
            if index not in (None, indices.start + done):
                what = f"is example {index}, expected {indices.start + done}"
                faults.add("index", where, what)
            for kind, what in found:
                faults.add(kind, where, what)
            yield (done := done + 1)
    if done != len(indices):
        faults.add("count", path, f"holds {done} readable records, expected {len(indices)}")


def _serialized(path: Path, faults: Faults) -> Iterator[tf.Tensor]:
    """Yield the records of a shard, up to the first record with a wrong checksum."""
    dataset = iter(tf.data.TFRecordDataset(str(path)))
    for record in range(2**63):
        try:
            yield next(dataset)
        except StopIteration:
            return
        except tf.errors.DataLossError as error:
            what = f"{str(error).splitlines()[0]}: it and all after it are lost; delete the shard "
            faults.add("record", f"{path}, record {record}", what + "and render the split again")
            return


def _check_record(
    serialized: tf.Tensor, expected: record_checks.Expected
) -> tuple[int | None, list[tuple[str, str]]]:
    """Return the index and the faults of a record; the index is None if decoding fails."""
    try:
        example = {name: value.numpy() for name, value in _parse(serialized).items()}
    except records.DAMAGED as error:
        return None, [("record", f"cannot be decoded: {records.words(error)}")]
    return int(example["index"]), record_checks.faults(example, expected)


@tf.function(input_signature=[tf.TensorSpec([], tf.string)])
def _parse(serialized: tf.Tensor) -> dict[str, tf.Tensor]:
    return records.parse(serialized)
