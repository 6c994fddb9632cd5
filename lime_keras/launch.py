"""The commands as they are installed, which also report an interruption during their imports."""

import functools
import signal
import sys
import threading


def _launch(module: str) -> int:
    try:
        from importlib import import_module

        from lime_keras import console

        console.open_streams()
        sys.unraisablehook = console.interrupt_again
        status = int(import_module(f"lime_keras.{module}").main())
        if threading.current_thread() is threading.main_thread():
            # All is done: an interruption while Python ends would turn the status into a failure.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        return status
    except KeyboardInterrupt:
        print("\ninterrupted: nothing was begun", file=sys.stderr)
        return 130


# By the names of `setup.py`; the clones of `lime-estimate` are rendered.
render = functools.partial(_launch, "render.cli")
train = functools.partial(_launch, "train.cli")
evaluate = functools.partial(_launch, "eval.cli")
estimate = functools.partial(_launch, "render.commands.clone")
export = functools.partial(_launch, "commands.export")
live = functools.partial(_launch, "commands.live")
