"""The writing of a corpus' shards: records, and last the sidecar with their checksum."""

from collections.abc import Iterable, Sequence
from typing import Any

import tensorflow as tf

from lime_keras.data.corpus import Split
from lime_keras.io import atomic, untrusted

from ..jobs import nodes, resuming


def write(
    split: Split,
    shard: int,
    records: Iterable[bytes],
    packages: Sequence[str],
    failures: Sequence[dict[str, Any]] = (),
) -> None:
    """Write a shard completely or not at all, and last its sidecar.

    Args:
        split: the split.
        shard: number of the shard.
        records: its serialised examples.
        packages: names of packages on whose versions its bytes may depend.
        failures: what was replaced; read after the last record.

    Raises:
        RuntimeError: if the shard cannot be written, for example because the disk is full.
    """
    path, written = split.shard_path(shard), 0
    try:
        # `shared`: a node that was taken for lost may still be writing the same shard.
        with atomic.replacing(path, shared=True) as partial:
            with tf.io.TFRecordWriter(str(partial)) as writer:
                for record in records:
                    writer.write(record)
                    written += 1
            digest = untrusted.sha256(partial)
        sidecar = {
            "examples": written,
            "sha256": digest,
            "failures": list(failures),
            "packages": nodes.versions(packages),
        }
        resuming.write_json(split.sidecar_path(shard), sidecar, shared=True)
    except (tf.errors.OpError, OSError) as error:
        raise RuntimeError(
            f"{path} cannot be written ({error}): make room or mend the folder. Finished shards "
            "are kept, and the same command goes on"
        ) from error
