"""Sessions of ONNX Runtime that obey the processors of a job, and outlive a fork."""

import ctypes
import os
import weakref
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import onnxruntime

from lime_keras import processors

_LONGEST = 200  # longest part of ONNX Runtime's message that is quoted, in characters
_NO_MEMORY = ("bad_alloc", "Failed to allocate memory")
"""Words by which ONNX Runtime tells that memory is used up, in errors of its own classes."""


class Session:
    """An ONNX graph that is run on the processor, in a forked child as in its parent.

    A fork copies the memory of a session and none of its threads: in the child it can neither run
    nor be closed, both wait for them for ever. So the child keeps it, unused, and opens another.

    Args:
        content: function that returns the graph, its bytes or its path; called now, and again in
            a child that runs it.
        streaming: whether the memory of a run is kept for the next one.

    Raises:
        Exception: ONNX Runtime's own, which have no common class, if the content is no graph.
    """

    def __init__(self, content: Callable[[], bytes | str], *, streaming: bool = False):
        self._content, self._streaming = content, streaming
        self._session: onnxruntime.InferenceSession | None = None
        self.opened()
        _OPEN.add(self)

    def opened(self) -> onnxruntime.InferenceSession:
        """Return the session of this process."""
        if self._session is None:
            options = onnxruntime.SessionOptions()
            # Left to itself, ONNX Runtime binds a thread to every core of the machine.
            options.intra_op_num_threads = processors.count()
            # Each graph has threads of its own. Threads that wait for work by spinning would take
            # the processor from the next graph.
            options.add_session_config_entry("session.intra_op.allow_spinning", "0")
            # The arena keeps the largest batch's memory for the life of the process.
            options.enable_cpu_mem_arena = self._streaming
            self._session = onnxruntime.InferenceSession(
                self._content(), options, providers=["CPUExecutionProvider"]
            )
        return self._session

    def run(self, outputs: Sequence[str], inputs: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """Return outputs, in the order of their names, for inputs by name.

        Raises:
            ValueError: in ONNX Runtime's words, if the graph takes or answers something else.
            MemoryError: if memory is used up.
        """
        try:
            return self.opened().run(outputs, inputs)
        except (MemoryError, ValueError):
            raise
        except Exception as error:  # ONNX Runtime's own classes have no common base.
            words = " ".join(str(error).split())[:_LONGEST]
            kind = MemoryError if any(sign in words for sign in _NO_MEMORY) else ValueError
            raise kind(words) from error

    def leave(self) -> None:
        """Let go of the session without closing it."""
        if self._session is not None:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._session))
            self._session = None


_OPEN: "weakref.WeakSet[Session]" = weakref.WeakSet()


def _leave_all() -> None:
    for session in list(_OPEN):
        session.leave()


os.register_at_fork(after_in_child=_leave_all)
