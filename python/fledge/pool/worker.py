# SPDX-License-Identifier: Apache-2.0
"""A worker of a Dask scheduler flies an item.

The worker hands it to a child process of its own, `python3 -m fledge.pool.worker PIPE`, which creates the work once: a
flight cannot end a worker. A child first reports whether its Fledge and its mission are those of the work.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from typing import Any

from fledge.errors import Failure, SetupError
from fledge.mission.provenance import digest, identity
from fledge.pool.local import Local
from fledge.pool.work import LAST_LINES, Death, Died, Item, Result, Work, answer, death, sealed

_PATIENCE = 5.0     # [s] for the last lines of a child that has ended, while programs that it started hold its output


class Refused(Exception):
    """A worker must not fly: its Fledge or mission differs."""


class _Died(Exception):
    """A child ended within an item."""

    def __init__(self, death: Death) -> None:
        super().__init__(death.text)
        self.death = death


class _Child:
    """A process that flies items of a job."""

    def __init__(self, job: bytes) -> None:
        self._pipe, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "fledge.pool.worker", str(theirs.fileno())], stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                pass_fds=[theirs.fileno()])
        self._printed: deque[str] = deque(maxlen=LAST_LINES)    # of the item that it flies
        self._reader = threading.Thread(target=self._pass_on, daemon=True)
        self._reader.start()
        problem = self.request(job).decode()
        if problem:
            self.end()
            raise Refused(problem)

    def request(self, data: bytes) -> bytes:
        """The reply to a request. Raises _Died."""
        self._printed.clear()
        try:
            self._pipe.send_bytes(data)
            return self._pipe.recv_bytes()
        except (OSError, EOFError):
            how = death(self._process.wait())
            self._reader.join(_PATIENCE)
            raise _Died(Death(how, tuple(self._printed))) from None

    def _pass_on(self) -> None:
        """What the mission prints goes where the worker's errors go."""
        assert self._process.stdout
        with self._process.stdout as lines:
            for line in lines:
                self._printed.append(line.rstrip("\n"))
                with suppress(OSError, ValueError):     # it is closed
                    sys.stderr.write(line)

    def end(self) -> None:
        self._pipe.close()
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


def fly(job: bytes, item: bytes, twice: bool) -> bytes:
    """The answer to an item, or the Death of the process that flew it, sealed for the job and the item. twice: fly it
    once more then, because something else, as a lack of memory, may have ended the process. Raises Refused."""
    try:
        child = _child(job)
        reply = child.request(item)
    except _Died as error:
        if twice:
            return fly(job, item, False)
        return sealed(pickle.dumps(error.death), job, item)
    _rest(job, child)
    return reply


def _rest(job: bytes, child: _Child) -> None:
    """Return a child that has flown to the idle ones."""
    with _lock:
        _idle.setdefault(job, []).append(child)


# --- the child -------------------------------------------------------------------------------------

class _Apart(Work[Item, Result | Died[Item]]):
    """Flies each item in a copy of this process."""

    def __init__(self, work: Work[Item, Result]) -> None:
        self._work, self._pool = work, Local(1)

    def fly(self, item: Item) -> Result | Died[Item]:
        (_, result), = self._pool.fly(self._work, [item])
        return result


def _work(job: dict[str, Any]) -> tuple[Work[Any, Any] | None, str]:
    """(the work of a job, why it must not fly here). Another revision with the same files may fly."""
    kind, arguments = job["work"]
    try:
        work: Work[Any, Any] = kind(*arguments)
    except (SetupError, Failure) as error:
        return None, f"cannot make what it must fly: {error}"
    ours = {**identity(work.folder), **work.facts}
    return work, "; ".join(f"has another {'revision of Fledge' if name == 'fledge' else name}: "
                           f"{ours.get(name, 'unknown')}, not {wanted}"
                           for name, wanted in job["identity"].items() if ours.get(name) != wanted
                           and not (name in job["digests"] and digest(name, work.folder) == job["digests"][name]))


def _serve(pipe: Connection) -> None:
    """Answer a job, then items of it, until the worker closes the pipe."""
    signal.signal(signal.SIGINT, lambda *_: None)
    busy = threading.Event()
    busy.set()
    threading.Thread(target=_end_with_worker, args=[pipe.fileno(), busy], daemon=True).start()
    job = pipe.recv_bytes()
    work, problem = _work(pickle.loads(job))
    pipe.send_bytes(problem.encode())
    if work is not None:
        work.begin()
        flying = _Apart(work) if work.fresh else work
        with suppress(EOFError):
            while True:
                busy.clear()
                item = pipe.recv_bytes()
                busy.set()
                pipe.send_bytes(sealed(answer(flying, pickle.loads(item)), job, item))


def _end_with_worker(pipe: int, busy: threading.Event) -> None:
    """End this process in the middle of an item, when nothing reads its answer any more; between two items it ends by
    itself, and deletes its temporary folders."""
    closed = select.poll()
    closed.register(pipe, 0)
    closed.poll()
    if busy.is_set():
        os._exit(1)


if __name__ == "__main__":
    _serve(Connection(int(sys.argv[1])))
