"""What every command shares: exit statuses, errors told in one line, argument types, a bar.

0 done, 1 something failed (and is said on standard error), 2 wrong usage, 130 interrupted.
"""

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tqdm import tqdm

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


def count(text: str) -> int:
    """Parse an option that counts: a whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not at least 1")
    return value


def names(known: Sequence[str]) -> Callable[[str], tuple[str, ...]]:
    """Return what parses an option of comma-separated names, each of them known."""

    def parse(text: str) -> tuple[str, ...]:
        named = tuple(part.strip() for part in text.split(","))
        unknown = [name for name in named if name not in known]
        if unknown:
            raise argparse.ArgumentTypeError(
                f"unknown: {', '.join(unknown)}; choose from {', '.join(known)}"
            )
        return named

    return parse


class Bar:
    """A progress bar that appears with the first news; what was done before does not count.

    Args:
        title: of what is being done.
        unit: what is counted, in the singular.
    """

    def __init__(self, title: str, unit: str):
        self._title, self._unit = title, unit
        self._bar: tqdm | None = None

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def move(self, done: int, total: int, told: Mapping[str, str] | None = None) -> None:
        """Show that `done` of `total` are there, and behind that what else is told, by name."""
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                desc=self._title, unit=self._unit, initial=done, total=total, dynamic_ncols=True
            )
        if told:
            self._bar.set_postfix(told, refresh=False)
        self._bar.update(done - self._bar.n)
        if done == total:
            self._bar.close()


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
