# SPDX-License-Identifier: Apache-2.0
"""Copies of this process, which answer through pipes."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import NoReturn

from fledge.pool.work import death

TICK = 0.1      # [s] at most between two calls of tick()
_DEATH_SIGNAL = 1       # PR_SET_PDEATHSIG of prctl()


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0))


def fork(deaf: bool = False) -> int:
    """As os.fork(), for a copy that ends when this process ends, however it does. deaf: the copy does nothing on
    Ctrl-C, which a terminal sends to all; programs that it starts do."""
    sys.stdout.flush()
    sys.stderr.flush()
    prctl, parent = ctypes.CDLL(None).prctl, os.getpid()
    # Blocked until the copy ignores it: it would handle Ctrl-C as if it were this process.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    # The copy must not collect what this process made: a destructor may wait for a thread, and fork() copies none.
    collects = gc.isenabled()
    gc.disable()
    try:
        process = os.fork()
        if not process:
            gc.freeze()
            prctl(_DEATH_SIGNAL, signal.SIGKILL)
            if os.getppid() != parent:
                os._exit(1)
            if deaf:
                signal.signal(signal.SIGINT, lambda *_: None)
    finally:
        if collects:
            gc.enable()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return process


def leave(code: int) -> NoReturn:
    """End such a copy, once what it printed is written, as far as that is possible."""
    try:
        for out in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):     # as where the disk is full
                out.flush()
    finally:
        os._exit(code)


class Children:
    """Copies of this process, each of which flies the item at a place, and answers with bytes."""

    def __init__(self) -> None:
        self._flying: dict[Connection, tuple[int, int]] = {}    # pipe -> (process, place)

    def __len__(self) -> int:
        """How many are flying."""
        return len(self._flying)

    def fork(self, place: int) -> Connection | None:
        """Begin a copy. Returns None here; in the copy, its pipe to this process."""
        ours, theirs = Pipe()
        process = fork(deaf=True)
        if process:
            theirs.close()
            self._flying[ours] = process, place
            return None
        for pipe in [ours, *self._flying]:
            pipe.close()
        self._flying = {}
        return theirs

    def answers(self) -> Iterator[tuple[int, bytes | str, Connection | None]]:
        """(place, answer, pipe) of each that answers within a short time; of one that ended instead, how in words, and
        None. One that has answered waits for give() or dismiss()."""
        for pipe in wait(list(self._flying), TICK):
            assert isinstance(pipe, Connection)
            process, place = self._flying.pop(pipe)
            try:
                answer = pipe.recv_bytes()
            except (EOFError, OSError):
                pipe.close()
                yield place, death(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])), None
                continue
            self._flying[pipe] = process, -1
            yield place, answer, pipe

    def give(self, pipe: Connection, place: int) -> None:
        """Let a copy that has answered fly another item."""
        self._flying[pipe] = self._flying[pipe][0], place
        with suppress(OSError):     # it has died: answers() reports it
            pipe.send(place)

    def dismiss(self, pipe: Connection) -> None:
        """Let a copy that has answered end."""
        process, _ = self._flying.pop(pipe)
        with suppress(OSError):
            pipe.send(None)
        pipe.close()
        os.waitpid(process, 0)

    def end(self) -> None:
        """End all at once."""
        for process, _ in self._flying.values():
            os.kill(process, signal.SIGKILL)
        while self._flying:
            pipe, (process, _) = self._flying.popitem()
            pipe.close()
            os.waitpid(process, 0)
