"""The commands as they are installed, which also report an interruption during their imports."""

import signal
import sys
import threading


def _launch(module: str) -> int:
    try:
        from importlib import import_module

        from lime_keras import console

        console.open_streams()
        status = int(import_module(f"lime_keras.{module}").main())
        if threading.current_thread() is threading.main_thread():
            # All is done: an interruption while Python ends would turn the status into a failure.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        return status
    except KeyboardInterrupt:
        print("\ninterrupted: nothing was begun", file=sys.stderr)
        return 130


def render() -> int:
    """Run `lime-render`."""
    return _launch("render.cli")


def train() -> int:
    """Run `lime-train`."""
    return _launch("train.cli")


def evaluate() -> int:
    """Run `lime-eval`."""
    return _launch("eval.cli")


def estimate() -> int:
    """Run `lime-estimate`, whose clones are rendered."""
    return _launch("render.commands.clone")


def export() -> int:
    """Run `lime-export`."""
    return _launch("commands.export")


def live() -> int:
    """Run `lime-live`."""
    return _launch("commands.live")
