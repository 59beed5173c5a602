# SPDX-License-Identifier: Apache-2.0
"""What a worker of a Dask scheduler does with an item.

The worker hands it to a child process of its own, `python3 -m fledge.pool.worker`, which makes the work once: what
happens in a flight cannot end a worker. A child says first whether its Fledge and its mission are those of the work.
"""

from __future__ import annotations

import os
import pickle
import select
import subprocess
import sys
import threading
from typing import Any, BinaryIO

from fledge.errors import Failure, SetupError
from fledge.mission.provenance import identity
from fledge.pool.local import Local
from fledge.pool.work import Died, Item, Result, Work, answer, death


class Refused(Exception):
    """A worker must not fly: its Fledge or mission is another one."""


class _Died(Exception):
    """A child ended within an item."""


class _Child:
    """A process that flies items of a job."""

    def __init__(self, job: bytes) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.pool.worker"],
                                         stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        problem = self.ask(job).decode()
        if problem:
            self.end()
            raise Refused(problem)

    def ask(self, request: bytes) -> bytes:
        """The answer to a request. Raises _Died."""
        assert self._process.stdin and self._process.stdout
        try:
            _send(self._process.stdin, request)
            return _receive(self._process.stdout)
        except (OSError, EOFError):
            raise _Died(death(self._process.wait())) from None

    def end(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait()


_idle: dict[bytes, list[_Child]] = {}   # by job
_lock = threading.Lock()


def _child(job: bytes) -> _Child:
    """An idle child, or a new one. Those of other jobs are ended."""
    with _lock:
        others = [child for other in [*_idle] if other != job for child in _idle.pop(other)]
        idle = _idle.setdefault(job, [])
        child = idle.pop() if idle else None
    for other in others:
        other.end()
    return child or _Child(job)


def check_job(job: bytes) -> str:
    """Why this worker must not fly a job; "" if it may."""
    try:
        child = _child(job)
    except (Refused, _Died) as error:
        return str(error)
    _rest(job, child)
    return ""


def fly(job: bytes, item: bytes, twice: bool) -> bytes | str:
    """The answer to an item, or how the process died that flew it. twice: fly it once more then, because something
    else, as a lack of memory, may have ended the process. Raises Refused."""
    try:
        child = _child(job)
        found = child.ask(item)
    except _Died as error:
        return fly(job, item, False) if twice else str(error)
    _rest(job, child)
    return found


def _rest(job: bytes, child: _Child) -> None:
    """A child has flown, and may be asked again."""
    with _lock:
        _idle.setdefault(job, []).append(child)


# --- the child -------------------------------------------------------------------------------------

def _send(pipe: BinaryIO, message: bytes) -> None:
    pipe.write(len(message).to_bytes(8, "little") + message)
    pipe.flush()


def _receive(pipe: BinaryIO) -> bytes:
    size = pipe.read(8)
    n = int.from_bytes(size, "little")
    message = pipe.read(n)
    if len(size) < 8 or len(message) < n:
        raise EOFError
    return message


class _Apart(Work[Item, Result | Died[Item]]):
    """Flies each item in a copy of this process."""

    def __init__(self, work: Work[Item, Result]) -> None:
        self._work, self._pool = work, Local(1)

    def fly(self, item: Item) -> Result | Died[Item]:
        (_, found), = self._pool.fly(self._work, [item])
        return found


def _made(job: dict[str, Any]) -> tuple[Work[Any, Any] | None, str]:
    """(the work of a job, why it must not fly here)"""
    kind, arguments = job["work"]
    try:
        work: Work[Any, Any] = kind(*arguments)
    except (SetupError, Failure) as error:
        return None, f"cannot make what it must fly: {error}"
    ours = {**identity(work.folder), **work.facts}
    return work, "; ".join(f"has another {'revision of Fledge' if name == 'fledge' else name}: "
                           f"{ours.get(name, 'unknown')}, not {wanted}"
                           for name, wanted in job["identity"].items() if ours.get(name) != wanted)


def _serve() -> None:
    """Answer a job, then items of it, until the worker closes the pipe."""
    import signal

    signal.signal(signal.SIGINT, lambda *_: None)
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)       # what the mission prints
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    threading.Thread(target=_end_with_worker, args=[requests], daemon=True).start()
    work, problem = _made(pickle.loads(_receive(requests)))
    _send(answers, problem.encode())
    if work is None:
        return
    work.begin()
    flying = _Apart(work) if work.fresh else work
    while True:
        try:
            item = pickle.loads(_receive(requests))
        except EOFError:
            return
        _send(answers, answer(flying, item))


def _end_with_worker(requests: BinaryIO) -> None:
    """End this process in the middle of an item, when nothing reads its answer any more."""
    closed = select.poll()
    closed.register(requests, 0)
    closed.poll()
    os._exit(1)


if __name__ == "__main__":
    _serve()
