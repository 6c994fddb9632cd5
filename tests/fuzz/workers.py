"""Child processes that read inputs, each watched from outside: for crashes, hangs and memory."""

import contextlib
import faulthandler
import math
import multiprocessing
import os
import shutil
import signal
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from . import inputs, seeds, verdicts
from .doors import Door
from .inputs import Block
from .verdicts import FELL, READ, Limits, Verdict

_BEGIN_SECONDS = 180.0
"""Time for all but reading: imports, the first reading of sound inputs, making damaged ones."""
_TO_END = 5.0  # seconds that an idle process has to end by itself
_TICK = 0.1  # seconds between two looks at the processes
_LARGEST = 3 << 30
"""Memory with which a process is replaced, because some libraries never give any back."""
_LOG_END = 6000  # characters kept of what a process printed before it ended
_ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "TF_NUM_INTRAOP_THREADS"), "1"),
    **{"TF_NUM_INTEROP_THREADS": "1", "TF_CPP_MIN_LOG_LEVEL": "3", "CUDA_VISIBLE_DEVICES": ""},
}


@dataclass(frozen=True)
class Outcome:
    """The verdict on an input, and where its files lie if it fell through."""

    door: str
    index: int
    verdict: Verdict
    folder: Path


class Unsound(RuntimeError):
    """A seed that is refused without any damage, or cannot be damaged: nothing can be shown."""


def tried(
    doors: Mapping[str, Door],
    blocks: Iterator[Block],
    *,
    seed: int,
    count: int,
    scratch: Path,
    limits: Limits = verdicts.LIMITS,
) -> Iterator[Outcome]:
    """Try inputs in child processes and yield what becomes of each, in any order.

    Args:
        doors: doors by name.
        blocks: inputs to try; an endless iterator is followed until the caller stops.
        seed: seed of the run.
        count: number of processes.
        scratch: empty folder for the seeds and the inputs.
        limits: limits of each input.

    Raises:
        Unsound: if a seed is not read as it is, or cannot be damaged.
    """
    os.environ.update(_ENVIRONMENT)
    _made(scratch, {door.seeds for door in doors.values()})
    started: list[_Worker] = []
    try:
        for number in range(count):
            started.append(_Worker(doors, seed, scratch, limits, number))
        while any([worker.is_busy or worker.take(blocks) for worker in started]):
            wait([worker.pipe for worker in started if worker.is_busy], _TICK)
            for worker in started:
                yield from worker.heard()
    finally:
        for worker in started:
            worker.end()


def _made(scratch: Path, names: set[str]) -> None:
    """Write the seeds in a process of its own, which may import what it likes."""
    process = multiprocessing.get_context("spawn").Process(
        target=_make, args=(scratch / "seeds", tuple(sorted(names)), scratch / "seeds.txt")
    )
    process.start()
    process.join()
    if process.exitcode:
        raise RuntimeError(f"no seeds could be made:\n{_end(scratch / 'seeds.txt')}")


def _make(folder: Path, names: tuple[str, ...], log: Path) -> None:
    _quiet(log)
    seeds.make(folder, names)


