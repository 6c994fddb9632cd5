"""What every command shares: exit statuses, and errors told in one line.

0 done, 1 something failed (and is said on standard error), 2 wrong usage, 130 interrupted.
"""

import contextlib
import os
import sys
from collections.abc import Callable, Iterator

_EXPECTED = (OSError, ValueError, RuntimeError)


def run(command: Callable[[], int], interrupted: str) -> int:
    """Run a command's work and turn its expected errors into a line and an exit status.

    Args:
        command: does the work and returns the exit status.
        interrupted: what to tell a user who pressed Ctrl-C.
    """
    try:
        return command()
    except KeyboardInterrupt:
        print(f"\ninterrupted: {interrupted}", file=sys.stderr)
        return 130
    except _EXPECTED as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except Exception as error:
        # TensorFlow's own, told by name so that it need not be imported: a damaged record, say.
        if not type(error).__module__.startswith("tensorflow"):
            raise
        first_line = str(error).splitlines()[0]
        print(f"error: TensorFlow: {first_line} ({type(error).__name__})", file=sys.stderr)
        return 1


def import_tensorflow() -> None:
    """Import TensorFlow and start its runtime without the log lines it prints on every machine."""
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    with _standard_error_closed():
        import tensorflow as tf

        if os.environ.get("KERAS_BACKEND", "tensorflow") != "tensorflow":
            # Only reading is left to TensorFlow, which would take the GPU's memory for itself.
            tf.config.set_visible_devices([], "GPU")
        tf.constant(0)


@contextlib.contextmanager
def _standard_error_closed() -> Iterator[None]:
    """Send file descriptor 2, to which C++ writes past `sys.stderr`, nowhere for a while."""
    sys.stderr.flush()
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
