# SPDX-License-Identifier: Apache-2.0
"""What a worker of a Dask scheduler does with a share of a campaign's runs.

The worker hands it to a child process of its own, `python3 -m fledge.montecarlo.worker`, which loads the campaign once:
what happens in a run cannot end a worker. If the child dies, the share is flown again in halves, until the run that
ends it is alone, and has failed. A child says first whether its Fledge and its mission are those of the campaign.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading

from fledge.errors import SetupError
from fledge.mission.provenance import identity
from fledge.montecarlo.shares import Share, death, fly_loaded, fly_share, halves


class Refused(Exception):
    """A worker must not fly: its Fledge or mission is another one."""


class _Died(Exception):
    """A child ended within a share."""


class _Child:
    """A process that flies shares of a job."""

    def __init__(self, job: bytes) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.montecarlo.worker"],
                                         stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        problem = pickle.loads(self.ask(job))
        if problem:
            self.end()
            raise Refused(problem)

    def ask(self, request: bytes) -> bytes:
        """The answer to a request. Raises _Died."""
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


def _child(job):
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


def fly(job: bytes, first: int, end: int, twice: bool = True) -> list[bytes]:
    """The shares of these runs, as bytes; (index, reason) of a run that ends the process."""
    try:
        child = _child(job)
        share = child.ask(pickle.dumps((first, end)))
    except _Died as error:
        if end - first > 1:
            return [share for half in halves(first, end) for share in fly(job, *half)]
        # Once more: something else, as a lack of memory, may have ended the process.
        return fly(job, first, end, False) if twice else [pickle.dumps((first, str(error)))]
    _rest(job, child)
    return [share]


def _rest(job, child):
    """A child has flown, and may be asked again."""
    with _lock:
        _idle.setdefault(job, []).append(child)


# --- the child -------------------------------------------------------------------------------------

def _send(pipe, message):
    pipe.write(len(message).to_bytes(8, "little") + message)
    pipe.flush()


def _receive(pipe):
    size = pipe.read(8)
    message = pipe.read(int.from_bytes(size, "little")) if len(size) == 8 else b""
    if not message:
        raise EOFError
    return message


def _serve() -> None:
    """Answer a job, then shares of it, until the worker closes the pipe."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)       # what the mission prints
    job = pickle.loads(_receive(sys.stdin.buffer))
    campaign, problem = None, ""
    try:
        kind, arguments = job["campaign"]
        campaign = kind(*arguments)
        ours = identity(campaign.folder)
        problem = "; ".join(f"has another {'revision of Fledge' if name == 'fledge' else 'mission'}: "
                            f"{ours.get(name, 'unknown')}, not {wanted}"
                            for name, wanted in job["identity"].items() if ours.get(name) != wanted)
    except SetupError as error:
        problem = f"cannot load the campaign: {error}"
    _send(answers, pickle.dumps(problem))
    while campaign:
        try:
            first, end = pickle.loads(_receive(sys.stdin.buffer))
        except EOFError:
            return
        if campaign.has_callables:
            share = Share.joined([fly_loaded(campaign, job["seed"], index) for index in range(first, end)])
        else:
            share, _ = fly_share(campaign, job["seed"], first, end)
        _send(answers, pickle.dumps(share))


if __name__ == "__main__":
    _serve()