class _Worker:
    """A child process, and another one after each that had to be ended.

    Args:
        doors: doors by name.
        seed: seed of the run.
        scratch: folder of seeds and inputs.
        limits: limits of each input.
        number: number among the workers.
    """

    def __init__(
        self, doors: Mapping[str, Door], seed: int, scratch: Path, limits: Limits, number: int
    ):
        self._doors, self._seed, self._limits = doors, seed, limits
        self._scratch, self._log = scratch, scratch / f"worker-{number}.txt"
        self._number, self._block = number, Block("", 0, 0)
        self._start()

    @property
    def is_busy(self) -> bool:
        """Whether inputs are left of the block that was taken."""
        return self._block.first < self._block.last

    def take(self, blocks: Iterator[Block]) -> bool:
        """Take the next block; return whether there is one."""
        block = next(blocks, None)
        if block is not None:
            if verdicts.resident(self._process.pid) > _LARGEST:
                self._start()
            self._give(block)
        return block is not None

    def heard(self) -> Iterator[Outcome]:
        """Yield what has become of inputs since the last call; end a process that is at fault."""
        has_ended = False
        try:
            while self.pipe.poll():
                event, value = self.pipe.recv()
                if event == "begun":
                    self._expect(self._limits.seconds)
                    self._before = value
                elif event == "unsound":
                    raise Unsound(value)
                else:
                    yield self._outcome(value)
        except (EOFError, OSError):
            has_ended = True
        if not self.is_busy:
            return
        fault = self._fault(has_ended)
        if fault and self._before is None:
            raise Unsound(f"{self._block.door}, before any damage: {fault}")
        if fault:
            yield self._outcome(Verdict(FELL, fault))
            self._start()
            if self.is_busy:
                self._give(self._block)

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self.pipe.close()
        if not self.is_busy:
            self._process.join(_TO_END)
        self._process.kill()
        self._process.join()

    def _fault(self, has_ended: bool) -> str | None:
        """Return why the process can do no more; it has ended then, or is ended."""
        if has_ended:
            self._process.join()
            code = self._process.exitcode or 0
            how = signal.Signals(-code).name if code < 0 else f"status {code}"
            return f"crashed: {how}\n{_end(self._log)}"
        seconds = self._now() - self._since
        taken = verdicts.resident(self._process.pid) - (self._before or 0)
        # First, because what fills the memory is slow as well.
        if self._before is not None and taken > self._limits.bytes:
            self._process.kill()
            return f"took {taken / 2**30:.1f} GB of memory, and was ended"
        if seconds > self._seconds:
            os.kill(self._process.pid, signal.SIGUSR1)  # it prints where it is
            time.sleep(0.5)
            self._process.kill()
            return f"hung: no end after {seconds:.0f} s\n{_end(self._log)}"
        return None

    def _outcome(self, verdict: Verdict) -> Outcome:
        door, index = self._block.door, self._block.first
        self._block = Block(door, index + 1, self._block.last)
        self._expect(_BEGIN_SECONDS)  # while the next one is made
        return Outcome(door, index, verdict, _folder(self._scratch, door, index))

    def _expect(self, seconds: float) -> None:
        """Let the process take that long from now on until it is heard of."""
        self._since, self._seconds = self._now(), seconds

    def _now(self) -> float:
        """Return a time in seconds that stands still while the process waits for a processor."""
        return time.monotonic() - verdicts.queued(self._process.pid)

    def _start(self) -> None:
        if hasattr(self, "_process"):
            self.end()
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        arguments = (other, dict(self._doors), self._seed, self._scratch, self._log, self._limits)
        self._process: Any = context.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        other.close()

    def _give(self, block: Block) -> None:
        self._block, self._before = block, None
        self._expect(_BEGIN_SECONDS)
        with contextlib.suppress(OSError):  # it has ended; `heard` tells
            self.pipe.send(block)


def _work(
    pipe: Connection, doors: Mapping[str, Door], seed: int, scratch: Path, log: Path, limits: Limits
) -> None:
    """Read the inputs of blocks until the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    file = _quiet(log)
    faulthandler.enable(file)
    faulthandler.register(signal.SIGUSR1, file)
    warnings.simplefilter("ignore")
    begun: set[str] = set()
    with contextlib.suppress(EOFError):
        while True:
            block: Block = pipe.recv()
            door = doors[block.door]
            if block.door not in begun:
                _check_sound(block.door, door, scratch, limits, pipe)
                begun.add(block.door)
            for index in range(block.first, block.last):
                os.truncate(file, 0)
                folder = _folder(scratch, block.door, index)
                shutil.rmtree(folder, ignore_errors=True)
                try:
                    inputs.write(scratch / "seeds" / door.seeds, seed, block.door, index, folder)
                except Exception as error:
                    pipe.send(("unsound", f"{block.door} {index} cannot be made: {error!r}"))
                    return
                pipe.send(("begun", verdicts.resident()))
                # Should nobody watch any more, it ends by itself.
                signal.alarm(math.ceil(30 * limits.seconds))
                verdict = verdicts.judged(door, folder, limits)
                signal.alarm(0)
                if verdict.kind != FELL:
                    shutil.rmtree(folder, ignore_errors=True)
                pipe.send(("done", verdict))


def _check_sound(name: str, door: Door, scratch: Path, limits: Limits, pipe: Connection) -> None:
    """Read a door's seeds as they are, which also imports what it needs."""
    for source in sorted((scratch / "seeds" / door.seeds).iterdir()):
        folder = scratch / f"sound-{os.getpid()}"
        inputs.copy(source, folder)
        verdict = verdicts.judged(door, folder, limits)
        shutil.rmtree(folder)
        if verdict.kind != READ:
            pipe.send(("unsound", f"{name}, {source.name}, undamaged: {verdict.reason}"))
            return


def _folder(scratch: Path, door: str, index: int) -> Path:
    return scratch / f"{door}-{index:07d}"


def _quiet(log: Path) -> int:
    """Send all that this process prints, C libraries' words too, to a file; return its handle."""
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    sys.stdout.flush()
    os.dup2(file, 1)
    os.dup2(file, 2)
    return file


def _end(log: Path) -> str:
    return log.read_text(encoding="utf-8", errors="replace")[-_LOG_END:]
