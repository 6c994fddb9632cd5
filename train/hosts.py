"""Training by several processes under JAX, such as one on each of several machines.

All processes run the same program on their own part of each batch. Process 0 alone writes files.

Under `keras.distribution`, to create a variable or to assign a value is something that all
processes have to do together: JAX compares the value between them. A process that does so alone
waits for the others, and these wait for it at exit. `Model.save_weights` is such a case, because
Keras creates an optimiser to see which attributes optimisers have. So what process 0 does alone, it
does without the distribution (`train.devices.Devices.without_distribution`).
"""

import atexit
import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import keras
import numpy as np

_SECONDS_OF_SILENCE = 30
"""Time after which a process that is not heard of is taken for dead; then all others end."""


@contextlib.contextmanager
def joined(count: int, index: int, coordinator: str) -> Iterator[None]:
    """Join the processes that train together, for the block and until this process ends.

    If the block fails, this process ends without waiting for the others, and they then end too. If
    the processes do not find each other within five minutes, JAX ends them.

    Args:
        count: number of processes, at least 1.
        index: number of this process, from 0.
        coordinator: address `HOST:PORT` of process 0, which the others reach and which is free.

    Raises:
        ValueError: if Keras runs on another backend than JAX.
        RuntimeError: if the port is taken, or the block fails with an expected error; the message
            names the process.
    """
    if keras.backend.backend() != "jax":
        raise ValueError(
            f"--hosts needs JAX, and Keras runs on {keras.backend.backend()}: set "
            "KERAS_BACKEND=jax for each process"
        )
    import jax

    here = f"process {index} of {count}"
    print(f"{here} waits for the others at {coordinator}, five minutes at most", file=sys.stderr)
    # Else JAX takes SIGTERM for a wish to save at a common step, and no longer ends by it.
    jax.config.update("jax_enable_preemption_service", False)
    try:
        # `keras.distribution.initialize` does no more than this, and knows no time limits.
        jax.distributed.initialize(
            coordinator, count, index, heartbeat_timeout_seconds=_SECONDS_OF_SILENCE
        )
    except RuntimeError as error:
        raise RuntimeError(
            f"{here} cannot join at {coordinator}: {error}; pass the address of process 0 with a "
            "port that is free there, the same to all"
        ) from error
    try:
        yield
    except BaseException as error:
        # At its exit, JAX waits for all processes, and these may wait for this one.
        atexit.register(_end, 130 if isinstance(error, KeyboardInterrupt) else 1)
        if isinstance(error, OSError | ValueError | RuntimeError):
            raise RuntimeError(
                f"{here}: {error} (if this is of a connection, another process has ended before: "
                "its messages say why)"
            ) from error
        raise


def rank_and_size() -> tuple[int, int]:
    """Return the number of this process, from 0, and the number of all."""
    if keras.backend.backend() != "jax":
        return 0, 1
    import jax

    return jax.process_index(), jax.process_count()


def assert_same(values: Mapping[str, Any]) -> None:
    """Check that all processes say the same, and wait until all have said it.

    Args:
        values: what must be equal, by a description; as JSON takes it.

    Raises:
        ValueError: in all processes, if one of them says something else.
    """
    if rank_and_size()[1] == 1:
        return
    from jax.experimental import multihost_utils

    texts = [json.dumps(value, sort_keys=True) for value in values.values()]
    digests = [list(hashlib.sha256(text.encode()).digest()) for text in texts]
    everyone = multihost_utils.process_allgather(np.array(digests, np.uint8))
    differing = (everyone != everyone[:1]).any(axis=(0, 2))
    if differing.any():
        named = [name for name, differs in zip(values, differing, strict=True) if differs]
        raise ValueError(
            f"the processes of --hosts differ in {', '.join(named)}: give all of them the same "
            "options, data and --out, a folder that they share"
        )


def _end(status: int) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
